"""Dark and background runs that belong to a run: found by id, checked, averaged."""

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.errors import PlanError, ShotFileError
from daq.files.run_directory import ReferenceImages, RunReader, ViewFormat, list_runs
from daq.run.state import RunOutcome
from daq.run_plan import PulsePair, RunKind, RunPlan

_EXPOSURES = ("exposure_a_ns", "exposure_b_ns")
REFERENCE_KINDS = (RunKind.DARK, RunKind.BACKGROUND)


def find_references(
    data_dir: Path, plan: RunPlan, views: Mapping[str, ViewFormat], configuration: Mapping[str, Any]
) -> dict[RunKind, tuple[Path, ...]]:
    """Directories of the reference runs of a plan, by kind.

    Raises
    ------
    PlanError
        A run does not exist, is neither dark nor background, was not completed, has no valid shot, other views or
        formats, cameras that were told otherwise, or is a background that was lit otherwise; the text names the
        difference.
    """
    known = {path.name: path for path in list_runs(data_dir)}
    found: dict[RunKind, tuple[Path, ...]] = dict.fromkeys(REFERENCE_KINDS, ())
    for run_id in plan.references:
        if run_id not in known:
            raise PlanError(f"references: no run {run_id!r} in {data_dir}")
        reader = RunReader(known[run_id])
        kind = _checked_kind(run_id, reader, views, plan.pulse)
        if differing := told_otherwise(reader.header.configuration, configuration):
            raise PlanError(f"references: for {run_id!r} cameras were told otherwise than they are now: {differing}")
        found[kind] = (*found[kind], known[run_id])
    return found


def mean_images(run_dirs: tuple[Path, ...]) -> ReferenceImages:
    """Mean of all valid shots of some runs, by view, (frame, row, column) float32 in counts; summed in float64."""
    sums: dict[str, NDArray[np.float64]] = {}
    count = 0
    for run_dir in run_dirs:
        reader = RunReader(run_dir)
        for index in range(reader.shot_count):
            shot = reader.read_shot(index)
            if not shot.valid:
                continue
            count += 1
            for view, double_frame in shot.views.items():
                frames = [frame for frame in (double_frame.frame_a, double_frame.frame_b) if frame is not None]
                total = sums.setdefault(view, np.zeros((len(frames), *frames[0].shape)))
                for number, frame in enumerate(frames):
                    total[number] += frame
    return {view: (total / count).astype(np.float32) for view, total in sums.items()}


def exchanged_cameras(run_dirs: Iterable[Path], devices: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """By view, which camera took a reference and which other one is there now: its pixels are others.

    Parameters
    ----------
    run_dirs : iterable of Path
        The reference runs.
    devices : Mapping[str, Mapping[str, str]]
        Who the devices of the rig are; of one that did not answer nothing is known.
    """
    exchanged = {}
    for run_dir in run_dirs:
        reference = RunReader(run_dir).header
        for view in reference.views:
            was, this = (_camera(told.get(view, {})) for told in (reference.devices, devices))
            if was and this and was != this:
                exchanged[view] = f"{run_dir.name} was recorded by {was}, and this is {this}"
    return exchanged


def _camera(identity: Mapping[str, str]) -> str:
    return " ".join(identity.get(name, "") for name in ("vendor", "model", "serial")).strip()


def told_otherwise(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """What cameras are told in one configuration and not in the other, but for the order; empty where nothing is."""
    differing = []
    for view in now.get("camera_profiles", {}):
        before, after = _settings(then, view), _settings(now, view)
        if before and after:
            differing += [f"{view} {name} = {value} then" for name, value in before - after]
            differing += [f"{view} {name} = {value} now" for name, value in after - before]
    return ", ".join(differing)


def _settings(configuration: Mapping[str, Any], view: str) -> Counter[tuple[str, Any]]:
    """What the camera of a view is told, and how long it exposes; empty in runs from before this was kept."""
    profile = configuration.get("camera_profiles", {}).get(view, {})
    told = [(one["feature"], one["value"]) for one in profile.get("features", ())]
    return Counter((*told, *((name, value) for name, value in profile.get("timing", {}).items() if name in _EXPOSURES)))


def _checked_kind(run_id: str, reader: RunReader, views: Mapping[str, ViewFormat], pulse: PulsePair) -> RunKind:
    try:
        header, image_keys, outcome = reader.header, reader.image_keys(), reader.outcome or RunOutcome.INTERRUPTED
    except ShotFileError as error:
        raise PlanError(f"references: {error}") from error
    kind = header.plan.kind if header.plan else None
    if header.plan is None or kind not in REFERENCE_KINDS:
        raise PlanError(f"references: run {run_id!r} is {kind or 'imported'}, not dark or background")
    if header.views != views:
        raise PlanError(f"references: run {run_id!r} has views {_told(header.views)}; the rig has {_told(views)}")
    if kind.image_key not in image_keys:
        raise PlanError(f"references: run {run_id!r} has no valid shot")
    if outcome != RunOutcome.COMPLETED:
        raise PlanError(f"references: run {run_id!r} is {outcome}, not {RunOutcome.COMPLETED}: {reader.cause}")
    if kind is RunKind.BACKGROUND and (differing := _differing(header.plan.pulse, pulse)):
        raise PlanError(f"references: background {run_id!r} has other light than the plan: {differing}")
    return kind


def _told(views: Mapping[str, ViewFormat]) -> str:
    """Views with what their images are; those that are alike together."""
    alike: dict[str, list[str]] = {}
    for name, view in views.items():
        rows, columns = view.shape
        alike.setdefault(f"{columns} x {rows} px, {view.bits} bit", []).append(name)
    return ", ".join(f"{', '.join(names)} ({images})" for images, names in alike.items())


def _differing(its: PulsePair, planned: PulsePair) -> str:
    """How the light in an exposure of a background differs from the planned one.

    Each exposure gets one pulse, so that their separation does not matter. A dark run has no light, whatever it names.
    """
    lights = [
        ("pulse width", "ns", its.width_ns, planned.width_ns),
        *((f"current of {view}", "A", its.current_a.get(view), planned.current_a[view]) for view in planned.current_a),
    ]
    differing = [one for one in lights if one[2] != one[3]]
    return ", ".join(f"{name} {lit} {unit} instead of {wanted} {unit}" for name, unit, lit, wanted in differing)
