"""What some shots say of all that is made of them: how many are doubtful or refused, how many fly another way."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.stored_json import stored_json
from processing.analysis.two_exposures.alone_droplets import alone_in_shots
from processing.analysis.two_exposures.fast_leavers import leavers_in_shots
from processing.analysis.unlike_numbers import unlike_numbers_of_shots
from processing.count import counted
from processing.geometry import FloatArray

COMPONENTS = ("u_m_s", "v_m_s", "w_m_s")

TOGETHER, AGAINST = 0.5, -0.5
"""Amount of a shot's mean velocity over its mean speed, from which on it has a direction; cosine from that of most,
below which it flies against them."""
FEWEST_PAIRS = 5
MOST_FASTER, SLOWEST_M_S = 2.5, 0.1
"""Ratio of the median speed of a shot and that of all shots, of speeds that are no rest."""
UNSURE = {"doubtful": "are doubtful, and count", "refused": "are refused, and do not count"}


def exposure_doubts(shots: Sequence[StoredDroplets], frames: str = "ab") -> tuple[str, ...]:
    """Doubts on the exposures of some frames."""
    told = [shot.exposures for shot in shots]
    exposures = [exposure for shot in told for frame, exposure in shot.items() if frame in frames]
    unsure = tuple(_unsure(exposures, "exposure"))
    numbers = unlike_numbers_of_shots(shots) if set(frames) >= {"a", "b"} else ""
    return (*unsure, *([numbers] if numbers else []))


def velocity_doubts(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """Doubts on the velocities; none where nobody could measure any."""
    velocities = [stored_json(shot.provenance, "velocity") for shot in shots]
    flying = [(shot, rows) for shot in shots if (rows := _flying(shot)) is not None]
    unsure = (f"velocities of {doubt}" for doubt in _unsure(velocities, "shot"))
    return (*unsure, *alone_in_shots(shots).told, *leavers_in_shots(flying), *_against(flying), *_faster(flying))


Flying = Sequence[tuple[StoredDroplets, FloatArray]]
"""Shots with the velocities (N, 3) of their droplets of exposure A."""


def _faster(flying: Flying) -> Iterator[str]:
    """Shots that fly much faster or slower than the others: their mean is that of two sprays, or of two separations."""
    if not flying:
        return
    speeds_m_s = np.array([np.median(np.linalg.norm(rows, axis=1)) for _, rows in flying])
    ratios = np.maximum(speeds_m_s, SLOWEST_M_S) / max(float(np.median(speeds_m_s)), SLOWEST_M_S)
    if len(odd := np.flatnonzero(np.abs(np.log(ratios)) > np.log(MOST_FASTER))):
        yield (
            f"droplets of {len(odd)} of {counted(len(flying), 'shot')} fly {MOST_FASTER:g} times faster or slower than "
            f"those of the others ({flying[odd[0]][0].name}: {speeds_m_s[odd[0]]:.3g} m/s, all: "
            f"{np.median(speeds_m_s):.3g} m/s): is the separation right in all of them, and are they of one spray?"
        )


def _against(flying: Flying) -> Iterator[str]:
    """Shots that fly against most others: their mean may be next to nothing, and no axis contradicts it."""
    ways = [(shot, way) for shot, rows in flying if (way := way_of(rows)) is not None]
    if not ways:
        return
    units = np.array([way for _, way in ways])
    main = units @ np.linalg.eigh(units.T @ units)[1][:, -1]
    main *= np.sign(np.median(np.sign(main))) or 1.0
    if odd := [shot for (shot, _), cosine in zip(ways, main, strict=True) if cosine < AGAINST]:
        yield (
            f"droplets of {len(odd)} of {counted(len(ways), 'shot')} fly against those of the others ({odd[0].name}): "
            "are exposures A and B exchanged in some? Their mean velocity is of no spray"
        )


def _flying(shot: StoredDroplets) -> FloatArray | None:
    """Velocities of the droplets of A that have one; None where they are few."""
    if any(name not in shot.columns for name in COMPONENTS):
        return None
    velocities = np.column_stack([np.asarray(shot.columns[name], np.float64) for name in COMPONENTS])
    flying = velocities[np.isfinite(velocities).all(axis=1) & (shot.columns["frame"] == "a")]
    return np.asarray(flying) if len(flying) >= FEWEST_PAIRS else None


def way_of(velocities_m_s: FloatArray) -> FloatArray | None:
    """Unit vector (3,) along which droplets of these velocities (N, 3) fly; None where they fly anywhere, or N is 0."""
    if not len(velocities_m_s):
        return None
    mean, speed = velocities_m_s.mean(axis=0), float(np.linalg.norm(velocities_m_s, axis=1).mean())
    amount = float(np.linalg.norm(mean))
    return np.asarray(mean / amount) if amount > TOGETHER * speed else None


def _unsure(told: Sequence[Mapping[str, Any]], what: str) -> Iterator[str]:
    """How many of how many, and what is with them, by the first one's reason."""
    for verdict, why in UNSURE.items():
        if chosen := [one for one in told if one.get("verdict") == verdict]:
            number = f"{len(chosen)} of {counted(len(told), what)}"
            yield ": ".join([f"{number} {why}", *chosen[0].get("reasons", ())[:1]])
