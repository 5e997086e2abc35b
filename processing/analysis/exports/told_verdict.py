"""What a file says its rows are good for, as columns and as texts: whoever opens a table alone is told, too."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_file import FRAME
from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.exports.stored import Stored
from processing.analysis.stored_json import stored_json

VERDICT, VELOCITY_VERDICT, DOUBTS = "verdict", "velocity_verdict", "doubts"
BELIEVED = (ShotVerdict.GOOD, ShotVerdict.EMPTY)
NOT_TOLD = "not told"
"""Verdict of a file that does not say what became of its exposures."""
DOUBTFUL = "doubtful"
"""Column of formats that have no texts: 1 where a verdict is not good."""
_VELOCITY = "u_m_s"


def told_texts(stored: Stored, frame: str = "") -> dict[str, str]:
    """Verdicts, and why they are no better; the least favourable one of all exposures, or that of one.

    Parameters
    ----------
    stored : Stored
        Droplets of a shot, or tracks: these are doubtful where their file has doubts.
    frame : str
        ``a`` or ``b``; empty: all.
    """
    if FRAME not in stored.columns:
        doubts = stored_json(stored.provenance, DOUBTS)
        return {VERDICT: str(ShotVerdict.DOUBTFUL if doubts else ShotVerdict.GOOD), DOUBTS: _joined(doubts)}
    exposures = stored_json(stored.provenance, "exposures")
    told = [one for name, one in exposures.items() if frame in ("", name)]
    velocity = stored_json(stored.provenance, "velocity") if _VELOCITY in stored.columns else {}
    flying = {VELOCITY_VERDICT: str(velocity[VERDICT])} if VERDICT in velocity else {}
    reasons = [reason for one in told for reason in one.get("reasons", ())]
    of_velocity = [f"velocities: {reason}" for reason in velocity.get("reasons", ())]
    return {VERDICT: _worst(told), **flying, DOUBTS: _joined([*reasons, *of_velocity])}


def told_columns(stored: Stored) -> Columns:
    """The same of every row, (N,) each."""
    rows = len(next(iter(stored.columns.values())))
    frames = stored.columns.get(FRAME, np.full(rows, ""))
    told = {str(frame): told_texts(stored, str(frame)) for frame in np.unique(frames)}
    return {name: np.array([told[str(frame)][name] for frame in frames], "U") for name in told_texts(stored)}


def doubtful(stored: Stored) -> NDArray[np.int8]:
    """Which rows (N,) have a verdict that is not good: 1, else 0."""
    columns = told_columns(stored)
    verdicts = [columns[name] for name in (VERDICT, VELOCITY_VERDICT) if name in columns]
    return np.asarray(np.any([~np.isin(one, BELIEVED) for one in verdicts], axis=0), np.int8)


def _worst(told: Iterable[Mapping[str, Any]]) -> str:
    verdicts = [ShotVerdict(one[VERDICT]) for one in told]
    return str(max(verdicts, key=list(ShotVerdict).index)) if verdicts else NOT_TOLD


def _joined(doubts: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(doubts))
