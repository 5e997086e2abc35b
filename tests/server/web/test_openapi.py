"""The schema is part of the product: a change of it is a change of version and of this snapshot."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.serving import Serving

SNAPSHOT = Path(__file__).with_name("openapi.json")


@pytest.fixture
def schema(server: Serving) -> dict[str, Any]:
    return dict(server.http.get("/api/openapi.json").json())


def test_the_committed_schema_is_the_one_that_is_served(schema: dict[str, Any]) -> None:
    assert schema == json.loads(SNAPSHOT.read_text()), (
        f"the API has changed: look at the difference, then write it with\n"
        f"  python -m tests.server.web.write_openapi > {SNAPSHOT}"
    )


def test_every_operation_says_what_it_does_and_how_it_fails(schema: dict[str, Any]) -> None:
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            assert operation["description"], f"{method} {path}"
            assert "application/problem+json" in operation["responses"]["422"]["content"], f"{method} {path}"


def test_no_body_accepts_unknown_fields(schema: dict[str, Any]) -> None:
    bodies = [
        operation["requestBody"]["content"]["application/json"]["schema"]["$ref"].rsplit("/", 1)[-1]
        for methods in schema["paths"].values()
        for operation in methods.values()
        if "requestBody" in operation
    ]
    assert len(bodies) >= 6
    for name in bodies:
        assert schema["components"]["schemas"][name]["additionalProperties"] is False, name


def test_every_operation_parameter_and_field_is_described(schema: dict[str, Any]) -> None:
    silent = [
        f"{method} {path}"
        for path, methods in schema["paths"].items()
        for method, operation in methods.items()
        if not operation.get("description")
    ]
    silent += [
        f"{method} {path}: {parameter['name']}"
        for path, methods in schema["paths"].items()
        for method, operation in methods.items()
        for parameter in operation.get("parameters", ())
        if not parameter.get("description")
    ]
    silent += [
        f"{name}.{field}"
        for name, described in schema["components"]["schemas"].items()
        for field, value in described.get("properties", {}).items()
        if not value.get("description")
    ]
    assert silent == []
