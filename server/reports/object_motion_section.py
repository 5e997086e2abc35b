"""The chapter on how ligaments and sheets move, and of how many that is not known."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from daq.counted import counted
from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.objects.liquid_objects import ObjectClass
from processing.figures.object_motion_figure import MovedObjects, object_motion_figure
from server.reports.page import Picture, Section, Table

TEXT = (
    "The displacement as a whole after which an object's surroundings in all views are like those of the other "
    "exposure. One that turns or stretches has none of its parts."
)
CAPTION = (
    "Left: objects of exposure A of one shot, seen along z, with their velocities. Right: speed against length, with "
    "95 % intervals of the speed."
)
VELOCITY = ("u_m_s", "v_m_s", "w_m_s")
TOLD = (ObjectClass.LIGAMENT, ObjectClass.SHEET, ObjectClass.CLUSTER)


def object_motion_section(shots: Sequence[StoredDroplets]) -> Section | None:
    """Velocities by class, and why others have none; None where nobody asked for any, or there is no object."""
    asked = [shot for shot in shots if VELOCITY[0] in shot.objects and len(shot.objects[VELOCITY[0]])]
    if not asked:
        return None
    every = _joined([_moved(shot) for shot in asked])
    table = Table(
        [
            "",
            "with a velocity",
            "of",
            "speed, median [m/s]",
            "10 to 90 % [m/s]",
            "standard deviation, median [m/s]",
        ],
        [_row(kind, every) for kind in TOLD],
        caption=f"Objects of {counted(len(asked), 'shot')}, both exposures",
    )
    in_a = asked[0].objects["frame"].astype("U1") == "a"
    shown, known = _known(_moved(asked[0]).where(in_a)), _known(every)
    pictures = [Picture(object_motion_figure(shown, known), CAPTION, svg=True)] if len(known) else []
    return Section("Velocities of ligaments and sheets", TEXT, [table], pictures, _without(asked))


def _moved(shot: StoredDroplets) -> MovedObjects:
    columns = shot.objects

    def three(names: Sequence[str]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        return np.column_stack([np.asarray(columns[name], np.float64) for name in names])

    return MovedObjects(
        columns["class"].astype("U"),
        three(("x_mm", "y_mm", "z_mm")),
        np.asarray(columns["length_mm"], np.float64),
        three(VELOCITY),
        three([name.replace("_m_s", "_sd_m_s") for name in VELOCITY]),
    )


def _known(moved: MovedObjects) -> MovedObjects:
    """Those that have a velocity."""
    return moved.where(np.isfinite(moved.velocities_m_s[:, 0]))


def _joined(parts: Sequence[MovedObjects]) -> MovedObjects:
    names = ("classes", "points_mm", "lengths_mm", "velocities_m_s", "sd_m_s")
    return MovedObjects(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _row(kind: ObjectClass, every: MovedObjects) -> list[str]:
    of_kind = every.where(every.classes == kind)
    known = _known(of_kind)
    numbers = [f"{kind}s", f"{len(known)}", f"{len(of_kind)}"]
    if not len(known):
        return [*numbers, "", "", ""]
    low, median, high = np.percentile(known.speeds_m_s, (10, 50, 90))
    return [*numbers, f"{median:.2f}", f"{low:.2f} to {high:.2f}", f"{np.median(known.speed_sd_m_s):.3f}"]


def _without(asked: Sequence[StoredDroplets]) -> list[str]:
    """Why objects have no velocity, and how many, by reason."""
    reasons = Counter(str(one) for shot in asked for one in shot.objects["velocity_reason"].astype("U") if one)
    return [f"{number} without a velocity: {reason}" for reason, number in reasons.most_common()]
