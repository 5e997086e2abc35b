"""What nothing checks of shots that are measured: their files tell it, wherever these lie, and no image is opened."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any

from pydantic import Field

from daq.files.run_directory import RunHeader
from processing.analysis.droplets.droplet_file import DIAMETER, StoredDroplets
from processing.analysis.even_rows import row_spacing_mm
from processing.analysis.few_together import found_from
from processing.analysis.near_or_far import CLOSE_PX, depth_known, depth_reversed, sights_of
from processing.analysis.stored_json import stored_json
from processing.calibration.calibration import Calibration
from processing.calibration.sets.recorded_set import nominal_scales
from processing.calibration.verdict import Unchecked
from processing.preprocessing import Polarity
from processing.reconstruction.settings import FrozenValue
from processing.runs.shots.turned_views import reversed_shows_px
from processing.runs.unchecked_images import (
    CROPPED,
    MOVED,
    below,
    even_rows,
    unchecked_images,
    unknown_height,
    unlike_motions,
)
from processing.volume import VoxelGrid

KNOWN = "images_known"
"""Under this name a file of droplets keeps what was known of its images."""
HEIGHT = {True: (MOVED,), False: (CROPPED,), None: (CROPPED, MOVED)}
"""What nothing tells of how high all views look, where images are whole, cut, or nobody knows."""


class KnownImages(FrozenValue):
    """What run and calibration tell of the images of a shot; of files that do not say it, nothing is known."""

    lengths: Annotated[bool, Field(description="the run has magnification and pixels")] = False
    depth: Annotated[bool, Field(description="near and far look unlike in the box")] = False
    whole: Annotated[bool | None, Field(description="images are as a rig's cameras read them; null: nobody says")] = (
        None
    )

    @classmethod
    def of(cls, header: RunHeader, calibration: Calibration, grid: VoxelGrid) -> "KnownImages":
        """Ask a run, and the calibration by which its droplets are measured in a grid."""
        return cls(
            lengths=bool(nominal_scales(header.configuration)),
            depth=reversed_shows_px(calibration, grid) >= CLOSE_PX,
            whole=unknown_height(header) is MOVED,
        )


def not_checked(shots: Sequence[StoredDroplets], *, directed: bool) -> tuple[Unchecked, ...]:
    """What may be wrong with shots without showing in their droplets, each once.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        One or more, measured with the same settings; of several runs, too.
    directed : bool
        Somebody said where the liquid comes from.
    """
    return tuple(dict.fromkeys(_unchecked(shots, directed)))


def _unchecked(shots: Sequence[StoredDroplets], directed: bool) -> Iterator[Unchecked]:
    known = [KnownImages(**stored_json(shot.provenance, KNOWN)) for shot in shots]
    polarity, velocities, sights = _polarity(shots[0]), _velocities(shots), sights_of(shots)
    sizes_known = bool(stored_json(shots[0].provenance, "settings").get("sizes"))
    yield from unchecked_images(
        polarity,
        sizes_known=sizes_known,
        undirected=not directed and any(map(_is_double, shots)),
        stated_ns=_stated_ns(velocities),
        unscaled=not all(one.lengths for one in known),
        shallow=not all(one.depth for one in known),
        sparse=not depth_known(sights) and not depth_reversed(sights),
    )
    yield from below(polarity, [found_from(shot) for shot in shots])
    yield from even_rows(row_spacing_mm(shots)) if any(one["pairs"] for one in velocities) else ()
    yield from unlike_motions([share for one in velocities if (share := _share_alone(one)) is not None])
    for one in known:
        yield from HEIGHT[one.whole]


def _polarity(shot: StoredDroplets) -> Polarity:
    told: Polarity | None = stored_json(shot.provenance, "settings").get("polarity")
    return told or ("shadow" if DIAMETER in shot.columns else "bright")


def _is_double(shot: StoredDroplets) -> bool:
    return len(shot.exposures) > 1


def _velocities(shots: Sequence[StoredDroplets]) -> list[dict[str, Any]]:
    """Of double exposures whose separation is known; where it is not, a file keeps the reason alone."""
    kept = (stored_json(shot.provenance, "velocity") for shot in shots)
    return [one for one in kept if "verdict" in one]


def _stated_ns(velocities: Iterable[dict[str, Any]]) -> Iterable[float]:
    return dict.fromkeys(one["separation_ns"] for one in velocities if one["separation_source"] == "stated")


def _share_alone(velocity: dict[str, Any]) -> float | None:
    """Share of the droplets without a partner, of velocities that are good."""
    share = velocity.get("share_alone") if velocity["verdict"] == "good" else None
    return None if share is None else float(share)
