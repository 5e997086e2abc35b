"""Print docs/rig-file.md: every key of a rig file, a camera profile and an import manifest, from the models."""

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from pydantic import BaseModel

from daq.drivers.camera_profile import CameraProfile
from daq.faults import FaultKind
from processing.runs.manifest.import_manifest import Manifest
from server.rig.config import RigConfig

Schema = Mapping[str, Any]

UNITS = {
    "ns": "ns",
    "us": "µs",
    "s": "s",
    "hz": "Hz",
    "um": "µm",
    "mm": "mm",
    "px": "px",
    "deg": "°",
    "a": "A",
    "bytes": "bytes",
}
NAMES = {"string": "text", "integer": "integer", "number": "number", "boolean": "true or false"}
FORMATS = {"path": "path"}

INTRODUCTION = """\
# Rig files, camera profiles, import manifests

Three kinds of TOML file are written by hand. This page has every key of them. The models that read the files make it
(`python -m tests.support.write_rig_file > docs/rig-file.md`), and a test compares the two. An unknown key, a missing
one or a value out of range is an error that names the file and the key; in rig files and manifests it names the line.

A unit ends the name of every physical quantity. A key without a default must be given.
"""
RIG = """
## Rig file

One file describes a rig: `tomoshadow serve --config FILE`. Start from `configs/spray4view.toml`, the rig of the paper,
or from `configs/simulated.toml`, which needs no hardware.
"""
PROFILE = """
## Camera profile

One file describes a model of camera in double-frame operation: what it must be told, and when it then exposes. A rig
file names it as `camera.profile`. Start from the nearest one in `configs/cameras/`.
"""
MANIFEST = """
## Import manifest

`tomoshadow import MANIFEST.toml -o DIR` turns images from elsewhere into a run and a calibration set. Examples:
`tests/manifests/`, and [one with comments](file-formats.md#an-import-manifest). Names of cameras consist of letters,
digits, `_`, `.` and `-`.
"""


@dataclass(frozen=True)
class Table:
    """A table of a file: its place, its keys, and whether there may be several."""

    place: str
    schema: Schema
    repeats: bool = False

    @property
    def heading(self) -> str:
        """As TOML writes it."""
        return f"`[[{self.place}]]`" if self.repeats else f"`[{self.place}]`"


def rig_file_page() -> str:
    """The page."""
    rig = f"{RIG}{_tables(RigConfig)}{_fault_kinds()}"
    return f"{INTRODUCTION}{rig}{PROFILE}{_tables(CameraProfile)}{MANIFEST}{_tables(Manifest)}"


def _tables(model: type[BaseModel]) -> str:
    """All tables of a file; those of one kind are described once."""
    schema = model.model_json_schema()
    by_kind: dict[str, list[Table]] = {}
    for table in _all_tables(Table("", schema), schema["$defs"]):
        by_kind.setdefault(table.schema["title"], []).append(table)
    return "".join(_described(tables, schema["$defs"]) for tables in by_kind.values())


def _all_tables(table: Table, defs: Schema) -> Iterator[Table]:
    yield table
    for key, described in table.schema["properties"].items():
        for below in _below(f"{table.place}.{key}".lstrip("."), described, defs):
            yield from _all_tables(below, defs)


def _below(place: str, described: Schema, defs: Schema) -> Iterator[Table]:
    """The table that a key stands for, if it does."""
    plain = _without_null(described)
    repeats = "items" in plain
    if values := _values(plain):
        place, plain = f"{place}.NAME", values
    elif repeats:
        plain = plain["items"]
    target = _resolved(plain, defs)
    if "properties" in target:
        yield Table(place, target, repeats)


def _described(tables: list[Table], defs: Schema) -> str:
    schema, place = tables[0].schema, tables[0].place
    required = schema.get("required", ())
    rows = [
        f"| `{key}` | {_kind(described, defs)} | {_unit(key, described)} | {_default(key in required, described)} | "
        f"{_limits(_without_null(described))} | {_meaning(place, key, described, defs)} |"
        for key, described in schema["properties"].items()
    ]
    heading = ", ".join(table.heading for table in tables) if place else "At the top"
    about = f"{_sentence(schema['description'])}.\n\n" if place else ""
    head = "| key | type | unit | default | limits | meaning |\n|---|---|---|---|---|---|\n"
    return f"\n### {heading}\n\n{about}{head}" + "\n".join(rows) + "\n"


