"""Planes of a target, recorded or imported: each image tells for itself, or the other planes of its view tell."""

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from processing.calibration.errors import CalibrationError, OriginUnknown, TargetNotFound
from processing.calibration.observation import PlaneObservation, ViewObservations
from processing.calibration.sets.partial_views import detect_by_others
from processing.calibration.target.targets import Target, TargetPoints, detect_target
from processing.geometry import FloatArray
from processing.progress import Counted, in_silence

Image = NDArray[np.generic]
Size = tuple[int, int]
Found = dict[int, PlaneObservation]
"""By index of the image."""

MIN_FREE_POINTS = 8
"""Half of a board's points pose it in the hold-out test, and a pose needs four."""


@dataclass(frozen=True)
class PlaneImage:
    """An image of the target, read when it is needed.

    Parameters
    ----------
    view : str
        Who sees it.
    name : str
        Of the plane.
    where : str
        What notes and errors call it.
    z_mm : float | None
        Position of the target; None where it stands in a free pose.
    read : callable
        The image, (rows, columns) grey values.
    origin_px : tuple[float, float] | None
        Where the target's origin is seen (u, v), roughly, if somebody said so.
    """

    view: str
    name: str
    where: str
    z_mm: float | None
    read: Callable[[], Image]
    origin_px: tuple[float, float] | None = None


@dataclass(frozen=True)
class DetectedPlanes:
    """What the images show.

    Parameters
    ----------
    views : Mapping[str, ViewObservations]
        By view, its planes in the order of the images.
    notes : tuple[str, ...]
        Which images were left out and why, and which ones others told; one line each.
    """

    views: Mapping[str, ViewObservations]
    notes: tuple[str, ...]


def detect_planes(
    source: str,
    images: Sequence[PlaneImage],
    target: Target,
    rolls_deg: Mapping[str, float],
    mirrored: Collection[str] = (),
    counted: Counted = in_silence,
) -> DetectedPlanes:
    """Find the target in all images.

    Where a view sees a part of the target only, the planes at which it is told which points these are (the whole
    board, a marker, a stated origin) tell it for the others. An image that does not show the target is left out;
    notes say both.

    Parameters
    ----------
    source : str
        Directory of the run or set; errors name it.
    images : sequence of PlaneImage
        Of all views.
    target : Target
        What to look for.
    rolls_deg : mapping of view to angle
        How cameras are turned about their axes; the others count as upright.
    mirrored : collection of views
        Those that look by a mirror: the target is looked for in their flipped images.
    counted : Counted
        Told of the images, one by one.

    Raises
    ------
    CalibrationError
        A view never sees the target, or its images differ in size.
    """
    images = [
        replace(image, read=partial(_flipped, image.read)) if image.view in mirrored else image for image in images
    ]
    sizes_px, found, missed = _first_look(source, images, target, rolls_deg, mirrored, counted)
    more, notes = _second_look(images, target, found, missed, rolls_deg)
    planes: dict[str, list[PlaneObservation]] = defaultdict(list)
    for index, plane in sorted((found | more).items()):
        view = images[index].view
        planes[view].append(_flipped_back(plane, sizes_px[view]) if view in mirrored else plane)
    for view in sizes_px:
        if view not in planes:
            reason = next(note for note in notes if note.startswith(f"{view}, "))
            raise CalibrationError(f"{source}: {view} never sees the target; {reason}")
    return DetectedPlanes({view: ViewObservations(sizes_px[view], tuple(planes[view])) for view in sizes_px}, notes)


def place_points(points: TargetPoints, target: Target, name: str, z_mm: float | None) -> PlaneObservation:
    """Detected points on the plane z, or on a board in a free pose where z is not known."""
    on_plane_mm = target.points_mm(points.ids)
    world_mm = np.column_stack([on_plane_mm, np.full(len(points), z_mm or 0.0)])
    return PlaneObservation(name, world_mm, points.image_px, z_mm, free_pose=z_mm is None)


def _flipped(read: Callable[[], Image]) -> Image:
    """An image as it would be without the mirror."""
    return read()[:, ::-1]


def _flipped_back(plane: PlaneObservation, size_px: Size) -> PlaneObservation:
    """What was found in the flipped image, where the image itself has it."""
    return replace(plane, image_px=_flip_u(plane.image_px, size_px))


def _flip_u(image_px: FloatArray, size_px: Size) -> FloatArray:
    return image_px * (-1.0, 1.0) + (size_px[0] - 1.0, 0.0)


def _first_look(
    source: str,
    images: Sequence[PlaneImage],
    target: Target,
    rolls_deg: Mapping[str, float],
    mirrored: Collection[str],
    counted: Counted,
) -> tuple[dict[str, Size], Found, dict[int, TargetNotFound]]:
    """Sizes by view; what each image tells by itself, and why the others do not."""
    sizes_px: dict[str, Size] = {}
    found, missed = {}, {}
    for index, image in enumerate(counted(images, lambda image: f"target in {image.view}, {image.where}")):
        pixels = image.read()
        size_px = (pixels.shape[1], pixels.shape[0])
        if sizes_px.setdefault(image.view, size_px) != size_px:
            others = f"other images of {image.view} have {sizes_px[image.view]} px"
            raise CalibrationError(f"{source}: {image.where}: {size_px} px, {others}")
        origin_px = image.origin_px
        if origin_px is not None and image.view in mirrored:
            origin_px = (size_px[0] - 1 - origin_px[0], origin_px[1])
        try:
            points = detect_target(pixels, target, origin_px, rolls_deg.get(image.view, 0.0))
            if image.z_mm is None and len(points) < MIN_FREE_POINTS:
                raise TargetNotFound(
                    f"{len(points)} of its points are sharp; a board in a free pose needs {MIN_FREE_POINTS}"
                )
            found[index] = place_points(points, target, image.name, image.z_mm)
        except TargetNotFound as error:
            missed[index] = error
    return sizes_px, found, missed


def _second_look(
    images: Sequence[PlaneImage],
    target: Target,
    found: Found,
    missed: Mapping[int, TargetNotFound],
    rolls_deg: Mapping[str, float],
) -> tuple[Found, tuple[str, ...]]:
    """What the other planes of a view tell of images that show a part of the target; notes on all of these."""
    more, notes = {}, []
    for index, reason in missed.items():
        image = images[index]
        known = [plane for other, plane in found.items() if images[other].view == image.view]
        try:
            points = _told_by_others(image, reason, target, known, rolls_deg.get(image.view, 0.0))
        except TargetNotFound as error:
            also = "" if error is reason else f"; {error}"
            notes.append(f"{image.view}, {image.where} left out: {reason}{also}")
            continue
        more[index] = place_points(points, target, image.name, image.z_mm)
        notes.append(f"{image.view}, {image.where}: {len(points)} points of the target; other positions tell which")
    return more, tuple(notes)


def _told_by_others(
    image: PlaneImage, reason: TargetNotFound, target: Target, known: Sequence[PlaneObservation], roll_deg: float
) -> TargetPoints:
    """The points of an image of which the others may tell; where they cannot, the reason stands."""
    if image.z_mm is None or not isinstance(reason, OriginUnknown):
        raise reason
    return detect_by_others(image.read(), target, image.z_mm, known, roll_deg)
