"""What files of a version say, by the product's own readers; ``expected.json`` beside them keeps it for ever.

Once per version, when its files are added: ``python -m tests.support.old_data tests/fixtures/v0.1.0``.
"""

import hashlib
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from daq.files.run_directory import RunReader, Shot, list_runs
from daq.run.events import RunStatus
from daq.shot import DoubleFrame, FiredTrain
from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.droplets.droplet_statistics import droplet_statistics
from processing.calibration.calibration_file import load_calibration
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.reconstruction.volume_file import open_volume
from processing.synthetic.truth_file import read_true_cameras, read_true_spray
from server.lab.calibrations import CalibrationStore
from server.lab.jobs.job_table import JobTable
from server.lab.results import result_sets
from server.lab.runs.run_store import RunStore
from server.pictures.previews import load_preview

EXPECTED = "expected.json"
POINTS_MM = ((0.0, 0.0, 0.0), (0.5, -0.4, 0.6), (-0.7, 0.3, -0.8))
"""Where mappings are compared."""

Description = dict[str, Any]
"""JSON values."""


def run(run_dir: Path) -> Description:
    """Header, end, references and shots of a run."""
    with RunReader(run_dir) as reader:
        header = reader.header.model_dump(mode="json")
        return {
            "header": header,
            "outcome": reader.outcome,
            "cause": reader.cause,
            "image_keys": reader.image_keys().tolist(),
            "dark_mean": {view: _means(reader.dark(view)) for view in header["views"]},
            "background_mean": {view: _means(reader.background(view)) for view in header["views"]},
            "shots": [_shot(reader.read_shot(index)) for index in range(reader.shot_count)],
        }


def packed_run(path: Path) -> Description:
    """A packed run, as any reader of HDF5 sees it; the frames of a shot by view and exposure."""
    with h5py.File(path, "r") as file:
        return {
            "schema": file.attrs["schema"],
            "schema_version": int(file.attrs["schema_version"]),
            "run_id": json.loads(file["entry/run_id"].asstr()[()]),
            "outcome": file["entry/outcome"].asstr()[()],
            "image_keys": file["shots/image_key"][()].tolist(),
            "sha256": frames_sha256(file),
        }


def frames_sha256(file: h5py.File) -> dict[str, list[list[str]]]:
    """Hashes of all frames by view, shot and exposure, read by their paths in the file."""
    return {
        view: [[_sha256(frame) for frame in shot] for shot in group["frames"][()]]
        for view, group in file["cameras"].items()
    }


def truth(path: Path) -> Description:
    """True cameras, and the balls of every firing."""
    with h5py.File(path, "r") as file:
        sequences = sorted(map(int, file.get("sprays", {})))
    return {
        "pixels": {view: camera.project(_points()).tolist() for view, camera in read_true_cameras(path).items()},
        "sprays": {str(sequence): _spray(path, sequence) for sequence in sequences},
    }


def calibration(path: Path) -> Description:
    """What a calibration says of itself and its views, and where it sees some points."""
    loaded = load_calibration(path)
    return {
        "id": loaded.id,
        "parent": loaded.parent,
        "created_utc": loaded.created_utc,
        "source": loaded.source,
        "z_range_mm": loaded.z_range_mm,
        "target": loaded.target.model_dump(mode="json") if loaded.target else None,
        "views": {
            name: {
                "verdict": view.verdict,
                "model": view.model,
                "holdout_error_px": view.holdout_error_px,
                "planes_z_mm": [plane.z_mm for plane in view.planes],
                "candidates_px": dict(view.candidates_holdout_error_px),
                "parameters": view.covariance.parameters if view.covariance else None,
                "pixels": view.mapping.project(_points()).tolist(),
            }
            for name, view in loaded.views.items()
        },
    }


def calibration_set(folder: Path) -> Description:
    """Planes of a calibration set, and how many points are found on each."""
    loaded = load_calibration_set(folder)
    return {
        "source": loaded.source,
        "target": loaded.target.model_dump(mode="json") if loaded.target else None,
        "planes": {
            name: [{"z_mm": plane.z_mm, "points": len(plane.image_px)} for plane in view.planes]
            for name, view in loaded.views.items()
        },
    }


def volume(path: Path) -> Description:
    """Grid, origin and contents of a volume."""
    with open_volume(path) as stored:
        voxels = stored[:]
        return {
            "shape": stored.grid.shape,
            "origin_mm": stored.grid.origin_mm,
            "pitch_mm": stored.grid.pitch_mm,
            "provenance": dict(stored.provenance),
            "sum": float(voxels.sum(dtype=np.float64)),
            "max": float(voxels.max()),
        }


def preview(path: Path) -> Description:
    """Grid and contents of a preview."""
    stored = load_preview(path)
    return {
        "shape": stored.grid.shape,
        "origin_mm": stored.grid.origin_mm,
        "pitch_mm": stored.grid.pitch_mm,
        "limit": stored.limit,
        "full_shape": stored.full_shape,
        "sha256": _sha256(stored.voxels),
    }


