"""A camera that hangs upside down fits as well as any other; where the rig says that it stands gives it away."""

from dataclasses import replace

import numpy as np
import pytest

from processing.calibration.calibrate import calibrate
from processing.calibration.errors import CalibrationError
from processing.calibration.fit.placement import placement
from processing.calibration.observation import CalibrationSet, PlaneObservation
from processing.calibration.target.targets import Target, detect_target
from processing.calibration.triangulation import triangulate
from processing.geometry import PinholeCamera, rotation_from_angles, view_camera
from processing.synthetic.target import Checkerboard, render_target
from processing.synthetic.view_optics import ViewOptics
from tests.support.calibration_cases import calibration_set, seen_planes

AZIMUTHS_DEG = {"view1": 45.0, "view2": 15.0, "view3": -15.0, "view4": -45.0}
Z_MM = (-4.0, -1.0, 1.0, 4.0)
MIDDLE_MM = np.zeros(3)


def camera(azimuth_deg: float, roll_deg: float = 0.0, pitch_deg: float = 0.0) -> PinholeCamera:
    return view_camera(
        azimuth_deg,
        focal_length_mm=100.0,
        magnification=0.45,
        scale_px_per_mm=60.0,
        pitch_deg=pitch_deg,
        roll_deg=roll_deg,
    )


def labelled(seen: tuple[PlaneObservation, ...], turn_deg: float) -> tuple[PlaneObservation, ...]:
    """What a detector says that takes the image of a turned camera for that of an upright one."""
    turn = rotation_from_angles(0.0, 0.0, np.deg2rad(turn_deg)).T
    return tuple(replace(plane, points_mm=plane.points_mm @ turn.T) for plane in seen)


def rig(azimuths_deg: dict[str, float], **turned_deg: float) -> CalibrationSet:
    """Views that stand where the rig says, some of them turned about their axes without anybody saying so."""
    planes = {
        name: labelled(
            seen_planes(camera(azimuth_deg, turned_deg.get(name, 0.0)), z_mm=Z_MM, columns=15, rows=11),
            -turned_deg.get(name, 0.0),
        )
        for name, azimuth_deg in azimuths_deg.items()
    }
    return replace(calibration_set(**planes), azimuths_deg=azimuths_deg)


@pytest.mark.parametrize("angles_deg", [(45.0, 0.0, 0.0), (-15.0, 4.0, 175.0), (30.0, -10.0, -80.0), (170.0, 1.0, 2.0)])
def test_placement_tells_the_angles(angles_deg: tuple[float, float, float]) -> None:
    azimuth_deg, pitch_deg, roll_deg = angles_deg
    stands = placement(camera(azimuth_deg, roll_deg, pitch_deg), MIDDLE_MM)
    np.testing.assert_allclose((stands.azimuth_deg, stands.pitch_deg, stands.roll_deg), angles_deg, atol=0.1)
    assert stands.centre_mm == pytest.approx(camera(azimuth_deg, roll_deg, pitch_deg).centre_mm)


def test_a_polynomial_stands_somewhere_too() -> None:
    fitted = calibrate(rig({"view1": 45.0}), model="polynomial").views["view1"].mapping
    stands = placement(fitted, MIDDLE_MM)
    assert (stands.azimuth_deg, stands.roll_deg) == pytest.approx((45.0, 0.0), abs=0.5)
    assert stands.centre_mm is None


