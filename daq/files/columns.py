"""The columns of a run: every number that is stored beside the frames, once per shot. Pure.

One table says name, type, unit and shape; shot files, the virtual view over them and packed files are
made from it. The first axis of every column is the shot.
"""

import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.files.header import RunHeader
from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, Flaw, Image, LightPulse, Shot

Columns = Mapping[str, NDArray[Any]]

SHOT_VERSION = 2
"""Of shot files: a column says since which one it is there."""
PULSE_SLOTS = 4
"""Light pulses per view that a shot can hold; a slot without a pulse has width 0."""
BITS = "significant_bits"
"""Attribute of the frames of a view: of a grey value. No checksum holds it, and other programs read by it."""
NO_SEQUENCE = -1
"""Trigger sequence of a shot that no generator fired."""
NO_EDGE_NS = -(2**63)
"""Camera trigger of a view that was not triggered."""


@dataclass(frozen=True)
class Column:
    """Number type, unit, axes after the shot axis, and the version of shot files since which it is there; 0 before."""

    dtype: str
    units: str
    shape: tuple[int, ...] = ()
    axes: str = "shot"
    since: int = 1


_SHOT_COLUMNS = {
    "index": Column("i8", "1"),
    "image_key": Column("u1", "1"),
    "sequence": Column("i8", "1"),
    "host_time_ns": Column("i8", "ns"),
    "stage_z_mm": Column("f8", "mm"),
    "refires": Column("i8", "1", since=2),
    "period_ns": Column("i8", "ns", since=2),
    "clock_step_ns": Column("i8", "ns", since=2),
}
_EXPOSURE_COLUMNS = {
    "valid": ("?", "1"),
    "frame_id": ("i8", "1"),
    "device_timestamp_ns": ("i8", "ns"),
    "missing_packets": ("i8", "1"),
    "resent_packets": ("i8", "1"),
    "flaw": ("u1", "1"),
}
_SINCE = {"flaw": 2}
_PULSE_COLUMNS = {"start_ns": ("i8", "ns"), "width_ns": ("i8", "ns"), "current_a": ("f8", "A")}


def view_path(view: str, name: str) -> str:
    """Path of a dataset of one view."""
    return f"/cameras/{view}/{name}"


def frames_path(view: str) -> str:
    """Path of the frames of one view, (shot, frame, row, column)."""
    return view_path(view, "frames")


def crc32_path(view: str) -> str:
    """Path of the CRC-32 of every frame of one view, (shot, frame)."""
    return view_path(view, "crc32")


def columns_of(header: RunHeader, version: int = SHOT_VERSION) -> dict[str, Column]:
    """Every column of a run by its path; those that shot files of a version have."""
    columns = {f"/shots/{name}": column for name, column in _SHOT_COLUMNS.items()}
    frames = (header.frames_per_shot,)
    for view in header.views:
        columns[crc32_path(view)] = Column("u4", "1", frames, "shot,frame")
        columns[view_path(view, "camera_trigger_ns")] = Column("i8", "ns")
        for name, (dtype, units) in _EXPOSURE_COLUMNS.items():
            columns[view_path(view, name)] = Column(dtype, units, frames, "shot,frame", _SINCE.get(name, 1))
        columns[view_path(view, "late_frames")] = Column("i8", "1", since=2)
        for name, (dtype, units) in _PULSE_COLUMNS.items():
            columns[view_path(view, f"pulse_{name}")] = Column(dtype, units, (PULSE_SLOTS,), "shot,pulse")
    return {path: column for path, column in columns.items() if column.since <= version}


def crc32_of(run_id: str, columns: Mapping[str, Any]) -> int:
    """CRC-32 of all numbers of a shot, each after its path."""
    check = zlib.crc32(run_id.encode())
    for name in sorted(columns):
        check = zlib.crc32(np.asarray(columns[name]).tobytes(), zlib.crc32(name.encode(), check))
    return check


