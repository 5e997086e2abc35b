"""MeasuredSpray: the droplets of some shots that were measured alike, and what their files say of nozzle and axis."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from processing.analysis.copied_shots import in_common
from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets
from processing.analysis.droplets.droplet_statistics import DIAMETER, measured_grid, require_poolable, told_exposures
from processing.analysis.few_together import found_from
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_doubts import NOT_STATED, noted
from processing.analysis.spray.spray_sample import box_told
from processing.analysis.spray.spray_statistics import AskedFor, SprayStatistics, spray_statistics
from processing.analysis.stored_json import stored_json
from processing.count import counted
from processing.runs.droplets_in_place import NO_SPRAY, read_in_place
from processing.runs.not_checked import not_checked
from processing.runs.sprays.conditions import axis_of, changes_told

PATTERN = "shot_*_droplets.h5"
MOST_UNLIKE = 1.25
"""Ratio of the diameters, or amplitudes, from which on droplets are found in two sprays."""
AGAIN = {"spray": "; shots that were measured before nozzle or axis were mended are measured again"}


@dataclass(frozen=True, eq=False)
class MeasuredSpray:
    """Droplets of shots that are pooled.

    Parameters
    ----------
    name : str
        Of their folders.
    shots : tuple of StoredDroplets
        A shot each.
    axis : SprayAxis | None
        As the run says; None where nobody stated it.
    changes : tuple of str
        What of its conditions was changed after it was recorded: by whom, and when.
    """

    name: str
    shots: tuple[StoredDroplets, ...]
    axis: SprayAxis | None
    changes: tuple[str, ...] = ()

    @property
    def provenance(self) -> dict[str, Any]:
        """What the shots have in common."""
        return dict(self.shots[0].provenance)

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(dict.fromkeys(str(shot.provenance.get("run", "")) for shot in self.shots))


def told_spray(spray: MeasuredSpray, asked: AskedFor) -> SprayStatistics:
    """All figures of a spray, and what nothing checks of the images that they come from."""
    told = spray_statistics(spray.shots, asked)
    of_images = not_checked(spray.shots, directed=asked.axis is not None)
    return told.model_copy(update={"not_checked": (*told.not_checked, *of_images)})


def read_spray(folders: Sequence[Path]) -> MeasuredSpray:
    """Read the shots of results of ``measure``; a folder may hold those of several runs in folders of their names.

    Parameters
    ----------
    folders : sequence of Path
        Pooled. Of a run those in its own ``results``, if there is one of droplets.

    Raises
    ------
    DropletFileError
        There are none, or they do not belong together: of two recipes or calibrations, or of sprays whose nozzles are
        at two places. The text names both.
    """
    folders = [measured_in(folder) for folder in folders]
    files = [file for folder in folders for file in _files(folder)]
    return read_files(files, ", ".join(dict.fromkeys(map(_name, folders))))


def read_files(files: Sequence[Path], name: str = "") -> MeasuredSpray:
    """The same of files of droplets, one at least, under a name."""
    shots = tuple(map(read_in_place, files))
    _require_one(shots, files, "calibration")
    require_poolable(shots)
    _require_one(shots, files, "spray")
    return MeasuredSpray(name, shots, axis_of(shots, files), changes_told(shots, files))


def measured_in(folder: Path) -> Path:
    """Where droplets are: in the folder itself, but of a run in its own results.

    Raises
    ------
    DropletFileError
        It is a run of which nothing, or more than one thing, is measured there.
    """
    return _of_run(folder) if (folder / "run.h5").is_file() else folder


def _of_run(run_dir: Path) -> Path:
    found = sorted({file.parent for file in run_dir.glob(f"results/*/{PATTERN}")})
    if not found:
        raise DropletFileError(
            f"{run_dir}: is a run, and its own results have no droplets: name the directory that measure wrote with -o"
        )
    if len(found) > 1:
        raise DropletFileError(f"{run_dir}: was measured in several ways: name one of {', '.join(map(str, found))}")
    return found[0]


def _files(folder: Path) -> list[Path]:
    files = [*sorted(folder.glob(PATTERN)), *sorted(folder.glob(f"*/{PATTERN}"))]
    if not files and any(folder.glob("*_droplets.h5")):
        raise DropletFileError(f"{folder}: {NO_SPRAY}")
    if not files:
        raise DropletFileError(f"{folder}: has no droplets ({PATTERN}): name a directory that measure wrote with -o")
    return files


def _name(folder: Path) -> str:
    """Of a results folder within a run, the run's name too."""
    path = folder.resolve()
    return f"{path.parents[1].name}/{path.name}" if path.parent.name == "results" else path.name


def _require_one(shots: Sequence[StoredDroplets], files: Sequence[Path], what: str) -> None:
    first = shots[0].provenance.get(what)
    for shot, file in zip(shots, files, strict=True):
        if (its := shot.provenance.get(what)) != first:
            raise DropletFileError(
                f"{file}: measured with {what} {its}, {files[0]} with {first}: numbers of two are not pooled; "
                f"take those of one, or --compare them{AGAIN.get(what, '')}"
            )


@dataclass(frozen=True, eq=False)
class ComparedSprays:
    """Sprays that are set beside each other.

    Parameters
    ----------
    sprays : dict of name to MeasuredSpray
        A folder each.
    unlike : tuple of str
        What was measured differently: a difference of two may be of the measurement; and what is the same shots.
    conditions : tuple of str
        What is not the same of the sprays themselves, as people have noted: what one compares.
    """

    sprays: dict[str, MeasuredSpray]
    unlike: tuple[str, ...]
    conditions: tuple[str, ...] = ()


