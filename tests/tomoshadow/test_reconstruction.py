"""Images by the names of their views: none can be taken for another, none is left out in silence."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tomoshadow as ts
from processing.calibration.calibration import Calibration
from processing.calibration.errors import CalibrationError
from processing.calibration.verdict import Verdict
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.line_of_sight import line_of_sight
from processing.reconstruction.planning.plan import plan_reconstruction
from processing.synthetic.example import BINNING
from processing.synthetic.paper_rig import paper_cameras
from tests.support.drifting_views import calibration_of

GRID = ts.VoxelGrid.centred((12, 30, 40), 0.1)
CAMERAS = paper_cameras(BINNING)
DROPLET_MM = np.array([[0.4, -0.3, 0.2]])


def calibration() -> Calibration:
    unnamed = calibration_of(list(CAMERAS.values()))
    return replace(unnamed, views=dict(zip(CAMERAS, unnamed.views.values(), strict=True)))


def images(scale: float = 1.0) -> dict[str, NDArray[np.float32]]:
    """A round droplet in all views, each a little darker than the one before: exchanged views are seen."""
    return {name: scale * spot(name) * np.float32(1 - 0.1 * number) for number, name in enumerate(CAMERAS)}


def spot(name: str) -> NDArray[np.float32]:
    width_px, height_px = CAMERAS[name].image_size_px
    u_px, v_px = CAMERAS[name].project(DROPLET_MM)[0]
    column, row = np.meshgrid(np.arange(width_px), np.arange(height_px))
    return np.asarray(np.exp(-((column - u_px) ** 2 + (row - v_px) ** 2) / 8), np.float32)


@pytest.mark.parametrize("method", ["mlos", "minlos", "gavlos"])
def test_images_belong_to_views_by_name_whatever_their_order(method: str) -> None:
    plan = ts.plan(calibration(), GRID)
    seen = images()
    reconstruct = getattr(ts, method)
    backwards = reconstruct(plan, dict(reversed(seen.items())))
    np.testing.assert_array_equal(reconstruct(plan, seen), backwards)
    by_hand = line_of_sight(
        plan_reconstruction(list(CAMERAS.values()), GRID), list(seen.values()), ReconstructionMethod(method)
    )
    np.testing.assert_array_equal(backwards, by_hand)


def test_voxels_between_which_droplets_are_missed_are_told() -> None:
    coarse = ts.VoxelGrid.centred((4, 6, 8), 0.5)
    with pytest.warns(UserWarning, match=r"a voxel is [\d.]+ px wide, .* one voxel per pixel has a pitch of 0"):
        ts.plan(calibration(), coarse)


@pytest.mark.parametrize("method", ["mlos", "smart", "mart"])
def test_an_image_too_few_or_too_many_is_an_error_that_names_it(method: str) -> None:
    plan, seen = ts.plan(calibration(), GRID), images()
    reconstruct = getattr(ts, method)
    with pytest.raises(ValueError, match=r"images of \['view1', 'view2', 'view3'\], the plan has views .*'view4'"):
        reconstruct(plan, {name: image for name, image in seen.items() if name != "view4"})
    with pytest.raises(ValueError, match="'view5'"):
        reconstruct(plan, {**seen, "view5": seen["view1"]})


def test_some_of_the_views_make_a_plan_of_their_own() -> None:
    plan = ts.plan(calibration(), GRID, ["view3", "view1"])
    seen = images()
    two = ts.minlos(plan, {name: seen[name] for name in ("view1", "view3")})
    assert np.all(two >= ts.minlos(ts.plan(calibration(), GRID), seen) - 1e-3)


def test_a_view_that_nobody_calibrated_or_that_was_refused_makes_no_plan() -> None:
    with pytest.raises(CalibrationError, match=r"views \['view9'\] are not in calibration .*, it has .*'view1'"):
        ts.plan(calibration(), GRID, ["view1", "view9"])
    good = calibration()
    refused = replace(good, views={**good.views, "view2": replace(good.views["view2"], verdict=Verdict.REFUSE)})
    with pytest.raises(CalibrationError, match="view2 is refused"):
        ts.plan(refused, GRID)


def test_iterative_methods_bring_projections_nearer_to_the_images() -> None:
    plan, seen = ts.plan(calibration(), GRID), {name: spot(name) for name in CAMERAS}
    for solve in (ts.smart, ts.mart):
        residuals = solve(plan, seen, iterations=5).residuals
        assert len(residuals) == 6
        assert residuals[-1] < 0.7 * residuals[0]


def test_a_misspelt_option_is_an_error() -> None:
    with pytest.raises(TypeError, match="iteration"):
        ts.smart(ts.plan(calibration(), GRID), images(), iteration=3)  # type: ignore[call-arg]


def test_intensities_of_an_array_are_those_of_the_formula() -> None:
    frame = np.array([[200, 100], [50, 0]], np.uint16)
    background, dark = np.full((2, 2), 210.0), np.full((2, 2), 10.0)
    found = ts.intensity(frame, bits=8, background=background, dark=dark, minimum_window_px=0, noise_floor=0.0)
    np.testing.assert_allclose(found, [[0.05, 0.55], [0.8, 1.0]], atol=1e-6)


def test_what_is_no_grey_value_or_no_intensity_is_refused(tmp_path: Path) -> None:
    frame, even = np.full((4, 5), 200, np.uint16), np.full((4, 5), 210.0)
    with pytest.raises(ValueError, match="bits 7 of 1 to 16 reach to 127, a pixel is 200"):
        ts.intensity(frame, bits=7, background=even)
    with pytest.raises(ValueError, match="bits 17"):
        ts.intensity(frame, bits=17, background=even)
    even[2, 3] = np.nan
    with pytest.raises(ValueError, match=r"background: pixel \(column 3, row 2\) is nan"):
        ts.intensity(frame, bits=8, background=even)
    volume = np.zeros(GRID.shape, np.float32)
    volume[1, 2, 3] = np.inf
    with pytest.raises(ValueError, match=r"voxel \(z 1, y 2, x 3\) is inf"):
        ts.write_volume(tmp_path / "volume.vtkhdf", volume, GRID)
    assert not list(tmp_path.iterdir())


FRAME = np.full((40, 50), 200, np.uint8)
FRAME[10:14, 20:24] = 60
LIGHT = np.full((40, 50), 210, np.float32)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"polarity": "Shadow"}, "polarity 'Shadow': shadow or bright"),
        ({"polarity": None}, "polarity None: shadow or bright"),
        ({"polarity": "bright", "background": LIGHT}, "bright particles are before no light"),
    ],
)
def test_an_intensity_of_another_kind_than_was_meant_is_refused(options: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        ts.intensity(FRAME, bits=8, **options)


def test_masked_pixels_do_not_count_as_they_are() -> None:
    masked: Any = np.ma.masked_less(FRAME, 100)
    with pytest.raises(ValueError, match="masked values"):
        ts.intensity(masked, bits=8, background=LIGHT)


@pytest.mark.parametrize("solve", [ts.smart, ts.mart])
def test_masked_voxels_of_a_start_do_not_count_as_they_are(solve: Any) -> None:
    masked: Any = np.ma.masked_less(np.ones(GRID.shape, np.float32), 2)
    with pytest.raises(ValueError, match="start: has masked values"):
        solve(ts.plan(calibration(), GRID), images(), iterations=1, start=masked)


@pytest.mark.parametrize(
    ("references", "warning"),
    [
        ({"background": FRAME}, "is its own background"),
        ({"background": LIGHT / 210}, "has a background without light"),
        ({"background": np.zeros_like(LIGHT), "dark": LIGHT}, "is darker than its dark image|without light"),
        ({"background": LIGHT / 2}, "is brighter than its background"),
    ],
)
def test_light_that_does_not_fit_is_a_warning(references: dict[str, Any], warning: str) -> None:
    with pytest.warns(UserWarning, match=warning):
        ts.intensity(FRAME, bits=8, **references)


def test_grey_values_of_fewer_bits_than_stated_are_a_warning() -> None:
    """12 bits in files of 16: the noise floor is 16 times too high, and next to nothing is left of bright particles."""
    particle = (4000 * spot("view1")).astype(np.uint16)
    with pytest.warns(UserWarning, match="less than 1/8 of its grey values; .* are its bits too many"):
        ts.intensity(particle, bits=16, polarity="bright")


def test_a_background_that_is_turned_is_a_warning() -> None:
    """Light falls off to one side, as that of LEDs does: mild shadows, or none, where there is a spray."""
    light = np.asarray(210 * (1 - 0.1 * np.arange(50)[None, :] / 50) * np.ones((40, 1)), np.float32)
    frame = np.where(FRAME == 60, light / 3, light).astype(np.uint8)
    assert ts.intensity(frame, bits=8, background=light).max() > 0.5
    with pytest.warns(UserWarning, match="does not fit its background, but the same one with left and right exchanged"):
        ts.intensity(frame, bits=8, background=light[:, ::-1])


@pytest.mark.parametrize("method", ["mlos", "minlos", "gavlos", "smart", "mart"])
@pytest.mark.parametrize(
    ("spoil", "warning"),
    [
        (lambda image: 255 * image, r"view2: its image reaches 2\d\d.*, intensities 1: .* are these grey values"),
        (lambda image: 1 - image, "view2: its image is above 0.5 in half of its pixels: is it the light that is left"),
    ],
)
def test_what_can_be_no_intensity_is_a_warning(method: str, spoil: Any, warning: str) -> None:
    seen = images()
    seen["view2"] = spoil(seen["view2"])
    options = {"iterations": 1} if method in ("smart", "mart") else {}
    with pytest.warns(UserWarning, match=warning):
        getattr(ts, method)(ts.plan(calibration(), GRID), seen, **options)


def test_a_view_sees_the_volume_once() -> None:
    with pytest.raises(ValueError, match="views view1 are named twice"):
        ts.plan(calibration(), GRID, views=["view1", "view1", "view2"])


def test_a_pitch_of_nothing_is_not_the_default() -> None:
    with pytest.raises(ValueError, match="pitch 0 mm: it must be above 0"):
        ts.common_grid(calibration(), pitch_mm=0)
