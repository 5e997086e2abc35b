"""Calibration sets from images and tables that came from elsewhere."""

from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from processing.calibration.errors import CalibrationError, TargetNotFound
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.sets.known_dots import find_known_dots
from processing.calibration.sets.plane_detection import DetectedPlanes, PlaneImage, Size, detect_planes
from processing.calibration.sets.points_table import Table, read_table
from processing.calibration.sets.set_record import CalibrationEntry, PointsEntry
from processing.calibration.target.targets import Target
from processing.geometry import FloatArray
from processing.image_file import GreyImage, ImageFileError, read_image
from processing.progress import Counted, in_silence

MIN_LEVEL_POINTS = 3
"""Measured points are reported by z level where each level has so many points."""


def detect_imported(
    source: str, entry: CalibrationEntry, folder: Path, counted: Counted = in_silence
) -> CalibrationSet:
    """Detect the target in all images and read all tables.

    What single images do not tell, see ``plane_detection.detect_planes``.

    Parameters
    ----------
    source : str
        Name of the set.
    entry : CalibrationEntry
        What there is.
    folder : Path
        Paths in the entry are relative to it.
    counted : Counted
        Told of the images, one by one.

    Raises
    ------
    CalibrationError
        A camera never sees the target, sizes differ within a camera, or a table is wrong; names the file.
    """
    detected = _detected(folder, entry, counted)
    planes = defaultdict(list, {camera: list(seen.planes) for camera, seen in detected.views.items()})
    sizes = {camera: seen.image_size_px for camera, seen in detected.views.items()}
    for camera, file, size, levels in _measured(entry, folder):
        if sizes.setdefault(camera, size) != size:
            raise CalibrationError(f"{file}: {size} px, other images of {camera} have {sizes[camera]} px")
        planes[camera] += levels
    views = {camera: ViewObservations(sizes[camera], _in_order(planes[camera])) for camera in entry.cameras}
    unplaced = [one.camera for one in entry.points if one.image is None and None in (one.pixel_origin, one.v_axis)]
    return CalibrationSet(
        source,
        _target_mm(entry),
        views,
        detected.notes,
        azimuths_deg=entry.azimuth_deg,
        rolls_deg=entry.roll_deg,
        mirrored=entry.mirrored,
        scales_px_per_mm=entry.scales_px_per_mm,
        unit_stated=entry.unit is not None,
        unplaced_pixels=tuple(dict.fromkeys(unplaced)),
    )


def _detected(folder: Path, entry: CalibrationEntry, counted: Counted) -> DetectedPlanes:
    target = _target_mm(entry)
    if target is None:
        return DetectedPlanes({}, ())
    images = list(_plane_images(entry, folder))
    return detect_planes(str(folder), images, target, entry.roll_deg, entry.mirrored, counted)


def _target_mm(entry: CalibrationEntry) -> Target | None:
    """The target, its pitch in mm whatever the unit."""
    return entry.target and entry.target.model_copy(update={"pitch_mm": entry.target.pitch_mm * entry.unit_mm})


def _plane_images(entry: CalibrationEntry, folder: Path) -> Iterator[PlaneImage]:
    for plane in entry.plane:
        for camera, file in plane.images.items():
            origin_px = plane.origin_px.get(camera, entry.origin_px.get(camera))
            z_mm = None if plane.z_mm is None else plane.z_mm * entry.unit_mm
            yield PlaneImage(camera, Path(file).name, file, z_mm, partial(_image, folder / file), origin_px)


def _measured(entry: CalibrationEntry, folder: Path) -> Iterator[tuple[str, Path, Size, list[PlaneObservation]]]:
    """Camera, table, size of its images and levels of every entry of points."""
    for points in entry.points:
        table = read_table(folder / points.file, points.columns)
        world_mm = entry.unit_mm * np.column_stack([table["x_mm"], table["y_mm"], table["z_mm"]])
        if points.image:
            size, levels = _dot_levels(points, folder, table, world_mm)
        else:
            size, levels = _measured_levels(points, table, world_mm)
        yield points.camera, folder / points.file, size, levels


def _measured_levels(points: PointsEntry, table: Table, world_mm: FloatArray) -> tuple[Size, list[PlaneObservation]]:
    image_px = np.column_stack([table["u_px"], table["v_px"]]) - (points.pixel_origin or 0)
    width_px, height_px = points.image_size_px or (int(image_px[:, 0].max()) + 1, int(image_px[:, 1].max()) + 1)
    if points.v_axis == "up":
        image_px[:, 1] = height_px - 1 - image_px[:, 1]
    return (width_px, height_px), _levels(Path(points.file).name, world_mm, image_px)


def _dot_levels(
    points: PointsEntry, folder: Path, table: Table, world_mm: FloatArray
) -> tuple[Size, list[PlaneObservation]]:
    file = folder / str(points.image)
    image = _image(file)
    index_of = {int(name): index for index, name in enumerate(table["id"])}
    unknown = [name for name in points.seeds_px if not name.isdecimal() or int(name) not in index_of]
    if unknown:
        raise CalibrationError(f"{folder / points.file}: no point {', '.join(unknown)}, which seeds_px names")
    seeds_px = {index_of[int(name)]: place for name, place in points.seeds_px.items()}
    try:
        dots = find_known_dots(image, world_mm, seeds_px, points.dot_diameter_px)
    except TargetNotFound as error:
        raise TargetNotFound(f"{file}: {error}") from error
    return (image.shape[1], image.shape[0]), _levels(file.name, world_mm[dots.indices], dots.image_px)


def _image(file: Path) -> GreyImage:
    try:
        return read_image(file)
    except ImageFileError as error:
        raise CalibrationError(str(error)) from error


def _levels(name: str, world_mm: FloatArray, image_px: FloatArray) -> list[PlaneObservation]:
    """One observation per z level, or a single one where points are scattered along z."""
    levels_mm, counts = np.unique(world_mm[:, 2], return_counts=True)
    if counts.min() < MIN_LEVEL_POINTS:
        return [PlaneObservation(name, world_mm, image_px)]
    return [
        PlaneObservation(f"{name} z={z_mm:g}", world_mm[on_level], image_px[on_level], float(z_mm))
        for z_mm in levels_mm
        for on_level in [world_mm[:, 2] == z_mm]
    ]


def _in_order(planes: list[PlaneObservation]) -> tuple[PlaneObservation, ...]:
    return tuple(sorted(planes, key=lambda plane: 0.0 if plane.z_mm is None else plane.z_mm))
