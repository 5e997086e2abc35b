"""Shots with few droplets vote together on the light of their run."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from daq.files.run_directory import RunReader
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.droplets.ghost_share import matches
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.reconstruction.settings import GridSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from processing.runs.droplets.measured_shot import MeasuredShot
from processing.runs.droplets.measurement import RunMeasurement
from tests.support.shadow_scenes import ShadowScene, shadow_scene, write_shadow_calibration, write_shadow_run


def few(seed: int, density_per_mm3: float = 70, *, sharp: bool) -> ShadowScene:
    """Eight droplets behind a lens that is sharp, in light from all directions, or behind a Gaussian blur."""
    blurs_px = (0.9,) * 4
    return shadow_scene(
        (30, 14, 60), density_per_mm3, (130, 70), seed=seed, sharp=sharp, blurs_px=blurs_px, median_mm=0.05
    )


def measured(folder: Path, scenes: Sequence[ShadowScene], shots: Sequence[int]) -> list[MeasuredShot]:
    run_dir = write_shadow_run(folder / "run", *scenes)
    calibration_file = write_shadow_calibration(folder / "calibration.json", scenes[0])
    settings = MeasureSettings(polarity="shadow", grid=GridSettings.of(scenes[0].grid), margin_voxel=8)
    with RunReader(run_dir) as run:
        measurement = RunMeasurement.of(run, 0, calibration_file, settings)
        return [measurement.measure(shot, folder / "droplets", 1) for shot in shots]


def off_um(shot: MeasuredShot, scene: ShadowScene) -> tuple[float, float]:
    """By how much diameters are too large, in the mean, and the standard deviation that is told of one."""
    droplets = shot.exposures[0].droplets
    assert isinstance(droplets, SizedDroplets)
    match, _ = matches(droplets.points_mm, scene.points_mm, scene.grid.pitch_mm)
    assert np.all(match >= 0)
    off = np.mean(droplets.diameters_um - 1000 * scene.diameters_mm[match])
    return float(off), float(np.median(droplets.diameter_sd_um))


@pytest.mark.parametrize("sharp", [True, False])
def test_shots_with_few_droplets_vote_together_on_the_light(tmp_path: Path, sharp: bool) -> None:
    """Behind the sharp lens they do not tell 1.3 apertures from all directions, and say so."""
    scenes = [few(seed, sharp=sharp) for seed in (1, 2)]
    shots = measured(tmp_path, scenes, (0, 1))
    assert [shot.summary.verdict for shot in shots] == [ShotVerdict.GOOD] * 2
    for shot, scene in zip(shots, scenes, strict=True):
        assert 0 < shot.summary.droplets < 10
        off, told_sd = off_um(shot, scene)
        assert abs(off) < 1.5 * told_sd < (9 if sharp else 1)
        assert all(("condenser_ratio=None" in str(view)) is not sharp for view in shot.exposures[0].views.values())


def test_a_run_with_too_few_droplets_in_all_of_its_shots_does_not_tell(tmp_path: Path) -> None:
    (shot,) = measured(tmp_path, [few(seed, 15, sharp=True) for seed in (1, 2)], [0])
    assert shot.summary.verdict is ShotVerdict.DOUBTFUL
    assert "fewer than 10 do not vote" in shot.summary.reasons[-1]


def test_a_damaged_shot_has_no_vote_and_harms_no_other(tmp_path: Path) -> None:
    scenes = [few(seed, sharp=False) for seed in (1, 2, 3)]
    run_dir = write_shadow_run(tmp_path / "run", *scenes)
    first = min((run_dir / "shots").iterdir())
    written = first.read_bytes()
    first.write_bytes(written[: len(written) // 2] + bytes(200) + written[len(written) // 2 + 200 :])
    calibration_file = write_shadow_calibration(tmp_path / "calibration.json", scenes[0])
    settings = MeasureSettings(polarity="shadow", grid=GridSettings.of(scenes[0].grid), margin_voxel=8)
    with RunReader(run_dir) as run:
        shot = RunMeasurement.of(run, 2, calibration_file, settings).measure(2, tmp_path / "droplets", 1)
    assert shot.summary.verdict is ShotVerdict.GOOD


def test_a_shot_in_another_light_than_the_first_ones_is_doubted(tmp_path: Path) -> None:
    """Its few droplets do not vote, but they contradict what those of the first shots say."""
    scenes = [*(few(seed, sharp=False) for seed in (1, 2, 3, 4)), few(5, sharp=True)]
    alike, other = measured(tmp_path, scenes, (3, 4))
    assert 0 < other.summary.droplets < 10
    assert (alike.summary.verdict, other.summary.verdict) == (ShotVerdict.GOOD, ShotVerdict.DOUBTFUL)
    assert "first shots" in other.summary.reasons[-1]


def test_a_shot_that_can_show_no_shadows_has_no_vote(tmp_path: Path) -> None:
    """It has more than twice the light of its background."""
    scenes = [few(seed, sharp=False) for seed in (1, 2, 3)]
    bright = replace(scenes[0], images=[2.5 * image for image in scenes[0].images])
    shots = measured(tmp_path, [bright, *scenes[1:]], (0, 1))
    assert [shot.summary.verdict for shot in shots] == [ShotVerdict.REFUSED, ShotVerdict.GOOD]
