"""What makes the figures of a spray doubtful: verdicts on its exposures and velocities, and what contradicts the axis.

A figure is no better than the shots that it comes from. Each of these is told beside the figures, wherever they go.
"""

import json
from collections.abc import Iterator, Sequence

import numpy as np

from processing.analysis.copied_shots import copies, named
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.shot_doubts import exposure_doubts, velocity_doubts
from processing.analysis.spray.spray_axis import SprayAxis
from processing.analysis.spray.spray_sample import SpraySample
from processing.analysis.velocity.velocity_verdict import FASTEST_M_S

NO_CONDITIONS = ("operator", "remark", "more")
"""Of the notes, what may differ in one spray; what is in ``more`` is looked at by its own names."""
MOST_ASIDE_DEG = 45.0
"""Of the mean velocity from the axis; a spray flies along its axis, however wide it is."""
MOST_BEHIND = 0.05
"""Of the droplets; some are carried back."""
LEAST_TOGETHER = 0.3
"""Amount of the mean velocity over the mean speed: droplets that fly in all directions have none."""


def spray_doubts(
    shots: Sequence[StoredDroplets], sample: SpraySample | None, axis: SprayAxis | None
) -> tuple[str, ...]:
    """What is doubtful, and what to do.

    Parameters
    ----------
    shots : sequence of StoredDroplets
        All of them, refused ones too.
    sample : SpraySample | None
        Their droplets; None where they have no diameters.
    axis : SprayAxis | None
        As stated.
    """
    copied = [f"{named(shot)} has the very droplets of {named(other)}: one is a copy" for shot, other in copies(shots)]
    return (
        *exposure_doubts(shots),
        *velocity_doubts(shots),
        *copied,
        *_of_conditions(shots),
        *(_of_motion(sample, axis) if sample else ()),
        *(_behind(sample, axis) if sample and axis else ()),
    )


def _of_conditions(shots: Sequence[StoredDroplets]) -> Iterator[str]:
    """What the operator has written down of some shots, and of others otherwise."""
    noted = [json.loads(str(shot.provenance.get("notes", "{}"))) for shot in shots]
    stated = [{**notes, **notes.get("more", {})} for notes in noted]
    for name in dict.fromkeys(name for one in stated for name in one if name not in NO_CONDITIONS):
        if len(values := dict.fromkeys(str(one.get(name, "not stated")) for one in stated)) > 1:
            yield f"shots differ in {name}: {' and '.join(values)}; they are no one spray"


def _behind(sample: SpraySample, axis: SprayAxis) -> Iterator[str]:
    along_mm, _, _ = axis.coordinates(sample.points_mm)
    if len(sample) and (share := float(np.mean(along_mm < 0))) > MOST_BEHIND:
        yield f"{100 * share:.0f} % of the droplets lie behind the nozzle: is it stated rightly, and the axis?"


def _of_motion(sample: SpraySample, axis: SprayAxis | None) -> Iterator[str]:
    velocities_m_s = sample.velocities_m_s[sample.paired]
    if not len(velocities_m_s):
        return
    mean_m_s, speed_m_s = velocities_m_s.mean(axis=0), np.linalg.norm(velocities_m_s, axis=1).mean()
    amount_m_s = np.linalg.norm(mean_m_s)
    if speed_m_s > FASTEST_M_S:
        yield f"mean speed {speed_m_s:.3g} m/s: no spray is as fast; is the separation stated rightly, in ns?"
    if axis is None or amount_m_s <= LEAST_TOGETHER * speed_m_s:
        return
    aside_deg = np.degrees(np.arccos(np.clip(axis.frame[0] @ mean_m_s / amount_m_s, -1, 1)))
    if aside_deg > MOST_ASIDE_DEG:
        yield (
            f"droplets fly {aside_deg:.0f} degrees from the axis, in the mean: is it stated rightly, and are exposures "
            "A and B exchanged? Figures along the axis are of another direction"
        )
