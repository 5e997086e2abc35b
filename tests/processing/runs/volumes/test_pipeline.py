"""From a recorded shot to its volumes: each droplet peaks where it was, or one clear error says why not."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from daq.files.references_file import add_references
from daq.files.run_directory import RunReader
from processing.calibration.calibration_file import load_calibration
from processing.calibration.errors import CalibrationError
from processing.calibration.verdict import Verdict
from processing.reconstruction.choices import ReconstructionMethod, VoxelType
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.reconstruction.planning.planned_view import PlannedView
from processing.reconstruction.planning.rectified_view import RESAMPLING_PX
from processing.reconstruction.reconstructor import Reconstructor
from processing.reconstruction.settings import GridSettings, ReconstructionSettings
from processing.reconstruction.volume_file import VolumeFileError, open_volume, read_volume
from processing.runs.errors import PipelineError, Stopped
from processing.runs.results_file import claim_results, volume_files, volume_path
from processing.runs.shots.shot_images import shot_intensities
from processing.runs.shots.shot_light import fainter, light_line, stored_settings, stored_shares
from processing.runs.shots.shot_result import ShotResult
from processing.runs.stored_exposures import stored_exposures
from processing.runs.volumes.pipeline import reconstruct_shot, reconstruct_shots
from processing.runs.volumes.stored_average import average_volumes
from processing.runs.workbench import Workbench
from processing.volume import VoxelGrid
from tests.support.droplet_run import (
    DROPLETS_A_MM,
    MOTION_MM,
    SHAPE,
    add_background,
    cameras,
    write_calibration,
    write_run,
)

GRID = VoxelGrid.centred((61, 81, 81), 0.05)
SETTINGS = ReconstructionSettings(grid=GridSettings.of(GRID), minimum_window_px=0)


@pytest.fixture
def run_dir(tmp_path: Path) -> Path:
    return write_run(tmp_path / "run", shots=2, invalid=(1,))


@pytest.fixture
def calibration_file(tmp_path: Path) -> Path:
    return write_calibration(tmp_path / "calibration.json")


def reconstructed(run_dir: Path, calibration_file: Path, settings: ReconstructionSettings = SETTINGS) -> ShotResult:
    return reconstruct_shot(run_dir, 0, calibration_file, settings, run_dir / "results")


@pytest.mark.parametrize("voxels", list(VoxelType))
@pytest.mark.parametrize("method", list(ReconstructionMethod))
def test_droplets_peak_where_they_were(
    run_dir: Path, calibration_file: Path, method: ReconstructionMethod, voxels: VoxelType
) -> None:
    settings = SETTINGS.model_copy(update={"method": method, "iterations": 3, "voxels": voxels})
    reconstructed(run_dir, calibration_file, settings)
    for frame, moved_mm in (("a", 0 * MOTION_MM), ("b", MOTION_MM)):
        volume, grid, _ = read_volume(run_dir / "results" / f"shot_00000_{frame}.vtkhdf")
        for expected in np.rint(grid.to_index(DROPLETS_A_MM + moved_mm)).astype(int):
            around = tuple(slice(index - 6, index + 7) for index in expected)
            peak = np.array(np.unravel_index(volume[around].argmax(), (13, 13, 13))) - 6
            assert np.abs(peak).max() <= 1, (frame, expected, peak)


def test_smart_records_how_it_converged_and_stops_when_told(run_dir: Path, calibration_file: Path) -> None:
    settings = SETTINGS.model_copy(update={"method": ReconstructionMethod.SMART, "iterations": 30, "least_gain": 0.2})
    for volume in reconstructed(run_dir, calibration_file, settings).volumes:
        gains = 1 - np.divide(volume.residuals[1:], volume.residuals[:-1])
        assert 1 <= len(gains) < 30
        assert (gains[:-1] >= 0.2).all()
        assert gains[-1] < 0.2
        _, _, provenance = read_volume(run_dir / "results" / volume.file)
        assert json.loads(str(provenance["residuals"])) == list(volume.residuals)


def test_result_and_volumes_name_their_origin(run_dir: Path, calibration_file: Path) -> None:
    result = reconstructed(run_dir, calibration_file)
    assert [(volume.shot, volume.frame, volume.file) for volume in result.volumes] == [
        (0, "a", "shot_00000_a.vtkhdf"),
        (0, "b", "shot_00000_b.vtkhdf"),
    ]
    assert result.grid.to_grid() == GRID
    _, _, provenance = read_volume(volume_path(run_dir / "results", 0, "b"))
    assert provenance["run"] == "run"
    assert provenance["calibration"] == load_calibration(calibration_file).id
    assert ReconstructionSettings.model_validate_json(str(provenance["settings"])) == SETTINGS
    assert (provenance["shot"], provenance["frame"]) == (0, "b")
    views = {name: PlannedView.model_validate(view) for name, view in json.loads(str(provenance["views"])).items()}
    assert views == dict(result.views)
    assert list(views) == ["view1", "view2", "view3"]
    assert {(view.mapping, view.reason) for view in views.values()} == {("rectified", None)}
    assert all(RESAMPLING_PX <= view.deviation_px < RESAMPLING_PX + 0.02 for view in views.values())


def test_references_that_are_written_later_count(run_dir: Path) -> None:
    with RunReader(run_dir) as run:
        shot, views = run.read_shot(0), run.header.views
        without = shot_intensities(run, shot, "a", SETTINGS)
        levels = {"dark": 0.0, "background": 400.0}
        images = {name: dict.fromkeys(views, np.full((2, *SHAPE), level, np.float32)) for name, level in levels.items()}
        add_references(run_dir, run.header, {"dark": images["dark"], "background": images["background"]})
        half_lit = shot_intensities(run, shot, "a", SETTINGS)
    for before, after in zip(without, half_lit, strict=True):
        assert np.median(before) == pytest.approx(0, abs=1e-6)
        assert np.median(after) == pytest.approx((0.5 - 0.05) / 0.95, abs=1e-6)


def test_the_default_grid_is_the_calibrated_range_in_pixels(run_dir: Path, calibration_file: Path) -> None:
    result = reconstructed(run_dir, calibration_file, ReconstructionSettings(minimum_window_px=0))
    grid = result.grid.to_grid()
    assert grid.pitch_mm == pytest.approx(1 / 20, rel=0.05)
    assert grid.z_mm[[0, -1]] == pytest.approx([-1.5, 1.5], abs=0.05)
    assert np.ptp(grid.x_mm) > 4


SIDE_BY_SIDE = [ReconstructionMethod.MLOS, ReconstructionMethod.SMART]


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("method", SIDE_BY_SIDE)
def test_shots_side_by_side_are_those_one_after_the_other(
    calibration_file: Path, tmp_path: Path, method: ReconstructionMethod, shared: bool
) -> None:
    settings = SETTINGS.model_copy(update={"method": method, "iterations": 2})
    runs = [write_run(tmp_path / f"run{n}", covered=("view2",) * (n % 2)) for n in range(2)]

    def volumes_of(number: int, place: str, options: dict[str, Any]) -> list[NDArray[np.float32]]:
        out = tmp_path / f"{place}{number}"
        result = reconstruct_shot(runs[number % 2], 0, calibration_file, settings, out, **options)
        return [read_volume(out / volume.file)[0] for volume in result.volumes]

    expected = [volumes_of(number, "alone", {}) for number in range(2)]
    assert all(volume.any() for volume in expected[0])
    options = {"workbench": Workbench()} if shared else {}
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda number: volumes_of(number, "beside", options), range(12)))
    for number, volumes in enumerate(found):
        np.testing.assert_array_equal(volumes, expected[number % 2])


def test_a_workbench_keeps_what_is_asked_for_again_and_no_more(
    run_dir: Path, calibration_file: Path, tmp_path: Path
) -> None:
    workbench = Workbench()
    made: list[tuple[Reconstructor, ...]] = []

    def make() -> tuple[Reconstructor, ...]:
        made.append((Reconstructor.of(plan_reconstruction(list(cameras().values()), GRID), SETTINGS),))
        return made[-1]

    assert workbench.reconstructors("one", make) is workbench.reconstructors("one", make) is made[0]
    assert workbench.reconstructors("other", make) is workbench.reconstructors("other", make) is made[1]
    assert workbench.reconstructors("one", make) is made[2]
    settings = [SETTINGS, SETTINGS.model_copy(update={"noise_floor": 0.2}), SETTINGS]
    for number, one in enumerate(settings):
        out = tmp_path / f"kept{number}"
        reconstruct_shot(run_dir, 0, calibration_file, one, out, workbench=workbench)
        reconstruct_shot(run_dir, 0, calibration_file, one, tmp_path / f"fresh{number}")
        for file in volume_files(out):
            np.testing.assert_array_equal(read_volume(file)[0], read_volume(tmp_path / f"fresh{number}" / file.name)[0])


def test_shots_of_a_series_are_those_that_come_alone_until_one_is_not_valid(
    calibration_file: Path, tmp_path: Path
) -> None:
    run_dir = write_run(tmp_path / "run", shots=4, invalid=(2,))
    coming = reconstruct_shots(run_dir, [1, 0, 2, 3], calibration_file, SETTINGS, tmp_path / "series")
    assert [next(coming).shot, next(coming).shot] == [1, 0]
    with pytest.raises(PipelineError, match="shot 2: exposures are missing"):
        next(coming)
    made = {int(file.stem.split("_")[1]) for file in volume_files(tmp_path / "series")}
    assert made - {3} == {0, 1}  # the last one may have been made beside the one that is not valid
    for shot in made:
        reconstruct_shot(run_dir, shot, calibration_file, SETTINGS, tmp_path / "alone")
    for file in volume_files(tmp_path / "series"):
        np.testing.assert_array_equal(read_volume(file)[0], read_volume(tmp_path / "alone" / file.name)[0])


def test_what_is_wrong_with_the_light_is_told_with_the_volume(calibration_file: Path, tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "run", covered=("view2",))
    result = reconstructed(run_dir, calibration_file)
    for volume in result.volumes:
        assert volume.dim_views == volume.blind_views == ("view2",)
        assert volume.empty
        _, _, provenance = read_volume(run_dir / "results" / volume.file)
        assert json.loads(str(provenance["dim_views"])) == ["view2"]
    fine = reconstructed(write_run(tmp_path / "fine"), calibration_file)
    assert [(volume.dim_views, volume.empty) for volume in fine.volumes] == 2 * [((), False)]


@pytest.mark.parametrize("method", ["mlos", "minlos"])
def test_the_light_of_a_shot_is_kept_with_its_volume_and_told_where_values_are_compared(
    method: str, calibration_file: Path, tmp_path: Path
) -> None:
    settings = SETTINGS.model_copy(update={"method": ReconstructionMethod(method), "minimum_window_px": 201})
    bright, dim = (
        reconstructed(add_background(write_run(tmp_path / str(counts)), counts), calibration_file, settings)
        for counts in (200, 250)
    )
    assert [dict(one) for one in dim.light.values()] == 2 * [dict.fromkeys(cameras(), 0.8)]
    assert [dict(one) for one in bright.light.values()] == 2 * [dict.fromkeys(cameras(), 1.0)]
    exposures = stored_exposures(volume_files(tmp_path / "250" / "results"))
    assert (stored_shares(exposures), stored_settings(exposures[0])) == (dim.light, settings)
    seen = [tmp_path / counts / "results" / "shot_00000_a.vtkhdf" for counts in ("200", "250")]
    brightest = [float(read_volume(file)[0].max()) for file in seen]
    assert fainter(dim.light[0, "a"], settings) == pytest.approx(1 - brightest[1] / brightest[0], abs=0.04)
    assert light_line(bright.light, settings) == ""
    assert light_line(dim.light, settings).startswith("light: 2 of 2 exposures had less or more than their backgrounds")
    assert light_line(dim.light, settings.model_copy(update={"minimum_window_px": 0})) == ""


@pytest.mark.parametrize("window_px", [0, 201])
def test_light_in_excess_of_the_background_is_told(window_px: int, calibration_file: Path, tmp_path: Path) -> None:
    """What is brighter than the background counts as nothing, so that pale shadows are paler."""
    settings = SETTINGS.model_copy(update={"minimum_window_px": window_px})
    values = []
    for counts in (200, 188):
        shot = reconstructed(add_background(write_run(tmp_path / str(counts)), counts), calibration_file, settings)
        values.append(read_volume(tmp_path / str(counts) / "results" / shot.volumes[0].file)[0])
    half_dark = np.argmin(np.abs(values[0] - 0.5**4))
    assert values[1].ravel()[half_dark] < 0.9 * values[0].ravel()[half_dark]
    told = light_line(shot.light, settings)
    assert told.startswith("light: 2 of 2 exposures had less or more than their backgrounds: voxels of half-dark")
    assert "106 %" in told


@pytest.mark.parametrize("window_px", [0, 201])
def test_a_view_in_excess_light_is_one_of_all_views_whatever_the_window(window_px: int) -> None:
    settings = SETTINGS.model_copy(update={"method": ReconstructionMethod.GAVLOS, "minimum_window_px": window_px})
    assert fainter({"view1": 1.2, "view2": 1.0, "view3": 1.0, "view4": 1.0}, settings) == pytest.approx(1 - 0.8**0.25)


def test_twelve_bits_in_words_of_sixteen_are_told(calibration_file: Path, tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "run", bits=16)
    assert {volume.dim_views for volume in reconstructed(run_dir, calibration_file).volumes} == {tuple(cameras())}


def test_shadows_that_are_said_to_be_bright_are_told_with_the_volume(calibration_file: Path, tmp_path: Path) -> None:
    run_dir = write_run(tmp_path / "run", polarity="bright")
    volume = reconstructed(run_dir, calibration_file).volumes[0]
    assert set(volume.odd_light) == set(cameras())
    _, _, provenance = read_volume(run_dir / "results" / volume.file)
    assert json.loads(str(provenance["odd_light"])) == volume.odd_light
    assert reconstructed(write_run(tmp_path / "fine"), calibration_file).volumes[0].odd_light == {}


def test_an_exposure_counts_once_in_a_mean(run_dir: Path, calibration_file: Path) -> None:
    reconstructed(run_dir, calibration_file)
    file = volume_path(run_dir / "results", 0, "a")
    copy = volume_path(run_dir / "results", 7, "a")
    copy.write_bytes(file.read_bytes())
    with pytest.raises(VolumeFileError, match=r"shot_00007_a.vtkhdf: the same exposure as shot_00000_a"):
        average_volumes([file, copy])


def test_a_shot_with_missing_exposures_is_refused(run_dir: Path, calibration_file: Path) -> None:
    with pytest.raises(PipelineError, match="run, shot 1: exposures are missing"):
        reconstruct_shot(run_dir, 1, calibration_file, SETTINGS, run_dir / "results")
    assert not (run_dir / "results").exists()


def test_a_refused_calibration_makes_no_volumes(run_dir: Path, tmp_path: Path) -> None:
    bad = write_calibration(tmp_path / "bad.json", Verdict.REFUSE, holdout_px=1.7)
    with pytest.raises(CalibrationError, match=r"view1 is refused: hold-out error 1\.7 px"):
        reconstructed(run_dir, bad)


def test_results_are_claimed_by_many_at_once(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        for number in range(20):
            claims = [pool.submit(claim_results, tmp_path / str(number), {"run": "run"}) for _ in range(8)]
            assert [claim.result() for claim in claims] == [None] * 8
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("left", [b"", b'{"run": "run", "cal', b"\xff\xfe\x00"])
def test_torn_settings_of_results_are_called_damaged(run_dir: Path, calibration_file: Path, left: bytes) -> None:
    reconstructed(run_dir, calibration_file)
    (file,) = run_dir.rglob("settings.json")
    file.write_bytes(left)
    with pytest.raises(VolumeFileError, match=r"settings\.json: damaged .*--overwrite"):
        reconstructed(run_dir, calibration_file)
    assert file.read_bytes() == left


def test_results_of_other_settings_are_not_mixed(run_dir: Path, calibration_file: Path) -> None:
    reconstructed(run_dir, calibration_file)
    with pytest.raises(VolumeFileError, match="results of another run, calibration or settings"):
        reconstructed(run_dir, calibration_file, SETTINGS.model_copy(update={"noise_floor": 0.2}))


def test_a_stop_is_honoured_between_exposures(run_dir: Path, calibration_file: Path) -> None:
    answers = iter([False, True])
    with pytest.raises(Stopped, match="before exposure b"):
        reconstruct_shot(run_dir, 0, calibration_file, SETTINGS, run_dir / "results", lambda: next(answers))
    assert [file.name for file in volume_files(run_dir / "results")] == ["shot_00000_a.vtkhdf"]


def test_results_id_tells_settings_and_calibrations_apart() -> None:
    other = SETTINGS.model_copy(update={"noise_floor": 0.2})
    assert len({SETTINGS.results_id("monday"), SETTINGS.results_id("tuesday"), other.results_id("monday")}) == 3
    assert SETTINGS.results_id("monday") == SETTINGS.model_copy().results_id("monday")
    assert SETTINGS.results_id("monday").startswith("mlos-")


@pytest.mark.parametrize("voxels", list(VoxelType))
def test_the_average_is_the_mean(run_dir: Path, calibration_file: Path, voxels: VoxelType) -> None:
    reconstructed(run_dir, calibration_file, SETTINGS.model_copy(update={"voxels": voxels}))
    files = volume_files(run_dir / "results")
    averaged = average_volumes(files)
    assert (averaged.grid, averaged.copies) == (GRID, {})
    assert [one.key for one in averaged.exposures] == [(0, "a"), (0, "b")]
    np.testing.assert_allclose(averaged.mean, (read_volume(files[0])[0] + read_volume(files[1])[0]) / 2, atol=1e-7)


@pytest.mark.parametrize(("value", "said"), [(np.nan, "infinite, or not a number"), (-1, "negative")])
def test_a_volume_that_was_changed_has_no_average(
    run_dir: Path, calibration_file: Path, value: float, said: str
) -> None:
    reconstructed(run_dir, calibration_file)
    first = volume_files(run_dir / "results")[0]
    with h5py.File(first, "r+") as file:
        file["VTKHDF/PointData/intensity"][0, 0, 0] = value
    with pytest.raises(VolumeFileError, match=f"{first.name}: was changed: a voxel is {said}"):
        average_volumes([first])


def test_a_volume_of_the_other_exposure_under_a_name_of_this_one_has_no_average(
    run_dir: Path, calibration_file: Path
) -> None:
    reconstructed(run_dir, calibration_file)
    renamed = volume_path(run_dir / "results", 0, "b").rename(volume_path(run_dir / "results", 1, "a"))
    with pytest.raises(VolumeFileError, match=f"{renamed.name}: was renamed, and is shot_00000_b.vtkhdf"):
        average_volumes(volume_files(run_dir / "results", "a"))


def test_volumes_of_all_types_agree_and_name_theirs(run_dir: Path, calibration_file: Path) -> None:
    volumes = {}
    for voxels in VoxelType:
        settings = SETTINGS.model_copy(update={"voxels": voxels})
        reconstruct_shot(run_dir, 0, calibration_file, settings, run_dir / voxels)
        with open_volume(volume_path(run_dir / voxels, 0, "a")) as stored:
            assert stored.voxels.attrs["voxels"] == voxels
            assert ReconstructionSettings.model_validate_json(str(stored.provenance["settings"])) == settings
            volumes[voxels] = stored[:]
    single = volumes[VoxelType.FLOAT32]
    assert single.max() > 0.5
    np.testing.assert_allclose(volumes[VoxelType.FLOAT16], single, rtol=2.0**-11, atol=2.0**-25)
    np.testing.assert_allclose(volumes[VoxelType.UINT8], single, atol=0.51 / 255)


def test_volumes_on_different_grids_have_no_average(run_dir: Path, calibration_file: Path) -> None:
    reconstructed(run_dir, calibration_file)
    smaller = SETTINGS.model_copy(update={"grid": GridSettings.of(VoxelGrid.centred((11, 11, 11), 0.05))})
    reconstruct_shot(run_dir, 0, calibration_file, smaller, run_dir / "smaller")
    with pytest.raises(VolumeFileError, match="differs from"):
        average_volumes([volume_path(run_dir / "results", 0, "a"), volume_path(run_dir / "smaller", 0, "a")])
    with pytest.raises(VolumeFileError, match="no volumes"):
        average_volumes([])


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"method": ReconstructionMethod.MINLOS}, "method minlos instead of mlos of shot_00000_a.vtkhdf"),
        (
            {"noise_floor": 0.1, "minimum_window_px": 9},
            "minimum_window_px 9 instead of 0, noise_floor 0.1 instead of 0.05",
        ),
    ],
)
def test_volumes_of_different_settings_have_no_average(
    run_dir: Path, calibration_file: Path, change: dict[str, object], complaint: str
) -> None:
    reconstructed(run_dir, calibration_file)
    reconstruct_shot(run_dir, 0, calibration_file, SETTINGS.model_copy(update=change), run_dir / "others")
    other = volume_path(run_dir / "others", 0, "b").replace(volume_path(run_dir / "results", 1, "b"))
    with pytest.raises(VolumeFileError, match=f"{other}: {complaint}"):
        average_volumes(volume_files(run_dir / "results"))


@pytest.mark.parametrize(
    ("name", "told", "complaint"),
    [
        ("tuesday", {}, "run tuesday instead of run of"),
        ("run", {"created_utc": "2026-01-02T00:00:00+00:00"}, "run_created_utc 2026-01-02T00:00:00.* instead of 2026-"),
    ],
)
def test_volumes_of_two_runs_in_one_folder_have_no_average(
    run_dir: Path, calibration_file: Path, tmp_path: Path, name: str, told: dict[str, Any], complaint: str
) -> None:
    reconstructed(run_dir, calibration_file)
    other = write_run(tmp_path / "second" / name, shots=4, **told)
    reconstruct_shot(other, 3, calibration_file, SETTINGS, tmp_path / "others")
    volume_path(tmp_path / "others", 3, "a").replace(volume_path(run_dir / "results", 3, "a"))
    with pytest.raises(VolumeFileError, match=f"shot_00003_a.vtkhdf: {complaint}"):
        average_volumes(volume_files(run_dir / "results", "a"))


def test_volumes_of_different_calibrations_have_no_average(run_dir: Path, tmp_path: Path) -> None:
    calibrations = [write_calibration(tmp_path / f"{px}.json", holdout_px=px) for px in (0.02, 0.03)]
    for file, folder in zip(calibrations, ("results", "others"), strict=True):
        reconstruct_shot(run_dir, 0, file, SETTINGS, run_dir / folder)
    ids = [load_calibration(file).id for file in calibrations]
    files = [volume_path(run_dir / folder, 0, "a") for folder in ("results", "others")]
    with pytest.raises(
        VolumeFileError, match=f"others/shot_00000_a.vtkhdf: calibration {ids[1]} instead of {ids[0]} of"
    ):
        average_volumes(files)


def test_default_grid_takes_a_stated_pitch(calibration_file: Path) -> None:
    assert default_grid(load_calibration(calibration_file), pitch_mm=0.1).pitch_mm == 0.1
