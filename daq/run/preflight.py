"""What is checked and written down before a run starts, so that it is refused with a reason instead of failing."""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from daq.counted import counted
from daq.devices import Rig
from daq.errors import DaqError, PlanError
from daq.files.run_directory import RunHeader, ViewFormat
from daq.files.storage import folder_number
from daq.run import light
from daq.run.references import find_references
from daq.run.refusals import RefusalCode, raise_first, refused, refusing
from daq.run_plan import RunKind, RunPlan
from daq.timing import ShotTiming, plan_shot_timing

FRAMES_PER_SHOT = 2
"""Of a recorded shot, in every view: exposures A and B."""
_REFERENCE_ITEM_BYTES = 4
_SOFTWARE = ("tomoshadow", "numpy", "h5py", "isal", "pydantic")


@dataclass(frozen=True)
class PreparedRun:
    """A plan that was found to be possible.

    Parameters
    ----------
    run_dir : Path
        Where it will be stored.
    header : RunHeader
        What the run is, but for its devices.
    timing : ShotTiming
        Edges of every shot; currents are 0 in a dark run.
    references : Mapping[RunKind, tuple[Path, ...]]
        Dark and background runs that belong to it.
    """

    run_dir: Path
    header: RunHeader
    timing: ShotTiming
    references: Mapping[RunKind, tuple[Path, ...]]


@dataclass(frozen=True)
class Preflight:
    """What decides whether a run may start.

    Parameters
    ----------
    rig : Rig
        Open devices.
    data_dir : Path
        Where run directories are made.
    configuration : Mapping[str, Any]
        The resolved configuration of the rig, which every run keeps.
    hash_calibration : Callable[[str], str | None]
        SHA-256 of a calibration by its id.
    disk_margin_bytes : int
        What a run leaves free on the disk.
    folder : tuple[int, int] | None
        Number of the folder when the program started; None if that does not matter.
    """

    rig: Rig
    data_dir: Path
    configuration: Mapping[str, Any]
    hash_calibration: Callable[[str], str | None]
    disk_margin_bytes: int
    folder: tuple[int, int] | None = None

    def refusals_of_rig(self) -> Iterator[DaqError]:
        """Why no run at all can start."""
        yield from refused(RefusalCode.FOLDER_GONE, _check_folder_is_ours, self.data_dir, self.folder)
        yield from refused(RefusalCode.STORAGE, _check_folder, self.data_dir)
        yield from refused(RefusalCode.DISK_FULL, _check_margin, self.data_dir, self.disk_margin_bytes)
        yield from light.obstacles(self.rig)

    def refusals_of_plan(self, plan: RunPlan) -> Iterator[DaqError]:
        """Why this plan cannot run on this rig; no device is asked."""
        yield from self._refusals_of_numbers(plan)
        yield from refused(RefusalCode.REFERENCES, self.references, plan)
        yield from refused(RefusalCode.STORAGE, self.calibration_sha256, plan)

    def prepare(self, plan: RunPlan) -> PreparedRun:
        """Describe a run that nothing speaks against.

        Raises
        ------
        DaqError
            The first refusal; see ``daq.run.refusals``.
        """
        raise_first(self.refusals_of_rig())
        self.data_dir.mkdir(parents=True, exist_ok=True)
        raise_first(self._refusals_of_numbers(plan))
        with refusing(RefusalCode.REFERENCES):
            references = self.references(plan)
        with refusing(RefusalCode.STORAGE):
            calibration_sha256 = self.calibration_sha256(plan)
        header = _header(self.data_dir, plan, self.views, self.configuration, calibration_sha256)
        return PreparedRun(self.data_dir / header.run_id, header, _timing(self.rig, plan), references)

    @property
    def views(self) -> dict[str, ViewFormat]:
        """Frames of every view."""
        return {view: ViewFormat(camera.image_shape, camera.bits) for view, camera in self.rig.cameras.items()}

    def references(self, plan: RunPlan) -> dict[RunKind, tuple[Path, ...]]:
        """Dark and background runs of a plan; PlanError if one of them does not belong to it."""
        return find_references(self.data_dir, plan, self.views, self.configuration)

    def calibration_sha256(self, plan: RunPlan) -> str | None:
        """Hash of the calibration that a plan names; None if it names none."""
        return self.hash_calibration(plan.calibration) if plan.calibration else None

    def _refusals_of_numbers(self, plan: RunPlan) -> Iterator[DaqError]:
        """Why this plan cannot run, whatever its files say; they are read after this, as that takes longer."""
        yield from _refusals_of_light(self.rig, plan)
        yield from refused(RefusalCode.STAGE, _check_stage, self.rig, plan)
        yield from refused(RefusalCode.DISK_FULL, _check_disk, self.data_dir, plan, self.views, self.disk_margin_bytes)
        yield from refused(RefusalCode.NETWORK, _check_network, self.rig, plan, self.views)


def permitted_timing(rig: Rig, plan: RunPlan) -> ShotTiming:
    """Edges of every shot of a plan; PlanError if a camera does not permit them, or an LED its current."""
    raise_first(_refusals_of_light(rig, plan))
    return _timing(rig, plan)


def _refusals_of_light(rig: Rig, plan: RunPlan) -> Iterator[DaqError]:
    """Why the light of a plan is none for this rig."""
    yield from refused(RefusalCode.CURRENT, _check_currents, rig, plan)
    yield from refused(RefusalCode.TIMING, _timing, rig, plan)


