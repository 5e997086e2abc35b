"""What may be wrong with a calibration without showing, as nothing was stated that would tell."""

from collections.abc import Iterator, Sequence

from processing.calibration.fit.scale_check import steps_are_told
from processing.calibration.observation import CalibrationSet
from processing.calibration.verdict import Unchecked

DROPLETS = Unchecked(
    "whether all views saw the target in the same places, and none of them by a mirror or upside down",
    "a run that was recorded with these views: calibrate --run RUN, or check RUN",
)
"""Told by droplets alone: the points of each view are labelled by what that view shows."""
ALIKE = Unchecked(
    "whether all views are upside down alike, by a setting of the cameras or a program: y, and velocities along it, "
    "would be reversed, and views, azimuths and droplets agree all the same",
    "[spray] nozzle and direction in a run: statistics and report doubt those against which droplets fly",
)
"""A world in which y points the other way has the same lines of sight."""


def not_checked(
    calibration_set: CalibrationSet, undirected: Sequence[str], shapeless: Sequence[str]
) -> Iterator[Unchecked]:
    """What nothing tells of a set at known places.

    Parameters
    ----------
    calibration_set : CalibrationSet
        With all that was stated.
    undirected : sequence of str
        Views whose perspective is too weak to tell right-handed axes from left-handed ones.
    shapeless : sequence of str
        Views whose model has no pixels that ought to be square.
    """
    yield from _sides(undirected)
    unplaced = [name for name in calibration_set.views if name not in calibration_set.azimuths_deg]
    yield from _places(unplaced)
    yield from _steps(calibration_set, unplaced, shapeless)
    yield from _scales([name for name in calibration_set.views if name not in calibration_set.scales_px_per_mm])
    yield from _units(shapeless)
    yield from _pixels(calibration_set.unplaced_pixels)
    if len(calibration_set.views) > 1:
        yield DROPLETS
    yield ALIKE


def _sides(undirected: Sequence[str]) -> Iterator[Unchecked]:
    """From which side views look."""
    if undirected:
        yield Unchecked(
            f"whether z and the images of {', '.join(undirected)} count the right way, as sights hardly diverge",
            "azimuth_deg of these views",
        )


def _places(unplaced: Sequence[str]) -> Iterator[Unchecked]:
    """Where views stand."""
    if unplaced:
        yield Unchecked(
            f"where {', '.join(unplaced)} should stand: files of two cameras may be exchanged, or a camera turned; or "
            "all of them mirrored alike",
            f"azimuth_deg of {', '.join(unplaced)}",
        )


def _steps(calibration_set: CalibrationSet, unplaced: Sequence[str], shapeless: Sequence[str]) -> Iterator[Unchecked]:
    """Whether z is in proportion to x and y: all steps too long fit as well, with pixels that are nearly square."""
    levels_mm = {plane.z_mm for view in calibration_set.views.values() for plane in view.planes}
    shaped = [name for name in calibration_set.views if name not in shapeless]
    if unplaced and len(levels_mm) == 2:
        yield Unchecked(
            "whether the two planes are as far apart as z_mm says: cameras fit any distance of two",
            f"a third plane, or azimuth_deg of {', '.join(unplaced)}",
        )
    elif shaped and not steps_are_told(calibration_set.azimuths_deg.get(name, 0.0) for name in shaped):
        yield Unchecked(
            "whether z is in proportion to x and y, as steps of a stage are to the pitch of a target: cameras fit one "
            "that is some percent too long or too short everywhere",
            "azimuth_deg of two oblique views or more",
        )


def _scales(unscaled: Sequence[str]) -> Iterator[Unchecked]:
    """How large everything is."""
    if unscaled:
        yield Unchecked(
            f"whether the scale of {', '.join(unscaled)} is right: pitch_mm, z_mm, and their unit",
            f"scale_px_per_mm of {', '.join(unscaled)}: magnification over pixel pitch",
        )


def _units(shapeless: Sequence[str]) -> Iterator[Unchecked]:
    """Whether x, y and z are alike."""
    if shapeless:
        yield Unchecked(
            f"whether x, y and z of {', '.join(shapeless)} are in one unit, and square to each other: a polynomial "
            "fits a wrong pitch, step or travel of the stage as well as the right ones",
            "--model pinhole once, which asks whether pixels are square",
        )


def _pixels(unplaced_pixels: Sequence[str]) -> Iterator[Unchecked]:
    """How points of a table count pixels."""
    if names := ", ".join(unplaced_pixels):
        yield Unchecked(
            f"whether u and v of {names} count from 0 in the middle of the first pixel, and v downwards, as in a run",
            f"pixel_origin and v_axis of the points of {names}",
        )
