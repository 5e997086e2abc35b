"""What the verdicts on some shots say of all that is made of them: how many are doubtful, how many were refused."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from processing.analysis.droplets.droplet_file import StoredDroplets

UNSURE = {"doubtful": "are doubtful, and count", "refused": "are refused, and do not count"}


def exposure_doubts(shots: Sequence[StoredDroplets], frames: str = "ab") -> tuple[str, ...]:
    """Doubts on the exposures of some frames."""
    told = [json.loads(str(shot.provenance.get("exposures", "{}"))) for shot in shots]
    exposures = [exposure for shot in told for frame, exposure in shot.items() if frame in frames]
    return tuple(f"{count} exposures {why}" for count, why in _unsure(exposures))


def velocity_doubts(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """Doubts on the velocities; none where nobody could measure any."""
    velocities = [json.loads(str(shot.provenance.get("velocity", "{}"))) for shot in shots]
    return tuple(f"velocities of {count} shots {why}" for count, why in _unsure(velocities))


def _unsure(told: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    """How many of how many, and what is with them, by the first one's reason."""
    for verdict, what in UNSURE.items():
        if chosen := [one for one in told if one.get("verdict") == verdict]:
            yield f"{len(chosen)} of {len(told)}", ": ".join([what, *chosen[0].get("reasons", ())[:1]])
