"""Liquid that is no droplet, in recorded shots of shadows: looked for in all that the views see in common."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field

from daq.files.run_directory import RunReader, Shot
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_table import Droplets, SizedDroplets
from processing.analysis.objects.break_up import Nozzle, Reach
from processing.analysis.objects.connected_share import break_up_of
from processing.analysis.objects.liquid_objects import LiquidObjects, ObjectClass
from processing.analysis.objects.object_search import ObjectSearch, measure_objects, plan_objects
from processing.analysis.objects.object_sizes import MedianSizes, median_sizes
from processing.analysis.objects.object_velocities import MovingObjects, object_velocities
from processing.analysis.objects.told_droplets import without_told
from processing.calibration.calibration import Calibration
from processing.kernels import DEFAULT_THREADS
from processing.preprocessing import Intensity
from processing.reconstruction.errors import ReconstructionError
from processing.reconstruction.planning.calibrated_plan import default_grid
from processing.reconstruction.settings import FrozenValue
from processing.runs.measured_images import shadow_images, without_ignored
from processing.runs.results_file import FrameName
from processing.runs.shots.separation import separation_of
from processing.runs.workbench import References
from processing.volume import VoxelGrid


def place_and_axis(numbers: tuple[float, ...]) -> tuple[float, ...]:
    """Numbers that say where a nozzle is; ValueError if they do not."""
    if len(numbers) not in (3, 6) or not np.isfinite(numbers).all() or (len(numbers) == 6 and not any(numbers[3:])):
        raise ValueError(
            "x, y, z of the orifice in mm, and if the spray does not go along y, three numbers of its axis"
        )
    return numbers


NozzleNumbers = Annotated[tuple[float, ...], AfterValidator(place_and_axis)]
"""x, y, z of the orifice in mm, and of the direction of the spray."""


@dataclass(frozen=True, eq=False)
class RunObjects:
    """What the shots of a run share when objects are looked for.

    Parameters
    ----------
    run : RunReader
        The recorded run, of shadows.
    references : References
        Of the run.
    ignored : tuple of IgnoredPixels
        That are not asked.
    search : ObjectSearch | None
        Where objects are looked for; None for bright particles.
    """

    run: RunReader
    references: References
    ignored: tuple[str, ...]
    search: ObjectSearch | None

    @classmethod
    def of(
        cls,
        run: RunReader,
        calibration: Calibration,
        references: References,
        box: VoxelGrid,
        nozzle: NozzleNumbers | None,
        ignored: tuple[str, ...],
    ) -> "RunObjects":
        """Plan the search. A box is searched where views see no volume in common."""
        if run.header.polarity != "shadow":
            return cls(run, references, ignored, None)
        try:
            grid = default_grid(calibration)
        except ReconstructionError:
            grid = box
        mappings = [calibration.views[view].mapping for view in run.header.views]
        return cls(run, references, ignored, plan_objects(mappings, grid, nozzle_of(run, nozzle)))

    def measure(
        self, shot: Shot, droplets: Mapping[FrameName, Droplets | SizedDroplets], threads: int = DEFAULT_THREADS
    ) -> dict[FrameName, MovingObjects]:
        """Objects of exposures but those that droplets of theirs explain, with velocities where both are there.

        There are none of bright particles.
        """
        search = self.search
        if search is None:
            return {}
        seen = {frame: self._seen(shot, frame) for frame in droplets}
        found = {
            frame: measure_objects(images, search, trust=trust, threads=threads)
            for frame, (images, trust) in seen.items()
        }
        sized = {frame: told for frame, told in droplets.items() if isinstance(told, SizedDroplets)}
        found |= {frame: without_told(found[frame], told, search) for frame, told in sized.items()}
        light = {frame: [_known(*one) for one in zip(*both, strict=True)] for frame, both in seen.items()}
        separation = separation_of(self.run, shot)
        if isinstance(separation, str) or len(found) != len(BOTH):
            return {frame: MovingObjects(one) for frame, one in found.items()}
        moving = {}
        for frame, other, later_ns in ((*BOTH, separation.mean_ns), (*BOTH[::-1], -separation.mean_ns)):
            velocities = object_velocities(found[frame], light[frame], light[other], search.mappings, later_ns)
            moving[frame] = MovingObjects(found[frame], velocities)
        return moving

    def _seen(self, shot: Shot, frame: FrameName) -> tuple[Sequence[Intensity], list[Intensity]]:
        """Transmissions, and which pixels are known."""
        images, trust = shadow_images(self.run, shot, frame, self.references)
        return images, list(without_ignored(dict(zip(shot.views, trust, strict=True)), self.ignored).values())


def _known(image: Intensity, trust: Intensity) -> Intensity:
    """The same, light where nothing is known: what is light in both exposures does not move."""
    return np.where(trust > 0, image, np.float32(1))


def nozzle_of(run: RunReader, stated: NozzleNumbers | None) -> Nozzle | None:
    """The nozzle that is stated, else that of the run."""
    if stated is not None:
        x_mm, y_mm, z_mm, *axis = stated
        return Nozzle((x_mm, y_mm, z_mm), (axis[0], axis[1], axis[2])) if axis else Nozzle((x_mm, y_mm, z_mm))
    spray = run.conditions.spray
    return Nozzle(spray.nozzle_mm, spray.axis) if spray else None


def told_objects(moving: MovingObjects | None) -> dict[str, Any]:
    """What a file says of one exposure, beside the table; nothing where nobody looked."""
    if moving is None:
        return {}
    found = moving.found
    told = {
        **{f"{kind.value}s": found.objects.count(kind) for kind in COUNTED},
        "reason": found.reason,
        "blind_share": found.blind_share,
        "unjudged_share": found.unjudged_share,
        "reach": asdict(found.reach),
        "unseen": found.unseen.told(),
    }
    return {"objects": told}


BOTH: tuple[FrameName, FrameName] = ("a", "b")
COUNTED = (ObjectClass.LIGAMENT, ObjectClass.SHEET, ObjectClass.CLUSTER)


class BreakUpLength(FrozenValue):
    """Along the axis of the spray, in mm, and where it lies with 95 % confidence."""

    value: Annotated[float, Field(description="half of the shots still hang together with the nozzle there")]
    low: Annotated[float, Field(description="it is not below this, with 97.5 %, at whichever threshold")]
    high: Annotated[float | None, Field(description="nor above this; null: it lies beyond what all views see")]


class LiquidSummary(FrozenValue):
    """Objects of all exposures, and the break-up length."""

    ligaments: Annotated[int, Field(description="in all exposures")] = 0
    sheets: Annotated[int, Field(description="in all exposures")] = 0
    clusters: Annotated[int, Field(description="in all exposures; neither of both, or several that touch")] = 0
    ligament_medians: Annotated[MedianSizes | None, Field(description="of all ligaments; null of fewer than five")] = (
        None
    )
    break_up_mm: Annotated[BreakUpLength | None, Field(description="how far liquid hangs together")] = None
    break_up_longer_than_mm: Annotated[
        float | None, Field(description="where more than half leave the field before they end")
    ] = None
    break_up_shots: Annotated[int, Field(description="of which it is known")] = 0
    break_up_reason: Annotated[str | None, Field(description="why there is none, or why not of some shots")] = None


NO_OBJECTS = "nobody looked for it: bright particles, or a file of an older program"
NOT_MEASURED = {
    "empty": "exposures are empty: no view sees any liquid",
    "refused": "exposures are refused",
}
"""Why there is no length, by the verdicts of all exposures."""


def liquid_summary(shots: Sequence[StoredDroplets]) -> LiquidSummary:
    """Objects of some shots by their files; the break-up length is of the first exposure of each."""
    exposures = sum(len(told_of_exposures(shot)) for shot in shots)
    return summary_of(objects_of(shots), exposures, reaches_of(shots), _why_none(shots))


def objects_of(shots: Sequence[StoredDroplets]) -> list[LiquidObjects]:
    """Objects of all exposures of each shot in which anybody looked for them."""
    return [LiquidObjects.of(shot.objects) for shot in shots if told_of_exposures(shot)]


def _why_none(shots: Sequence[StoredDroplets]) -> str:
    """Why nothing is told of liquid that is no droplet, where nothing is."""
    exposures = [one for shot in shots for one in shot.exposures.values()]
    verdicts = {str(one.get("verdict")) for one in exposures if "objects" not in one}
    told = [text for verdict, text in NOT_MEASURED.items() if verdict in verdicts]
    return " or ".join(told) if told and verdicts <= NOT_MEASURED.keys() else NO_OBJECTS


def summary_of(
    by_shot: Sequence[LiquidObjects], exposures: int, reaches: Sequence[Reach], why_none: str = NO_OBJECTS
) -> LiquidSummary:
    """Objects of some shots by their classes, in so many exposures, and the break-up length of one exposure each."""
    counts = {f"{kind}s": sum(one.count(kind) for one in by_shot) for kind in COUNTED}
    medians = median_sizes(by_shot, ObjectClass.LIGAMENT, exposures)
    counted = LiquidSummary.model_validate({**counts, "ligament_medians": medians})
    if not reaches:
        return counted.model_copy(update={"break_up_reason": why_none})
    found = break_up_of(reaches)
    value = None
    if found.value_mm is not None and found.low_mm is not None:
        value = BreakUpLength(value=found.value_mm, low=found.low_mm, high=found.high_mm)
    length = {
        "break_up_mm": value,
        "break_up_longer_than_mm": found.longer_than_mm,
        "break_up_shots": found.shots,
        "break_up_reason": found.reason,
    }
    return counted.model_copy(update=length)


def reaches_of(shots: Sequence[StoredDroplets]) -> list[Reach]:
    """How far liquid hangs together in the first exposure of each shot of which the file says it."""
    told = map(told_of_exposures, shots)
    return [Reach(**{name: _frozen(value) for name, value in shot[0]["reach"].items()}) for shot in told if shot]


def told_of_exposures(shot: StoredDroplets) -> list[Mapping[str, Any]]:
    """What the file of a shot says of liquid that is no droplet, exposure by exposure."""
    exposures = shot.exposures.values()
    return [exposure["objects"] for exposure in exposures if exposure.get("objects")]


def _frozen(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
