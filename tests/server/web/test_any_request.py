"""Any request, whether the schema allows it or not, gets an answer that the schema knows, and no 5xx by mistake."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from hypothesis.errors import Unsatisfiable
from schemathesis import Case, GenerationMode
from schemathesis.core.result import Ok
from schemathesis.python.asgi import HOST, shutdown_lifespans
from schemathesis.specs.openapi.checks import positive_data_acceptance, response_schema_conformance

from server.web.app import create_api
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.memory_rig import VIEWS
from tests.support.serving import assembled, plan_of, serving

EXAMPLES = 5
NOT_IN_THE_SCHEMA: Any = [positive_data_acceptance]
"""What this rig can do, and what there is on this server, is not in the schema."""
MISREAD = ("/api/runs/{run_id}/results/{results_id}/{volume}", "/api/rig/live/volume")
"""Schemathesis 4.32 rewrites ``prefixItems`` of an answer, and then takes what it has written for no schema."""
ENDLESS = "/api/events"
Known = dict[str, Any]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Known]:
    """A data directory with a run, its volumes and a calibration, and the names that lead to them."""
    data_dir = tmp_path_factory.mktemp("any") / "runs"
    with serving(data_dir) as server:
        use_a_calibration(server)
        run_id, _ = server.run_to_its_end(plan_of(shots=1))
        (job,) = wait_for_jobs(server, 1)
    names = {"run_id": run_id, "calibration_id": "cal", "job_id": job["id"], "results_id": job["results_id"]}
    return data_dir, {**names, "volume": "shot_00000_a", "shot": 0, "view": VIEWS[0]}


@pytest.fixture(scope="module")
def api(recorded: tuple[Path, Known]) -> Iterator[schemathesis.BaseSchema]:
    """The schema of an application that is reached without a socket."""
    with assembled(recorded[0]) as services:
        app = create_api(replace(services, host_names=(HOST,)))
        try:
            yield schemathesis.openapi.from_asgi("/api/openapi.json", app)
        finally:
            shutdown_lifespans()


def test_every_answer_is_one_that_the_schema_knows(api: schemathesis.BaseSchema, recorded: tuple[Path, Known]) -> None:
    known, tried = recorded[1], 0
    for result in api.get_all_operations():
        assert isinstance(result, Ok)
        operation = result.ok()
        if operation.path == ENDLESS:
            continue
        for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
            _try(operation, mode, known)
        tried += 1
    assert tried == sum(len(methods) for path, methods in api.raw_schema["paths"].items() if path != ENDLESS)


def _try(operation: Any, mode: GenerationMode, known: Known) -> None:
    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode), exists=st.booleans())
    def ask(case: Case[Any], exists: bool) -> None:
        if exists:
            case.path_parameters.update({name: known[name] for name in case.path_parameters if name in known})
        answer = case.call()
        assert answer.status_code < 500, f"{case.as_curl_command()}\n{answer.text}"
        misread = [response_schema_conformance] if operation.path in MISREAD else []
        case.validate_response(answer, excluded_checks=[*NOT_IN_THE_SCHEMA, *misread])

    try:
        ask()
    except Unsatisfiable:
        assert mode is GenerationMode.NEGATIVE, "a request without parameters cannot be wrong"
