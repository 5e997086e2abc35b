"""What a run says of itself, as lines of name and value. Pure."""

from collections.abc import Iterator, Mapping
from typing import Any

from daq.files.run_directory import RunHeader

Facts = list[tuple[str, str]]


def plan_facts(header: RunHeader) -> Facts:
    """The plan, as the operator wrote it, and what was known of light and spray."""
    if header.plan is None:
        told = header.model_dump(include={"polarity", "separation_ns", "rate_hz", "spray"}, mode="json")
        return facts_of(told)
    return facts_of(header.plan.model_dump(mode="json", exclude={"notes"}))


def provenance_facts(header: RunHeader) -> Facts:
    """Devices, versions, calibration and configuration of that day."""
    told = header.model_dump(
        mode="json",
        include={"created_utc", "devices", "software", "calibration_id", "calibration_sha256", "configuration"},
    )
    return facts_of(told)


def facts_of(document: Mapping[str, Any]) -> Facts:
    """Every value of a document that says something, by the names that lead to it."""
    return list(_walk((), document))


def _walk(names: tuple[str, ...], value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _walk((*names, str(name)), inner)
    elif isinstance(value, list | tuple) and any(isinstance(inner, Mapping) for inner in value):
        for number, inner in enumerate(value):
            yield from _walk((*names, str(number)), inner)
    elif value not in (None, "", [], ()):
        text = ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
        yield " · ".join(name.replace("_", " ") for name in names), text