def droplets(path: Path) -> Description:
    """Columns of a file of droplets, where they come from, and what they say of the spray."""
    stored = read_droplets(path)
    return {
        "columns": {name: _column(column) for name, column in stored.columns.items()},
        "provenance": stored.provenance,
        "statistics": droplet_statistics([stored]).model_dump(mode="json"),
    }


def job_table(path: Path) -> list[Description]:
    """All jobs, the oldest first."""
    table = JobTable(path)
    try:
        return [job.model_dump(mode="json") for job in reversed(table.newest(limit=-1))]
    finally:
        table.close()


def data_folder(folder: Path) -> Description:
    """What the server lists of its data folder: runs, results and calibrations."""
    runs, calibrations = RunStore(folder, RunStatus), CalibrationStore(folder / "calibrations")
    return {
        "runs": {listed.run_id: listed.model_dump(mode="json") for listed in runs.newest()},
        "results": {run_dir.name: _results(run_dir) for run_dir in list_runs(folder)},
        "calibrations": sorted(listed.id for listed in calibrations.list()),
        "current_calibration": calibrations.current,
    }


DESCRIPTIONS: Mapping[str, tuple[tuple[str, ...], Callable[[Path], Any]]] = {
    "run": (("runs/[0-9]*", "imported/run"), run),
    "packed run": (("packed/*.h5",), packed_run),
    "truth": (("runs/*/truth/truth.h5",), truth),
    "calibration": (("runs/calibrations/*.json",), calibration),
    "calibration set": (("imported/calibration", "runs/*-target"), calibration_set),
    "volume": (("runs/*/results/*/*.vtkhdf", "*.vtkhdf"), volume),
    "preview": (("runs/*/results/*/*.preview.npz",), preview),
    "droplets": (("droplets/**/*_droplets.h5",), droplets),
    "job table": (("runs/jobs.sqlite",), job_table),
    "data folder": (("runs",), data_folder),
}
"""Where files of a kind lie, and who reads them; ids of runs begin with their time."""


def describe(folder: Path) -> Description:
    """All files of a version: kind -> path -> what it says."""
    return {kind: describe_kind(folder, kind) for kind in DESCRIPTIONS}


def describe_kind(folder: Path, kind: str) -> Description:
    """All files of a kind: path -> what it says, as JSON returns it."""
    described: Description = json.loads(json.dumps(dict(_described(folder, *DESCRIPTIONS[kind]))))
    return described


def copy_to_read(version: Path, out: Path) -> Path:
    """A copy of the files of a version: some readers write."""
    return shutil.copytree(version, out / version.name)


def _described(folder: Path, places: tuple[str, ...], read: Callable[[Path], Any]) -> Iterator[tuple[str, Any]]:
    for path in sorted(path for place in places for path in folder.glob(place)):
        yield path.relative_to(folder).as_posix(), read(path)


def _results(run_dir: Path) -> Description:
    return {found.id: found.model_dump(mode="json") for found in result_sets(run_dir)}


def _column(column: NDArray[Any]) -> Description:
    known = column if column.dtype.kind == "U" else column[~np.isnan(column)]
    return {"rows": len(column), "known": len(known), "first": known[:1].tolist(), "last": known[-1:].tolist()}


def _shot(shot: Shot) -> Description:
    return {
        "image_key": int(shot.image_key),
        "valid": shot.valid,
        "host_time_ns": shot.host_time_ns,
        "stage_z_mm": shot.stage_z_mm,
        "fired": _fired(shot.fired) if shot.fired else None,
        "views": {view: _exposures(double_frame) for view, double_frame in shot.views.items()},
    }


def _fired(train: FiredTrain) -> Description:
    pulses = {view: [asdict(pulse) for pulse in pulses] for view, pulses in train.pulses.items()}
    return {"sequence": train.sequence, "camera_trigger_ns": dict(train.camera_trigger_ns), "pulses": pulses}


def _exposures(double_frame: DoubleFrame) -> Description:
    frames = [frame for frame in (double_frame.frame_a, double_frame.frame_b) if frame is not None]
    records = [asdict(record) for record in (double_frame.record_a, double_frame.record_b)]
    return {"records": records[: len(frames)], "sha256": [_sha256(frame) for frame in frames]}


def _spray(path: Path, sequence: int) -> Description:
    fired = read_true_spray(path, sequence)
    diameters_mm = fired.spray.diameters_mm
    return {"time_ns": fired.time_ns, "balls": len(diameters_mm), "sum_of_diameters_mm": float(diameters_mm.sum())}


def _points() -> NDArray[np.float64]:
    return np.array(POINTS_MM)


def _means(stack: NDArray[np.float32] | None) -> list[float] | None:
    return None if stack is None else stack.mean(axis=(1, 2), dtype=np.float64).tolist()


def _sha256(array: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


if __name__ == "__main__":
    (version,) = map(Path, sys.argv[1:])
    with tempfile.TemporaryDirectory() as out, (version / EXPECTED).open("x") as file:
        file.write(json.dumps(describe(copy_to_read(version, Path(out))), indent=1) + "\n")
