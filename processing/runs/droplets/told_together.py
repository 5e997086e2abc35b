"""What the droplets of a run say together against it, where each shot may look right, and what nothing checks."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field

from processing.analysis.copied_shots import copies_told
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.few_together import few_together
from processing.analysis.lingering_droplets import lingering_told
from processing.analysis.near_or_far import depth_doubts
from processing.calibration.verdict import Unchecked
from processing.reconstruction.settings import FrozenValue
from processing.runs.not_checked import not_checked
from processing.runs.sprays.conditions import ConditionsChanged, axis_of, changes_told


class ToldTogether(FrozenValue):
    """What casts doubt on all shots of a run together, and what nothing checks."""

    conditions_changed: ConditionsChanged = ()
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


def told_together(stored: Sequence[StoredDroplets], files: Sequence[Path]) -> ToldTogether:
    """Ask measured shots of a run.

    Parameters
    ----------
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
        not_checked=not_checked(stored, directed=axis_of(stored, files) is not None),
    )
