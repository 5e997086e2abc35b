"""An id names one file in one folder, wherever it is written: path, query or body."""

import json
from typing import Any

import pytest

from processing.reconstruction.settings import ReconstructionSettings
from tests.server.web.test_api import use_a_calibration, wait_for_jobs
from tests.support.serving import Serving, plan_of

NO_IDS = ("../draft", "..", ".hidden", "", "a/b", "a\\b", "a\x00b", "x" * 300, "line\n", "ü")
BODIES: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("PUT", "/api/calibrations/current", "id", {}),
    ("POST", "/api/calibrations", "run_id", {}),
    ("POST", "/api/jobs", "run_id", {}),
    ("POST", "/api/jobs", "calibration", {"run_id": "none"}),
    ("POST", "/api/runs", "calibration", plan_of()),
    ("POST", "/api/runs", "references", plan_of()),
)


@pytest.mark.parametrize(("method", "path", "field", "body"), BODIES)
def test_what_is_no_id_is_refused_in_every_body(
    server: Serving, method: str, path: str, field: str, body: dict[str, Any]
) -> None:
    (server.services.data_dir / "draft.json").write_text("{}")
    for text in NO_IDS:
        value = [text] if field == "references" else text
        answer = server.http.request(method, path, json={**body, field: value})
        assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json"), repr(text)


@pytest.mark.parametrize(
    "path", ["/api/runs/{}", "/api/calibrations/{}", "/api/runs/{}/results", "/api/jobs?run_id={}"]
)
def test_what_is_too_long_for_an_id_is_refused_in_paths_and_queries(server: Serving, path: str) -> None:
    assert server.http.get(path.format("x" * 300)).status_code == 422
    assert server.http.get(path.format("x" * 200)).status_code in (200, 404)


def test_results_are_named_alike_by_server_and_command_line(server: Serving) -> None:
    use_a_calibration(server)
    server.run_to_its_end(plan_of(shots=1))
    (job,) = wait_for_jobs(server, 1)
    assert job["results_id"] == ReconstructionSettings().results_id("cal")


HALF = "\ud800"
"""Of a character: JSON can write it, and no file, answer or event can."""


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/api/runs", plan_of(notes={"remark": HALF})),
        ("POST", "/api/runs", plan_of(notes={"more": {"a": HALF}})),
        ("POST", "/api/runs", plan_of(references=[HALF])),
        ("POST", "/api/rig/shot", {"pulse": {"current_a": {"view1": 5}}, "references": [HALF]}),
        ("POST", "/api/bench/faults", {"kind": "killed", "view": HALF}),
    ],
)
def test_half_a_character_is_refused_in_every_body(
    server: Serving, method: str, path: str, body: dict[str, Any]
) -> None:
    headers = {"Content-Type": "application/json"}
    answer = server.http.request(method, path, content=json.dumps(body), headers=headers)
    assert answer.status_code == 422, answer.text
    assert "half a character" in answer.json()["detail"]
    whole = json.dumps(body).replace("ud800", "ud83d\\ude00")
    assert "half a character" not in server.http.request(method, path, content=whole, headers=headers).text


@pytest.mark.parametrize("text", ["\\ud800", "[" * 5000 + '"\\ud800"' + "]" * 5000, '{"\\ud800'])
def test_abort_takes_no_notice_of_a_body(server: Serving, text: str) -> None:
    for headers in ({}, {"Content-Type": "application/json"}):
        assert server.http.post("/api/rig/abort", content=text, headers=headers).status_code == 202
        assert server.http.post("/api/runs", content=text, headers=headers).status_code in (400, 422)