def shot_to_columns(shot: Shot, header: RunHeader) -> dict[str, NDArray[Any]]:
    """Values of one shot, without the shot axis; the CRC-32 of the frames is added by who encodes them.

    Raises
    ------
    ValueError
        The generator reports more pulses than a shot can hold.
    """
    values: dict[str, Any] = {
        "/shots/index": shot.index,
        "/shots/image_key": int(shot.image_key),
        "/shots/sequence": shot.fired.sequence if shot.fired else NO_SEQUENCE,
        "/shots/host_time_ns": shot.host_time_ns,
        "/shots/stage_z_mm": np.nan if shot.stage_z_mm is None else shot.stage_z_mm,
        "/shots/refires": shot.refires,
        "/shots/period_ns": shot.period_ns,
        "/shots/clock_step_ns": shot.clock_step_ns,
    }
    fired = shot.fired or FiredTrain(NO_SEQUENCE)
    for view in header.views:
        double_frame = shot.views[view]
        records = (double_frame.record_a, double_frame.record_b)[: header.frames_per_shot]
        values[view_path(view, "late_frames")] = double_frame.late_frames
        values[view_path(view, "camera_trigger_ns")] = fired.camera_trigger_ns.get(view, NO_EDGE_NS)
        for name in _EXPOSURE_COLUMNS:
            values[view_path(view, name)] = [getattr(record, name) for record in records]
        for name, numbers in _pulse_slots(view, fired.pulses.get(view, ())).items():
            values[view_path(view, f"pulse_{name}")] = numbers
    columns = columns_of(header)
    return {path: np.array(value, columns[path].dtype) for path, value in values.items()}


def shot_from_columns(columns: Columns, frames: Mapping[str, list[Image]]) -> Shot:
    """Restore a shot from its columns (without the shot axis) and the frames of every view."""
    sequence = int(columns["/shots/sequence"])
    stage_z_mm = float(columns["/shots/stage_z_mm"])
    return Shot(
        index=int(columns["/shots/index"]),
        image_key=ImageKey(int(columns["/shots/image_key"])),
        views={view: _double_frame(columns, view, images) for view, images in frames.items()},
        fired=None if sequence == NO_SEQUENCE else _fired_train(columns, sequence, frames),
        host_time_ns=int(columns["/shots/host_time_ns"]),
        stage_z_mm=None if np.isnan(stage_z_mm) else stage_z_mm,
        refires=int(columns["/shots/refires"]),
        period_ns=int(columns["/shots/period_ns"]),
        clock_step_ns=int(columns["/shots/clock_step_ns"]),
    )


def _pulse_slots(view: str, pulses: tuple[LightPulse, ...]) -> dict[str, list[float]]:
    if len(pulses) > PULSE_SLOTS:
        raise ValueError(f"{view}: {len(pulses)} light pulses, a shot holds {PULSE_SLOTS}")
    padding = [0] * (PULSE_SLOTS - len(pulses))
    return {name: [getattr(pulse, name) for pulse in pulses] + padding for name in _PULSE_COLUMNS}


def _double_frame(columns: Columns, view: str, images: list[Image]) -> DoubleFrame:
    fields = [columns[view_path(view, name)].tolist() for name in _EXPOSURE_COLUMNS]
    exposures = [dict(zip(_EXPOSURE_COLUMNS, values, strict=True)) for values in zip(*fields, strict=True)]
    records = [ExposureRecord(**{**exposure, "flaw": Flaw(exposure["flaw"])}) for exposure in exposures]
    late_frames = int(columns[view_path(view, "late_frames")])
    if len(images) == 1:
        return DoubleFrame(images[0], None, records[0], ExposureRecord(valid=False), late_frames)
    return DoubleFrame(images[0], images[1], records[0], records[1], late_frames)


def _fired_train(columns: Columns, sequence: int, views: Iterable[str]) -> FiredTrain:
    edges_ns = {view: int(columns[view_path(view, "camera_trigger_ns")]) for view in views}
    return FiredTrain(
        sequence=sequence,
        camera_trigger_ns={view: edge_ns for view, edge_ns in edges_ns.items() if edge_ns != NO_EDGE_NS},
        pulses={view: _pulses(columns, view) for view in views},
    )


def _pulses(columns: Columns, view: str) -> tuple[LightPulse, ...]:
    fields = [columns[view_path(view, f"pulse_{name}")].tolist() for name in _PULSE_COLUMNS]
    return tuple(LightPulse(*values) for values in zip(*fields, strict=True) if values[1])


def unlike_bits(file: Any, header: RunHeader) -> Iterator[str]:
    """Of which views an open file of a run, or of one of its shots, says other bits than the run; for people."""
    for view, view_format in header.views.items():
        bits = file[frames_path(view)].attrs.get(BITS, view_format.bits)
        if bits != view_format.bits:
            yield (
                f"{file.filename}: frames of {view} have {bits} significant bits, those of the run {view_format.bits}: "
                "copy it back from a backup"
            )
