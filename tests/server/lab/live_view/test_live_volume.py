from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from daq.files.run_directory import ViewFormat
from daq.run.state import RunState
from daq.run_plan import ImageKey
from daq.shot import Shot
from processing.reconstruction.settings import ReconstructionSettings
from processing.volume import VoxelGrid
from server.lab.calibrations import CalibrationStore
from server.lab.errors import NotFound
from server.lab.live_view.live_volume import LiveVolume, half_of
from tests.support.drifting_views import SIZE_PX
from tests.support.live_shots import VIEWS, droplet_shot, save_droplet_calibration
from tests.support.memory_rig import MemoryRig

PLACE_MM = (0.8, -0.6, 0.4)


@dataclass
class Bench:
    """A live volume and what it asks."""

    store: CalibrationStore
    shot: Shot | None = field(default_factory=lambda: droplet_shot(PLACE_MM))
    state: RunState = RunState.LIVE

    def __post_init__(self) -> None:
        cameras = MemoryRig(dict.fromkeys(VIEWS, ViewFormat(SIZE_PX[::-1], 8))).cameras
        self.volume = LiveVolume(
            cameras, self.store, lambda: self.shot, lambda: self.state, ReconstructionSettings(minimum_window_px=41)
        )


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    store = CalibrationStore(tmp_path / "calibrations")
    save_droplet_calibration(store.path("paper"))
    store.choose("paper")
    return Bench(store)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_droplet_is_where_it_is(bench: Bench, axis: str) -> None:
    view = bench.volume.look()
    assert (view.number, view.shot, view.calibration, view.problem) == (1, 0, "paper", None)
    assert view.shape is not None
    assert view.origin_mm is not None
    assert view.pitch_mm is not None
    number = "xyz".index(axis)
    index = round((PLACE_MM[number] - view.origin_mm[number]) / view.pitch_mm)
    picture = cv2.imdecode(np.frombuffer(bench.volume.slice_png(axis, index), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    right, down = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}[axis]
    rows, columns = np.nonzero(picture > 0.5 * picture.max())
    found_mm = [
        view.origin_mm[of] + view.pitch_mm * float(np.mean(places)) for of, places in ((right, columns), (down, rows))
    ]
    np.testing.assert_allclose(found_mm, [PLACE_MM[right], PLACE_MM[down]], atol=0.06)


def test_the_surface_of_the_droplet_is_there_too(bench: Bench) -> None:
    bench.volume.look()
    preview = bench.volume.preview()
    z, y, x = np.unravel_index(int(preview.voxels.argmax()), preview.voxels.shape)
    found_mm = preview.grid.to_mm(np.array([[z, y, x]], np.float64))[0]
    np.testing.assert_allclose(found_mm, PLACE_MM, atol=0.15)


def test_a_shot_is_seen_once_and_the_next_one_anew(bench: Bench) -> None:
    assert [bench.volume.look().number for _ in range(2)] == [1, 1]
    bench.shot = droplet_shot(PLACE_MM, index=7)
    view = bench.volume.look()
    assert (view.number, view.shot) == (2, 7)


@pytest.mark.parametrize("state", [state for state in RunState if state is not RunState.LIVE])
def test_nothing_is_made_but_in_a_live_view(bench: Bench, state: RunState) -> None:
    bench.state = state
    view = bench.volume.look()
    assert (view.number, view.remedy) == (0, "press Live")


def test_the_last_one_stays_with_its_age_when_the_live_view_ends(bench: Bench) -> None:
    bench.volume.look()
    bench.state, bench.shot = RunState.ACQUIRING, droplet_shot(PLACE_MM, index=1)
    view = bench.volume.look()
    assert (view.number, view.shot, view.problem) == (1, 0, "volumes are made while the rig is shown live")
    assert view.age_s is not None


def test_without_a_calibration_it_says_what_to_do(tmp_path: Path) -> None:
    bench = Bench(CalibrationStore(tmp_path / "none"))
    view = bench.volume.look()
    assert view.problem is not None
    assert "there is no calibration" in view.problem
    assert view.remedy == "calibrate, or choose a calibration, on the page Calibrate"
    with pytest.raises(NotFound, match="no live volume yet"):
        bench.volume.slice_png("z", 0)


def test_what_does_not_fit_the_calibration_is_told(bench: Bench) -> None:
    assert bench.shot is not None
    cut = {view: replace(one, frame_a=one.frame_a[:100], frame_b=None) for view, one in bench.shot.views.items()}
    bench.shot = replace(bench.shot, views=cut)
    view = bench.volume.look()
    assert (view.number, view.remedy) == (0, "choose another calibration, or calibrate again")
    assert "image of 400 x 100 px, calibrated for 400 x 300 px" in (view.problem or "")


def test_an_incomplete_shot_leaves_the_last_complete_one(bench: Bench) -> None:
    bench.volume.look()
    bench.shot = replace(droplet_shot(PLACE_MM, index=1), image_key=ImageKey.INVALID)
    view = bench.volume.look()
    assert (view.shot, view.problem) == (0, "shot 1 is incomplete")


def test_who_asks_while_it_is_busy_is_not_kept_waiting(bench: Bench) -> None:
    with bench.volume._busy:
        assert bench.volume.look().number == 0
    assert bench.volume.look().number == 1


def test_a_plane_that_is_not_there_is_named(bench: Bench) -> None:
    bench.volume.look()
    with pytest.raises(NotFound, match="the live volume has planes 0 to"):
        bench.volume.slice_png("x", 10_000)


@pytest.mark.parametrize("shape", [(1, 1, 1), (4, 5, 6), (7, 8, 9)])
def test_the_half_grid_fills_the_box_of_the_whole_one(shape: tuple[int, int, int]) -> None:
    whole = VoxelGrid(shape, (1.0, -2.0, 3.0), 0.5)
    half = half_of(whole)
    assert half.pitch_mm == 2 * whole.pitch_mm
    for axis in ("x_mm", "y_mm", "z_mm"):
        fine, coarse = getattr(whole, axis), getattr(half, axis)
        assert coarse[0] - half.pitch_mm / 2 == pytest.approx(fine[0] - whole.pitch_mm / 2)
        assert fine[-1] + whole.pitch_mm / 2 <= coarse[-1] + half.pitch_mm / 2 < fine[-1] + 2 * whole.pitch_mm
