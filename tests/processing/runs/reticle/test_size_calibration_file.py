"""Files of sizes that were edited, or whose reticle failed, are refused in a sentence."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from processing.analysis.reticle.size_groups import ReticleError
from processing.runs.reticle.size_calibration import load_size_calibration

Edit = Callable[[dict[str, Any]], object]


def written(path: Path, edit: Edit = lambda _: None) -> Path:
    sizes = [
        {"true_um": true_um, "found_um": true_um + 1.0, "sd_um": 0.1, "dots": 5, "views_um": {"view1": true_um + 1.0}}
        for true_um in (30.0, 60.0)
    ]
    said: dict[str, Any] = {
        "schema": "tomoshadow/sizes",
        "schema_version": 1,
        "run": "reticle",
        "calibration": "cal-1",
        "tomoshadow": "0.1.0",
        "light": 0.8,
        "light_share": 1.0,
        "blurs_px": {"view1": 0.7},
        "residual": 0.005,
        "middle_mm": [0, 0, 0],
        "normal": [0, 0, 1],
        "tolerance_um": 1.0,
        "sizes": sizes,
    }
    edit(said)
    path.write_text(json.dumps(said))
    return path


def test_what_was_written_is_read(tmp_path: Path) -> None:
    assert [row[:2] for row in load_size_calibration(written(tmp_path / "sizes.json")).rows] == [(31, 30), (61, 60)]


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (lambda said: said["sizes"][0].update(found_um=70), "sizes must grow"),
        (lambda said: said["sizes"][0].update(found_um=float("nan")), "above 0, and finite"),
        (lambda said: said["sizes"][0].update(true_um=-30), "above 0, and finite"),
        (lambda said: said["sizes"][0].update(sd_um=-1), r"sizes\.0\.sd_um"),
        (lambda said: said.update(sizes=[]), "sizes: .* at least 1"),
        (lambda said: said.update(tolerance_um=-1), "tolerance_um"),
        (lambda said: said.update(light="estimated"), "found in one light"),
        (lambda said: said.update(schema_version=2), "schema_version"),
        (lambda said: said.update(residual=0.2), "failed: 20.0 % of the light is left around the dots"),
        (lambda said: said.update(residual=float("nan")), "failed: nan % of the light"),
        (lambda said: said.update(light="gaussian", light_share=0.5), "failed: which light this is cannot be told"),
    ],
)
def test_what_no_reticle_says_is_refused(edit: Edit, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(ReticleError, match=rf"^.*/sizes\.json: .*{complaint}"):
        load_size_calibration(written(tmp_path / "sizes.json", edit))
