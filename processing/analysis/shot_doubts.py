"""What the verdicts on some shots say of all that is made of them: how many are doubtful, how many were refused."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from processing.analysis.droplets.droplet_file import StoredDroplets

UNSURE = {"doubtful": "are doubtful, and count", "refused": "are refused, and do not count"}


def shot_doubts(shots: Sequence[StoredDroplets], frames: str = "ab") -> Iterator[str]:
    """Doubts on exposures, and on velocities where both exposures count; with the reasons of the first one."""
    told = [json.loads(str(shot.provenance.get("exposures", "{}"))) for shot in shots]
    exposures = [exposure for shot in told for frame, exposure in shot.items() if frame in frames]
    yield from (f"{count} exposures {why}" for count, why in _unsure(exposures))
    if len(frames) > 1:
        velocities = [json.loads(str(shot.provenance.get("velocity", "{}"))) for shot in shots]
        yield from (f"velocities of {count} shots {why}" for count, why in _unsure(velocities))


def _unsure(told: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    for verdict, what in UNSURE.items():
        if chosen := [one for one in told if one.get("verdict") == verdict]:
            yield f"{len(chosen)} of {len(told)}", ": ".join([what, *chosen[0].get("reasons", ())[:1]])