def test_without_the_rig_every_view_is_good_and_the_lines_of_sight_miss_each_other() -> None:
    """Why there is a check: this is what would be reconstructed with."""
    silent = replace(rig(AZIMUTHS_DEG, view4=180.0), azimuths_deg={})
    calibration = calibrate(silent)
    assert all(view.holdout_error_px < 0.07 for view in calibration.views.values())
    droplet_mm = np.array([[2.0, 1.0, 1.5]])
    cameras = [camera(azimuth_deg) for azimuth_deg in AZIMUTHS_DEG.values()]
    seen_px = np.stack([one.project(droplet_mm) for one in [*cameras[:3], camera(-45.0, 180.0)]], axis=1)
    _, left_px = triangulate([view.mapping for view in calibration.views.values()], seen_px, droplet_mm)
    assert np.linalg.norm(left_px, axis=2).max() > 50
    (note,) = calibration.notes
    assert note.startswith("view1 and view4 seem to stand in one place: if one of them hangs upside down (roll_deg) or")
    assert {name: view.reasons for name, view in calibration.views.items() if note in view.reasons}.keys() == {
        "view1",
        "view4",
    }


@pytest.mark.parametrize("model", ["pinhole", "polynomial"])
def test_an_upside_down_camera_is_refused_by_name_with_the_remedy(model: str) -> None:
    with pytest.raises(CalibrationError) as refusal:
        calibrate(rig(AZIMUTHS_DEG, view4=180.0), model=model)
    text = str(refusal.value)
    assert text.startswith(
        "view4: stands at 45 deg by the target, at -45 deg by the rig; with x and y turned by 180 deg"
    )
    assert "Say --roll view4=180 (roll_deg in configuration or manifest), or --roll view4=0 if" in text
    assert "view1" not in text
    assert "exchanged" not in text


@pytest.mark.parametrize(
    ("turned_deg", "said"),
    [
        ({"view3": 180.0, "view2": 180.0}, ("view2=180", "view3=180")),
        ({"view1": 90.0}, ("view1=90",)),
        ({"view2": -90.0, "view4": 180.0}, ("view2=-90", "view4=180")),
    ],
)
def test_all_turned_cameras_are_named(turned_deg: dict[str, float], said: tuple[str, ...]) -> None:
    with pytest.raises(CalibrationError) as refusal:
        calibrate(rig(AZIMUTHS_DEG, **turned_deg))
    text = str(refusal.value)
    assert [part.split("Say --roll ")[1].split(" ")[0] for part in text.split("; view")] == list(said)


@pytest.mark.parametrize("pair", [("view1", "view2"), ("view2", "view3"), ("view1", "view4")])
def test_views_whose_images_were_exchanged_are_asked_about(pair: tuple[str, str]) -> None:
    one, other = pair
    exchanged = AZIMUTHS_DEG | {one: AZIMUTHS_DEG[other], other: AZIMUTHS_DEG[one]}
    with pytest.raises(CalibrationError, match=f"; or have {one} and {other} been exchanged"):
        calibrate(replace(rig(exchanged), azimuths_deg=AZIMUTHS_DEG))


def test_exchanged_views_that_no_turn_explains_are_refused() -> None:
    said_deg = {"far": -70.0, "near": -48.0, "right": 40.0}
    with pytest.raises(CalibrationError, match="have far and near been exchanged"):
        calibrate(replace(rig(said_deg | {"far": -48.0, "near": -70.0}), azimuths_deg=said_deg))


def test_a_pitch_that_explains_all_views_is_asked_for_before_a_turn_that_explains_one() -> None:
    """Twice the pitch puts the view at -35 deg where it would stand if it were turned by 90 deg, nearly."""
    seen = rig({"left": 40.0, "middle": 5.0, "right": -35.0})
    views = {
        name: replace(
            view, planes=tuple(replace(plane, points_mm=plane.points_mm * (2.0, 2.0, 1.0)) for plane in view.planes)
        )
        for name, view in seen.views.items()
    }
    with pytest.raises(
        CalibrationError, match=r"^all views would stand .* if x were 0\.5 times as long.*; else: right"
    ):
        calibrate(replace(seen, views=views))


def test_a_view_from_the_front_cannot_be_checked_and_is_asked_about() -> None:
    with pytest.raises(CalibrationError, match=r"^left: stands at .*; front: looks the same either way; if it is"):
        calibrate(rig({"left": 40.0, "front": 0.0, "right": -40.0}, left=180.0))


