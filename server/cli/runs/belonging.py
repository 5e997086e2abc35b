"""Do a run and a calibration belong together? Asked of droplets before volumes that look fine are believed."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.cli.calibrations.check import check_line
from server.cli.output import progress

if TYPE_CHECKING:
    from processing.calibration.calibration import Calibration
    from processing.calibration.verdict import Unchecked
    from processing.runs.shots.shot_check import ShotCheck
    from processing.runs.stored_exposures import StoredExposure
    from processing.runs.workbench import Workbench

MOST_SELDOM = 10
"""Shots in which lines of sight meet seldom that are asked; a check takes as long as a volume."""


@dataclass(frozen=True)
class Belonging:
    """What the droplets of the first, the middle and the last shot say of the calibration, and of those that stand out.

    Parameters
    ----------
    run : str
        Name of the run.
    checks : tuple of ShotCheck
        A shot each.
    unchecked : tuple of Unchecked
        What droplets cannot tell.
    not_asked : tuple of int
        Shots that stand out as well, and were not asked.
    """

    run: str
    checks: "tuple[ShotCheck, ...]"
    unchecked: "tuple[Unchecked, ...]" = ()
    not_asked: tuple[int, ...] = ()

    @property
    def verdict(self) -> str | None:
        """The worst of those that tell; None where none does."""
        from processing.calibration.verdict import Verdict

        told = [check.verdict for check in self.checks if check.verdict]
        return max(told, key=list(Verdict).index).value if told else None

    @property
    def passed(self) -> bool:
        """Whether volumes are worth having, as far as the droplets tell."""
        return self.verdict != "refuse"

    def record(self) -> dict[str, Any]:
        """What was found, for a program: JSON values."""
        return {
            "verdict": self.verdict,
            "shots": [check.record() for check in self.checks],
            "not_checked": [asdict(one) for one in self.unchecked],
            "not_asked": list(self.not_asked),
        }

    @property
    def provenance(self) -> dict[str, str]:
        """The same for what is made of the run all the same: it says so."""
        from processing.calibration.verdict import BELONGING

        return {BELONGING: json.dumps(self.record())}

    @property
    def text(self) -> str:
        """A line for a person, and one for whatever cannot be known."""
        return "\n".join(filter(None, [self._told, self._left, *(one.text for one in self.unchecked)]))

    @property
    def _told(self) -> str:
        told = [check for check in self.checks if check.verdict]
        if not told:
            return (
                f"NOT CHECKED whether run and calibration belong together: {check_line(self.checks[0])} "
                "(tomoshadow check asks other shots)"
            )
        return "do run and calibration belong together? " + "; ".join(check_line(check) for check in told)

    @property
    def _left(self) -> str:
        if not self.not_asked:
            return ""
        shots = ", ".join(map(str, self.not_asked))
        return (
            f"NOT CHECKED though lines of sight meet seldom in them, too: shots {shots} (tomoshadow check --shots asks "
            "them)"
        )


def stored_belonging(exposures: "Sequence[StoredExposure]") -> dict[str, Any] | None:
    """The worst record that volumes carry; None where none of them tells anything."""
    from processing.calibration.verdict import BELONGING, Verdict

    records = [one.table(BELONGING) for one in exposures if BELONGING in one.provenance]
    told = [record for record in records if record.get("verdict")]
    return max(told, key=lambda record: list(Verdict).index(record["verdict"]), default=None)


def ask_droplets(
    run_dir: Path, shots: Sequence[int], calibration: "Calibration", workbench: "Workbench | None" = None
) -> Belonging:
    """Check the first, the middle and the last shot; what speaks against the calibration is told at once."""
    from daq.files.run_directory import RunReader
    from processing.runs.run_check import check_few
    from processing.runs.unchecked_images import VALUES, unknown_height

    with RunReader(run_dir) as run:
        unchecked = (VALUES[run.header.polarity], unknown_height(run.header))
    asked = Belonging(run_dir.name, tuple(check_few(run_dir, shots, calibration, workbench)), unchecked)
    _tell(asked)
    return asked


def ask_seldom(
    asked: Belonging,
    seldom: Sequence[int],
    run_dir: Path,
    calibration: "Calibration",
    workbench: "Workbench | None" = None,
) -> Belonging:
    """Check shots in which lines of sight meet seldom, too, but for those that were asked; of very many, some."""
    from processing.runs.run_check import check_each

    others = [shot for shot in seldom if shot not in {check.shot for check in asked.checks}]
    chosen, left = others[:MOST_SELDOM], others[MOST_SELDOM:]
    more = replace(asked, checks=tuple(check_each(run_dir, chosen, calibration, workbench)) if chosen else ())
    _tell(more)
    return replace(asked, checks=(*asked.checks, *more.checks), not_asked=tuple(sorted(left)))


def _tell(asked: Belonging) -> None:
    """What speaks against the calibration."""
    from processing.calibration.verdict import Verdict

    for check in asked.checks:
        if check.verdict in (Verdict.WARN, Verdict.REFUSE):
            progress(f"{asked.run}: {check_line(check)}")