def _fault_kinds() -> str:
    """What the kinds of fault do, where the source says more than the name."""
    (kinds,) = ast.parse(inspect.getsource(FaultKind)).body
    assert isinstance(kinds, ast.ClassDef)
    lines = [
        f"* `{ast.literal_eval(assigned.value)}`: {_sentence(ast.literal_eval(said.value))}"
        for assigned, said in pairwise(kinds.body)
        if isinstance(assigned, ast.Assign) and isinstance(said, ast.Expr)
    ]
    return "\n" + "\n".join(lines) + "\n"


def _kind(described: Schema, defs: Schema) -> str:
    plain = _without_null(described)
    target = _resolved(plain, defs)
    if values := _values(plain):
        return f"table of {_plural(values, defs)} by name"
    if "enum" in target:
        return ", ".join(f"`{value}`" for value in target["enum"])
    if "prefixItems" in target:
        return f"{len(target['prefixItems'])} {_plural(target['prefixItems'][0], defs)}"
    if "items" in target:
        return f"list of {_plural(target['items'], defs)}"
    if "properties" in target:
        return "table"
    if "anyOf" in target:
        return "any of " + ", ".join(_kind(one, defs) for one in target["anyOf"] if one.get("type") != "null")
    return FORMATS.get(target.get("format", ""), NAMES[target["type"]])


def _plural(described: Schema, defs: Schema) -> str:
    target = _resolved(described, defs)
    if "enum" in target:
        return "words: " + _kind(described, defs)
    if "prefixItems" in target:
        return "pairs of " + _plural(target["prefixItems"][0], defs)
    if "anyOf" in target:
        return " or ".join(_plural(one, defs) for one in target["anyOf"])
    return "tables" if "properties" in target else {"string": "texts"}.get(target["type"], NAMES[target["type"]] + "s")


def _unit(key: str, described: Schema) -> str:
    for ending, unit in (("_px_per_mm", "px/mm"), ("_gbit_s", "Gbit/s")):
        if key.endswith(ending):
            return unit
    suffix = key.rpartition("_")[2]
    return UNITS[suffix] if suffix in UNITS and suffix != key and "string" not in str(described) else ""


def _default(required: bool, described: Schema) -> str:
    if required:
        return ""
    default = described.get("default")
    if default is None or default in ({}, [], ""):
        return "none"
    if isinstance(default, dict):
        return "as below"
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def _limits(plain: Schema) -> str:
    low, above, high = (plain.get(name) for name in ("minimum", "exclusiveMinimum", "maximum"))
    if low is not None and high is not None:
        return f"{low} to {high}"
    signed = (("≥", low), (">", above), ("≤", high))
    return ", ".join(f"{sign} {value}" for sign, value in signed if value is not None) or _size_limits(plain)


def _size_limits(plain: Schema) -> str:
    if "pattern" in plain and "maxLength" not in plain:
        return f"`{plain['pattern']}`"
    for what, unit in (("Length", " characters"), ("Items", ""), ("Properties", "")):
        low, high = plain.get(f"min{what}"), plain.get(f"max{what}")
        if low is not None and "prefixItems" not in plain:
            return f"{low} to {high}{unit}" if high else "not empty"
    return ""


def _meaning(place: str, key: str, described: Schema, defs: Schema) -> str:
    """What the key says of itself, or else what its type says.

    Raises
    ------
    ValueError
        Nobody says what the key means.
    """
    said = described.get("description") or _resolved(_without_null(described), defs).get("description")
    if not said:
        raise ValueError(f"{place}.{key}: has no description")
    return _sentence(said)


def _sentence(text: str) -> str:
    one_line = " ".join(text.split("\n\n", maxsplit=1)[0].split()).replace("``", "`").replace("|", "\\|")
    return one_line if one_line.endswith("...") else one_line.removesuffix(".")


def _without_null(described: Schema) -> Schema:
    """The schema of a key that may also be left out."""
    present = [one for one in described.get("anyOf", ()) if one.get("type") != "null"]
    return present[0] if len(present) == 1 else described


def _values(plain: Schema) -> Schema | None:
    """What the keys of a free table hold; None for a table with keys of its own."""
    if "patternProperties" in plain:
        (values,) = plain["patternProperties"].values()
        return dict(values)
    values = plain.get("additionalProperties")
    return values if isinstance(values, dict) else None


def _resolved(described: Schema, defs: Schema) -> Schema:
    reference = described.get("$ref")
    return defs[reference.rsplit("/", 1)[-1]] if reference else described


if __name__ == "__main__":
    sys.stdout.write(rig_file_page())