def test_a_camera_that_was_said_to_hang_upside_down_and_does_not() -> None:
    wrong = replace(rig(AZIMUTHS_DEG, view4=180.0), rolls_deg={"view4": 180.0})
    with pytest.raises(CalibrationError, match=r"Say --roll view4=0 \(.*or --roll view4=180 if"):
        calibrate(wrong)


def test_a_target_that_stands_askew_is_no_matter() -> None:
    askew = {name: azimuth_deg + 12.0 for name, azimuth_deg in AZIMUTHS_DEG.items()}
    assert calibrate(replace(rig(AZIMUTHS_DEG), azimuths_deg=askew)).notes == ()


def test_a_wrong_number_in_the_rig_is_noted() -> None:
    wrong = AZIMUTHS_DEG | {"view2": 75.0}
    calibration = calibrate(replace(rig(AZIMUTHS_DEG), azimuths_deg=wrong))
    (note,) = calibration.notes
    assert note == "view2: stands at 15 deg by the target, at 75 deg by the rig, 60.0 deg apart"
    assert (calibration.views["view2"].verdict, calibration.views["view2"].reasons[-1]) == ("warn", note)


def test_all_views_turned_alike_agree_with_each_other() -> None:
    (note,) = calibrate(rig(AZIMUTHS_DEG, view1=180, view2=180, view3=180, view4=180)).notes
    assert note.startswith("every view sees the target's axes turned by 180 deg about z: so do x and y of all results")


@pytest.mark.parametrize("roll_deg", [0.0, 90.0, 180.0, -90.0, 172.0])
@pytest.mark.parametrize("size", [(23, 17), (14, 10)])
def test_axes_are_those_of_the_target_however_the_camera_is_turned(roll_deg: float, size: tuple[int, int]) -> None:
    """Of a board with an even number of corners the middle one lies beside the middle: on the same side for all."""
    small = view_camera(
        15.0,
        focal_length_mm=100.0,
        magnification=0.45,
        scale_px_per_mm=20.0,
        image_size_px=(560, 560),
        roll_deg=roll_deg,
    )
    image = render_target(small, Checkerboard(*size, 1.0), 0.0, ViewOptics(22, 100, 0.45, 22.2, 25))
    target = Target(kind="checkerboard", columns=size[0], rows=size[1], pitch_mm=1.0)
    points = detect_target((4000 * image).astype(np.float32), target, roll_deg=roll_deg)
    on_board_mm = target.points_mm(points.ids)
    # the renderer's board lies with its middle on the axis, the target's origin on the node before it
    on_board_mm += target.points_mm(target.board_ids()).mean(axis=0) * -1
    seen_px = small.project(np.column_stack([on_board_mm, np.zeros(len(points))]))
    assert len(points) > 0.97 * size[0] * size[1]
    assert np.abs(seen_px - points.image_px).max() < 0.5


def test_a_view_whose_x_and_z_count_the_other_way_is_doubted() -> None:
    """Right-handed, and on the line of the rig; but its lines of sight meet no other."""
    seen = rig(AZIMUTHS_DEG)
    planes = tuple(replace(plane, points_mm=plane.points_mm * (-1, 1, -1)) for plane in seen.views["view3"].planes)
    views = {**seen.views, "view3": replace(seen.views["view3"], planes=planes)}
    calibration = calibrate(replace(seen, views=views))
    assert [name for name, view in calibration.views.items() if view.verdict == "warn"] == ["view3"]
    assert "on the other side of the target" in " ".join(calibration.notes)


def test_views_from_both_sides_and_azimuths_that_all_count_the_other_way_are_no_matter() -> None:
    sides = {"view1": 30.0, "view2": -30.0, "view3": 170.0}
    assert calibrate(rig(sides)).notes == ()
    assert calibrate(replace(rig(sides), azimuths_deg={name: angle - 180 for name, angle in sides.items()})).notes == ()
