"""What the droplets of a run say together against it, where each shot may look right, and what nothing checks."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from daq.files.run_directory import RunReader
from processing.analysis.copied_shots import copies_told
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.even_rows import row_spacing_mm
from processing.analysis.few_together import few_together, found_from
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.near_or_far import CLOSE_PX, depth_doubts, depth_known, depth_reversed, sights_of
from processing.analysis.stored_json import stored_json
from processing.calibration.calibration import Calibration
from processing.calibration.sets.recorded_set import nominal_scales
from processing.calibration.verdict import Unchecked
from processing.reconstruction.settings import FrozenValue, GridSettings
from processing.runs.shots.turned_views import reversed_shows_px
from processing.runs.sprays.conditions import changes_told
from processing.runs.unchecked_images import below, even_rows, unchecked_images, unknown_height, unlike_motions


class ToldTogether(FrozenValue):
    """What casts doubt on all shots of a run together, and what nothing checks."""

    conditions_changed: Annotated[
        tuple[str, ...], Field(description="what of notes, nozzle and axis was changed after the run: by whom and when")
    ] = ()
    copies: Annotated[tuple[str, ...], Field(description="shots that are the same images")] = ()
    same_droplets: Annotated[tuple[str, ...], Field(description="shots that show the same droplets, not new ones")] = ()
    depth: Annotated[tuple[str, ...], Field(description="whether near and far are exchanged")] = ()
    few_together: Annotated[
        tuple[str, ...], Field(description="what shots with few droplets each are doubted for together")
    ] = ()
    not_checked: Annotated[
        tuple[Unchecked, ...], Field(description="what may be wrong without showing, and what to state")
    ] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """All that casts doubt, a sentence each."""
        return (*self.conditions_changed, *self.copies, *self.same_droplets, *self.depth, *self.few_together)


def told_together(
    run: RunReader, calibration: Calibration | None, stored: Sequence[StoredDroplets], files: Sequence[Path]
) -> ToldTogether:
    """Ask measured shots of a run.

    Parameters
    ----------
    run : RunReader
        That they are of.
    calibration : Calibration | None
        By which they were measured; None where it is not there any more.
    stored : sequence of StoredDroplets
        One shot or more, measured with the same settings.
    files : sequence of Path
        Where each lies.
    """
    return ToldTogether(
        conditions_changed=changes_told(stored, files),
        copies=copies_told(stored),
        same_droplets=lingering_told(stored),
        depth=depth_doubts(stored),
        few_together=few_together(stored),
        not_checked=tuple(_unchecked(run, calibration, stored)),
    )


def _unchecked(
    run: RunReader, calibration: Calibration | None, stored: Sequence[StoredDroplets]
) -> Iterator[Unchecked]:
    settings, velocities = stored_json(stored[0].provenance, "settings"), _velocities(stored)
    polarity, sizes = settings.get("polarity", run.header.polarity), bool(settings.get("sizes"))
    sights = sights_of(stored)
    yield from unchecked_images(
        polarity,
        sizes_known=sizes,
        undirected=run.header.frames_per_shot == 2 and run.conditions.spray is None,
        stated_ns=next((one["separation_ns"] for one in velocities if one["separation_source"] == "stated"), None),
        unscaled=not nominal_scales(run.header.configuration) and not sizes,
        shallow=_is_shallow(calibration, stored[0]),
        sparse=not depth_known(sights) and not depth_reversed(sights),
    )
    yield from below(polarity, [found_from(shot) for shot in stored])
    yield from even_rows(row_spacing_mm(stored)) if any(one["pairs"] for one in velocities) else ()
    yield from unlike_motions([share for one in velocities if (share := _share_alone(one)) is not None])
    yield unknown_height(run.header)


def _velocities(stored: Sequence[StoredDroplets]) -> list[dict[str, Any]]:
    """Of double exposures whose separation is known; where it is not, a file keeps the reason alone."""
    kept = (stored_json(shot.provenance, "velocity") for shot in stored)
    return [one for one in kept if "verdict" in one]


def _share_alone(velocity: dict[str, Any]) -> float | None:
    """Share of the droplets without a partner, of velocities that are good."""
    share = velocity.get("share_alone") if velocity["verdict"] == "good" else None
    return None if share is None else float(share)


def _is_shallow(calibration: Calibration | None, shot: StoredDroplets) -> bool:
    """Whether near and far look alike in the box of a shot; of lines of sight that nobody knows nothing is excluded."""
    if calibration is None or "grid" not in shot.provenance:
        return True
    grid = GridSettings.model_validate_json(str(shot.provenance["grid"])).to_grid()
    return reversed_shows_px(calibration, grid) < CLOSE_PX
