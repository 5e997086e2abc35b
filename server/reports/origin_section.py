"""Where the numbers of a report come from: runs, calibration, recipe, programs, conditions."""

import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from processing.analysis.droplets.droplet_statistics import measured_grid
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.stored_json import stored_json
from processing.runs.sprays.measured_spray import MeasuredSpray
from server.reports.page import Section, Table

WITH_UNIT = {"pressure_bar": "pressure [bar]"}


def origin_of(spray: MeasuredSpray, axis: SprayAxis | None, sample: SpraySample | None) -> Section:
    """All that, of droplets in a sample."""
    settings = stored_json(spray.provenance, "settings")
    recipes = "; ".join(f"SHA-256 {one[:16]}..." for one in _stated(spray, "recipe_sha256")) or "not stated"
    sha256 = _stated(spray, "calibration_sha256")
    rows = [
        ["results", spray.name],
        ["runs", ", ".join(spray.runs)],
        ["calibration", f"{_said(spray, 'calibration')}, SHA-256 {' and '.join(one[:16] for one in sha256)}..."],
        ["recipe", f"{recipes}, method {_said(spray, 'method_version')}"],
        ["measured as", f"{settings.get('polarity', '')}, light {settings.get('light', 'not stated')}"],
        ["views", _views(spray)],
        ["from A to B [µs]", _separations(spray)],
        ["box [mm]", _box(sample)],
        ["voxel [µm]", _voxel(spray)],
        ["nozzle and axis", _axis(axis)],
        ["programs", f"measured by tomoshadow {_said(spray, 'tomoshadow')}, reported by {version('tomoshadow')}"],
        *notes_of(spray),
    ]
    table = Table(["", ""], [row for row in rows if row[1]], words=True)
    return Section("Where the numbers come from", tables=[table])


def notes_of(spray: MeasuredSpray) -> list[list[str]]:
    """What the operator has written down, of all runs."""
    values: dict[str, dict[str, None]] = {}
    for notes in map(json.loads, _stated(spray, "notes")):
        more = notes.pop("more", {})
        for name, value in {**notes, **more}.items():
            values.setdefault(name, {})[str(value)] = None
    return [[WITH_UNIT.get(name, name.replace("_", " ")), " and ".join(said)] for name, said in values.items()]


def _stated(spray: MeasuredSpray, name: str) -> list[str]:
    """What the shots say of themselves, each once."""
    said = (shot.provenance.get(name) for shot in spray.shots)
    return list(dict.fromkeys(str(one) for one in said if one is not None))


def _said(spray: MeasuredSpray, name: str) -> str:
    return " and ".join(_stated(spray, name))


def _views(spray: MeasuredSpray) -> str:
    exposures = [one for shot in spray.shots for one in shot.exposures.values()]
    return ", ".join(dict.fromkeys(name for exposure in exposures for name in exposure.get("views", {})))


def _separations(spray: MeasuredSpray) -> str:
    """Once where all shots have the same."""
    told: list[Mapping[str, Any]] = [json.loads(one) or {} for one in _stated(spray, "velocity")]
    known = [one for one in told if "separation_ns" in one]
    return " and ".join(
        dict.fromkeys(f"{one['separation_ns'] / 1000:.5g}, as {one['separation_source']}" for one in known)
    )


def _voxel(spray: MeasuredSpray) -> str:
    grids = (measured_grid(shot) for shot in spray.shots)
    return " and ".join(dict.fromkeys(f"{1000 * grid.pitch_mm:.4g}" for grid in grids if grid))


def _box(sample: SpraySample | None) -> str:
    if sample is None or sample.box_mm is None:
        return ""
    low_mm, high_mm = sample.box_mm
    return ", ".join(f"{axis} {a:.4g} to {b:.4g}" for axis, a, b in zip("xyz", low_mm, high_mm, strict=True))


def _axis(axis: SprayAxis | None) -> str:
    if axis is None:
        return "not known"
    nozzle, direction = (", ".join(f"{value:.4g}" for value in triple) for triple in (axis.nozzle_mm, axis.direction))
    return f"nozzle at ({nozzle}) mm, axis along ({direction})"
