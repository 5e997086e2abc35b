"""Calibration sets from images and tables that came from elsewhere."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from processing.calibration.errors import CalibrationError, TargetNotFound
from processing.calibration.known_dots import find_known_dots
from processing.calibration.observation import CalibrationSet, PlaneObservation, ViewObservations
from processing.calibration.set_record import CalibrationEntry, PlaneEntry, PointsEntry
from processing.calibration.targets import Target, TargetPoints, detect_target
from processing.geometry import FloatArray
from processing.image_file import GreyImage, ImageFileError, read_image

MIN_LEVEL_POINTS = 3
"""Measured points are reported by z level where each level has so many points."""

Size = tuple[int, int]


def detect_imported(source: str, entry: CalibrationEntry, folder: Path) -> CalibrationSet:
    """Detect the target in all images and read all tables.

    Parameters
    ----------
    source : str
        Name of the set.
    entry : CalibrationEntry
        What there is.
    folder : Path
        Paths in the entry are relative to it.

    Raises
    ------
    CalibrationError
        An image does not show the target, sizes differ within a camera, or a table is wrong; names the file.
    """
    planes: dict[str, list[PlaneObservation]] = defaultdict(list)
    sizes: dict[str, Size] = {}
    for camera, file, size, observations in _observations(entry, folder):
        if sizes.setdefault(camera, size) != size:
            raise CalibrationError(f"{file}: {size} px, other images of {camera} have {sizes[camera]} px")
        planes[camera] += observations
    views = {camera: ViewObservations(sizes[camera], _in_order(planes[camera])) for camera in entry.cameras}
    azimuths_deg = {name: azimuth for name, azimuth in entry.azimuth_deg.items() if name not in entry.roll_deg}
    return CalibrationSet(source, entry.target, views, azimuths_deg=azimuths_deg, rolls_deg=entry.roll_deg)


def place_points(points: TargetPoints, target: Target, name: str, z_mm: float | None) -> PlaneObservation:
    """Detected points on the plane z, or on a board in a free pose where z is not known."""
    on_plane_mm = target.points_mm(points.ids)
    world_mm = np.column_stack([on_plane_mm, np.full(len(points), z_mm or 0.0)])
    return PlaneObservation(name, world_mm, points.image_px, z_mm, free_pose=z_mm is None)


def read_table(path: Path, columns: Sequence[str]) -> dict[str, FloatArray]:
    """Columns of a table of numbers, separated by blanks, tabs, commas or semicolons; # starts a comment.

    Raises
    ------
    CalibrationError
        The file is missing, or a line does not have these columns; names file and line.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror}") from error
    rows = []
    for number, line in enumerate(lines, start=1):
        fields = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        if not fields:
            continue
        if len(fields) != len(columns):
            raise CalibrationError(f"{path}, line {number}: {len(fields)} values, columns are {', '.join(columns)}")
        try:
            rows.append([float(field) for field in fields])
        except ValueError as error:
            raise CalibrationError(f"{path}, line {number}: {error}") from error
        if not np.isfinite(rows[-1]).all():
            raise CalibrationError(f"{path}, line {number}: {', '.join(fields)}: values must be finite")
    if not rows:
        raise CalibrationError(f"{path}: no points in it")
    return dict(zip(columns, np.array(rows).T, strict=True))


def _observations(entry: CalibrationEntry, folder: Path) -> Iterator[tuple[str, Path, Size, list[PlaneObservation]]]:
    for plane in entry.plane:
        yield from _plane_observations(entry, plane, folder)
    for points in entry.points:
        size, observations = _dot_levels(points, folder) if points.image else _measured_levels(points, folder)
        yield points.camera, folder / points.file, size, observations


def _plane_observations(
    entry: CalibrationEntry, plane: PlaneEntry, folder: Path
) -> Iterator[tuple[str, Path, Size, list[PlaneObservation]]]:
    if entry.target is None:
        raise CalibrationError("calibration.target: planes need a target")
    for camera, file in plane.images.items():
        image = _image(folder / file)
        origin_px = plane.origin_px.get(camera, entry.origin_px.get(camera))
        try:
            points = detect_target(image, entry.target, origin_px, entry.roll_deg.get(camera, 0.0))
        except TargetNotFound as error:
            raise TargetNotFound(f"{folder / file}: {error}") from error
        size = (image.shape[1], image.shape[0])
        yield camera, folder / file, size, [place_points(points, entry.target, Path(file).name, plane.z_mm)]


def _measured_levels(points: PointsEntry, folder: Path) -> tuple[Size, list[PlaneObservation]]:
    table = read_table(folder / points.file, points.columns)
    image_px = np.column_stack([table["u_px"], table["v_px"]])
    size = points.image_size_px or (int(image_px[:, 0].max()) + 1, int(image_px[:, 1].max()) + 1)
    return size, _levels(Path(points.file).name, _world_mm(table), image_px)


def _dot_levels(points: PointsEntry, folder: Path) -> tuple[Size, list[PlaneObservation]]:
    table = read_table(folder / points.file, points.columns)
    file = folder / str(points.image)
    image, world_mm = _image(file), _world_mm(table)
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


def _world_mm(table: dict[str, FloatArray]) -> FloatArray:
    return np.column_stack([table["x_mm"], table["y_mm"], table["z_mm"]])


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