def _header(
    data_dir: Path,
    plan: RunPlan,
    views: dict[str, ViewFormat],
    configuration: Mapping[str, Any],
    calibration_sha256: str | None,
) -> RunHeader:
    now = datetime.now(UTC)
    return RunHeader(
        run_id=_new_run_id(data_dir, plan.name, now),
        created_utc=now.isoformat(),
        views=views,
        plan=plan,
        configuration=dict(configuration),
        software=_software_versions(),
        calibration_id=plan.calibration,
        calibration_sha256=calibration_sha256,
        separation_ns=plan.pulse.separation_ns,
        notes=plan.notes,
        spray=plan.spray,
    )


def _timing(rig: Rig, plan: RunPlan) -> ShotTiming:
    pulse = plan.pulse
    if plan.kind is RunKind.DARK:
        pulse = pulse.model_copy(update={"current_a": dict.fromkeys(pulse.current_a, 0.0)})
    cameras = {view: camera.timing for view, camera in rig.cameras.items()}
    return plan_shot_timing(plan.model_copy(update={"pulse": pulse}), cameras)


def _check_currents(rig: Rig, plan: RunPlan) -> None:
    for view, current_a in plan.pulse.current_a.items():
        limit_a = rig.max_current_a.get(view, current_a)
        if current_a > limit_a:
            raise PlanError(f"pulse.current_a: {current_a:g} A is above {limit_a:g} A, the limit of the LED of {view}")


def _check_folder_is_ours(data_dir: Path, folder: tuple[int, int] | None) -> None:
    if folder is not None and folder_number(data_dir) != folder:
        raise PlanError(
            f"{data_dir} is gone, or another folder or disk has taken its place since the server was started: "
            "mount or bring back the right one, or start the server again"
        )


def _check_folder(data_dir: Path) -> None:
    folder = _existing(data_dir)
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise PlanError(f"the run cannot be stored: {folder} is no folder that this program may write to")


def _check_margin(data_dir: Path, margin_bytes: int) -> None:
    free = shutil.disk_usage(_existing(data_dir)).free
    if free < margin_bytes:
        raise PlanError(
            f"the disk of {data_dir} has {free} bytes left, and a run leaves {margin_bytes} bytes free: "
            "delete or move away what is not needed"
        )


def _existing(folder: Path) -> Path:
    """The folder, or where it would be made: looking makes none, or nobody would see that it is gone."""
    return next(one for one in (folder, *folder.absolute().parents) if one.exists())


def _check_stage(rig: Rig, plan: RunPlan) -> None:
    if not plan.stage_z_mm:
        return
    if rig.stage is None:
        raise PlanError("stage_z_mm: the rig has no translation stage")
    lowest_mm, highest_mm = rig.stage.range_mm
    for z_mm in plan.stage_z_mm:
        if not lowest_mm <= z_mm <= highest_mm:
            raise PlanError(f"stage_z_mm: {z_mm:g} mm is outside of {lowest_mm:g} to {highest_mm:g} mm")


def _check_network(rig: Rig, plan: RunPlan, views: Mapping[str, ViewFormat]) -> None:
    """Images that come faster than the wires carry them are lost, or pile up in the cameras."""
    shot_s = rig.network.shot_s({view: FRAMES_PER_SHOT * one.frame_bytes for view, one in views.items()})
    if shot_s > 1 / plan.rate_hz:
        shared = rig.network.shared_gbit_s
        wires = f"the {shared:g} Gbit/s that the cameras share" if shared else f"{rig.network.camera_gbit_s:g} Gbit/s"
        raise PlanError(
            f"rate_hz: {plan.rate_hz:g} shots per second do not pass through {wires}: a shot takes {1e3 * shot_s:.0f} "
            f"ms, so at most {1 / shot_s:.1f} per second ([network] in the rig file)"
        )


def _check_disk(data_dir: Path, plan: RunPlan, views: Mapping[str, ViewFormat], margin_bytes: int) -> None:
    """Compare with the uncompressed size: how well a spray compresses is not known before."""
    shot_bytes = FRAMES_PER_SHOT * sum(view.frame_bytes for view in views.values())
    pixels = sum(view.shape[0] * view.shape[1] for view in views.values())
    reference_bytes = 2 * FRAMES_PER_SHOT * pixels * _REFERENCE_ITEM_BYTES if plan.references else 0
    needed = plan.total_shots * shot_bytes + reference_bytes + margin_bytes
    free = shutil.disk_usage(_existing(data_dir)).free
    if needed > free:
        raise PlanError(
            f"shots: {counted(plan.total_shots, 'shot')} of {shot_bytes} bytes, in all {needed} bytes, do not fit the "
            f"disk of {data_dir}: {free} bytes are free"
        )


def _new_run_id(data_dir: Path, name: str, now: datetime) -> str:
    """Sortable by time, safe as a file name, unique in the data directory."""
    stem = f"{now:%Y%m%dT%H%M%S}-{name.strip().replace(' ', '_')}"
    run_id, number = stem, 1
    while (data_dir / run_id).exists():
        number += 1
        run_id = f"{stem}-{number}"
    return run_id


def _software_versions() -> dict[str, str]:
    versions = {}
    for package in _SOFTWARE:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "not installed as a package"
    return versions
