"""What some shots say of all that is made of them: how many are doubtful or refused, how many fly another way."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from processing.analysis.copied_shots import named
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.geometry import FloatArray

COMPONENTS = ("u_m_s", "v_m_s", "w_m_s")

TOGETHER, AGAINST = 0.5, -0.5
"""Amount of a shot's mean velocity over its mean speed, from which on it has a direction; cosine from that of most,
below which it flies against them."""
FEWEST_PAIRS = 5
UNSURE = {"doubtful": "are doubtful, and count", "refused": "are refused, and do not count"}


def exposure_doubts(shots: Sequence[StoredDroplets], frames: str = "ab") -> tuple[str, ...]:
    """Doubts on the exposures of some frames."""
    told = [json.loads(str(shot.provenance.get("exposures", "{}"))) for shot in shots]
    exposures = [exposure for shot in told for frame, exposure in shot.items() if frame in frames]
    return tuple(f"{count} exposures {why}" for count, why in _unsure(exposures))


def velocity_doubts(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """Doubts on the velocities; none where nobody could measure any."""
    velocities = [json.loads(str(shot.provenance.get("velocity", "{}"))) for shot in shots]
    return (*(f"velocities of {count} shots {why}" for count, why in _unsure(velocities)), *_against(shots))


def _against(shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """Shots that fly against most others: their mean may be next to nothing, and no axis contradicts it."""
    ways = [(shot, way) for shot in shots if (way := _way(shot)) is not None]
    if not ways:
        return
    units = np.array([way for _, way in ways])
    main = units @ np.linalg.eigh(units.T @ units)[1][:, -1]
    main *= np.sign(np.median(np.sign(main))) or 1.0
    if odd := [shot for (shot, _), cosine in zip(ways, main, strict=True) if cosine < AGAINST]:
        yield (
            f"droplets of {len(odd)} of {len(ways)} shots fly against those of the others ({named(odd[0])}): are "
            "exposures A and B exchanged in some? Their mean velocity is of no spray"
        )


def _way(shot: StoredDroplets) -> FloatArray | None:
    """Unit vector along which the droplets of a shot fly; None where they are few, or fly anywhere."""
    if any(name not in shot.columns for name in COMPONENTS):
        return None
    velocities = np.column_stack([np.asarray(shot.columns[name], np.float64) for name in COMPONENTS])
    flying = velocities[np.isfinite(velocities).all(axis=1) & (shot.columns["frame"] == "a")]
    if len(flying) < FEWEST_PAIRS:
        return None
    mean, speed = flying.mean(axis=0), float(np.linalg.norm(flying, axis=1).mean())
    amount = float(np.linalg.norm(mean))
    return np.asarray(mean / amount) if amount > TOGETHER * speed else None


def _unsure(told: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """How many of how many, and what is with them, by the first one's reason."""
    for verdict, what in UNSURE.items():
        if chosen := [one for one in told if one.get("verdict") == verdict]:
            yield f"{len(chosen)} of {len(told)}", ": ".join([what, *chosen[0].get("reasons", ())[:1]])