def read_compared(folders: Sequence[Path]) -> ComparedSprays:
    """Read the results of several sprays, a folder each, measured alike or not.

    Raises
    ------
    DropletFileError
        As of ``read_spray``; or there are fewer than two, or two have one name.
    """
    sprays = [read_spray([folder]) for folder in folders]
    named = {spray.name: spray for spray in sprays}
    if len(named) < max(len(folders), 2):
        raise DropletFileError(
            f"{', '.join(map(str, folders))}: to compare takes two directories at least, of different names"
        )
    unlike = _differing(sprays, _measured, "differ in {}")
    conditions = _differing(sprays, lambda one: noted(one.shots), "are sprays of other conditions: {}")
    of_places = (*_elsewhere(sprays), *_shared(sprays), *_lingering(sprays))
    return ComparedSprays(named, (*unlike, *_found_from(sprays), *of_places), conditions)


def _elsewhere(sprays: Sequence[MeasuredSpray]) -> Iterator[str]:
    stated = [(spray.name, spray.axis) for spray in sprays if spray.axis]
    for other, axis in stated[1:]:
        first, its = stated[0]
        if axis != its:
            places = " and ".join(f"{one.nozzle_mm} mm along {one.direction}" for one in (axis, its))
            yield f"{other} and {first} differ in nozzle and axis: {places}"


def _found_from(sprays: Sequence[MeasuredSpray]) -> Iterator[str]:
    """Where smaller droplets are found in one than in another, as noise and blur differ: means differ by it, too."""
    (first, its), *others = ((spray.name, _complete_from(spray.shots)) for spray in sprays)
    for other, least in others:
        if max(least, its) > MOST_UNLIKE * min(least, its) > 0:
            unit = "um" if DIAMETER in sprays[0].shots[0].columns else "of full scale"
            yield (
                f"{other} and {first} differ in the smallest droplets that are found: {least:.3g} and {its:.3g} "
                f"{unit}; smaller ones are missing in numbers and means"
            )


def _complete_from(shots: Sequence[StoredDroplets]) -> float:
    """Diameter, or amplitude, from which on droplets are found, in the middle of the shots; 0: files do not say."""
    return float(np.median([found_from(shot) for shot in shots]))


def _shared(sprays: Sequence[MeasuredSpray]) -> Iterator[str]:
    for first, other in combinations(sprays, 2):
        if shared := in_common(other.shots, first.shots):
            yield (
                f"{other.name} and {first.name} have {counted(shared, 'shot')} in common: they are no two samples, and "
                "chance makes less of a difference than is told"
            )


def _lingering(sprays: Sequence[MeasuredSpray]) -> Iterator[str]:
    for spray in sprays:
        yield from (f"{spray.name}: {told}" for told in lingering_told(spray.shots))


def _differing(
    sprays: Sequence[MeasuredSpray], said_of: Callable[[MeasuredSpray], Mapping[str, object]], text: str
) -> tuple[str, ...]:
    """In what each of the others differs from the first."""
    first, *others = ((spray.name, said_of(spray)) for spray in sprays)
    told = ((name, _differences(its, first[1])) for name, its in others)
    return tuple(f"{name} and {first[0]} {text.format(what)}" for name, what in told if what)


def _differences(its: Mapping[str, object], others: Mapping[str, object]) -> str:
    return "; ".join(
        f"{name}: {its.get(name, NOT_STATED)} and {others.get(name, NOT_STATED)}"
        for name in {**its, **others}
        if its.get(name) != others.get(name)
    )


def _measured(spray: MeasuredSpray) -> dict[str, object]:
    """How it was measured."""
    shots = spray.shots
    return {**_made_by(spray.provenance), **_separation(shots), **_box(shots), **_light(shots)}


def _made_by(provenance: Mapping[str, Any]) -> dict[str, object]:
    """What a measurement depends on."""
    names = ("calibration", "method_version")
    settings = stored_json(provenance, "settings")
    settings.pop("grid", None)  # told as the box, wherever it comes from
    return {**{name: provenance.get(name) for name in names}, **settings}


def _separation(shots: Sequence[StoredDroplets]) -> dict[str, object]:
    """How far apart their exposures are, and who says so."""
    velocities = [stored_json(shot.provenance, "velocity") for shot in shots]
    known = [(one["separation_ns"] / 1000, one["separation_source"]) for one in velocities if "separation_ns" in one]
    apart = dict.fromkeys(f"{us:.4g} us as {source}" for us, source in known)
    return {"separation": " and ".join(apart)} if apart else {}


def _light(shots: Sequence[StoredDroplets]) -> dict[str, object]:
    """In which light their shadows are read: in another one diameters differ, and shots do not scatter by it."""
    views = [view for shot in shots for one in told_exposures(shot) for view in one.get("views", {}).values()]
    ratios = [float(view["condenser_ratio"] or 0) for view in views if "condenser_ratio" in view]
    if not ratios:
        return {}
    middle = float(np.median(ratios))
    return {"light": f"{middle:.2g} apertures of the lens" if middle else "a Gaussian blur"}


def _box(shots: Sequence[StoredDroplets]) -> dict[str, object]:
    """In which box they were measured: densities and flux are means over it."""
    grids = dict.fromkeys(measured_grid(shot) for shot in shots)
    return {"box": " and ".join("nobody knows which" if grid is None else box_told(grid) for grid in grids)}
