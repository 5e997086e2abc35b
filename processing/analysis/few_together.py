"""What shots say together of their images, which each of them by itself has too few droplets to say.

Of shots with more droplets each has been asked by itself: whether they look like discs, whether those of B are as large
as the very same ones of A. Of all it is asked whether they are a little longer than wide, and how many are missing.
"""

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from processing.analysis.droplets.droplet_file import DIAMETER, StoredDroplets
from processing.analysis.droplets.droplet_statistics import REFUSED
from processing.analysis.droplets.droplet_table import sizes_of
from processing.analysis.droplets.shadows.light.seen_light import LEAST_DROPLETS
from processing.analysis.droplets.shadows.shadow_light import unlike_discs
from processing.analysis.droplets.verdicts.cut_sizes import AMPLITUDES, DIAMETERS, complete_from, cut_off
from processing.analysis.droplets.verdicts.elongation import WRONG, Elongation, elongation_told
from processing.analysis.stored_json import stored_json
from processing.analysis.unlike_sizes import FEWEST, LEAST_P_PAIR, LONGEST_NS, common_share, unlike_told
from processing.geometry import FloatArray

SD, RESIDUAL = "diameter_sd_um", "residual"


def few_together(shots: Sequence[StoredDroplets]) -> tuple[str, ...]:
    """For people: what is wrong with shapes, or with diameters of B beside A; nothing where nothing says so."""
    length, is_wrong = elongation_told(_views(shots))
    sized = [shot for shot in shots if {DIAMETER, SD, RESIDUAL} <= shot.columns.keys()]
    told = (_shapes(sized), _sizes(sized))
    few = (f"shots with few droplets together: {what}" for what in told if what)
    of_all = (f"{length}{WRONG if is_wrong else ''}" if length else "", _smallest(shots))
    return (*few, *(f"all shots together: {what}" for what in of_all if what))


def _smallest(shots: Sequence[StoredDroplets]) -> str:
    """Of exposures A: B shows the same droplets, and makes nothing surer."""
    first = [sizes_of(shot.columns)[shot.columns["frame"] == "a"] for shot in shots]
    limits = [np.full(len(its), found_from(shot)) for shot, its in zip(shots, first, strict=True)]
    below = DIAMETERS if all(DIAMETER in shot.columns for shot in shots) else AMPLITUDES
    return cut_off(np.concatenate([np.empty(0), *first]), np.concatenate([np.empty(0), *limits]), below)


def found_from(shot: StoredDroplets) -> float:
    """Diameter in um, or amplitude, from which on droplets of its exposure A are found; 0: its file does not tell."""
    views = shot.exposures.get("a", {}).get("views", {})
    name = "complete_from_um" if DIAMETER in shot.columns else "complete_from"
    return complete_from([view.get(name, 0.0) for view in views.values()])


def _views(shots: Sequence[StoredDroplets]) -> list[Elongation]:
    """How long shadows are, by view, of all exposures that are not refused; files of older programs do not tell."""
    told = defaultdict(list)
    exposures = (one for shot in shots for one in shot.exposures.values())
    for exposure in (one for one in exposures if one.get("verdict") != REFUSED):
        for name, view in exposure.get("views", {}).items():
            if longer := view.get("elongation"):
                told[name].append(Elongation(**longer))
    return [Elongation.together(several) for several in told.values()]


def _shapes(shots: Sequence[StoredDroplets]) -> str:
    exposures = [
        np.asarray(shot.columns[RESIDUAL], np.float64)[shot.columns["frame"] == frame]
        for shot in shots
        for frame in "ab"
    ]
    few = [one for one in exposures if len(one) < LEAST_DROPLETS]
    return unlike_discs(np.concatenate([np.empty(0), *few]))


def _sizes(shots: Sequence[StoredDroplets]) -> str:
    pairs = [few for shot in shots if len(few := _pairs(shot)) < FEWEST]
    separations_ns = [ns for shot in shots if (ns := _separation_ns(shot)) is not None]
    if sum(map(len, pairs)) < FEWEST or max(separations_ns, default=math.inf) > LONGEST_NS:
        return ""
    before_um, after_um, before_sd_um, after_sd_um = np.concatenate(pairs).T
    common = math.hypot(common_share(before_sd_um, before_um), common_share(after_sd_um, after_um))
    return unlike_told(before_um, after_um, common, float(np.median(separations_ns)))


def _pairs(shot: StoredDroplets) -> FloatArray:
    """Diameters of A and B and their standard deviations, (N, 4), of the droplets that both show."""
    columns = shot.columns
    if "partner" not in columns:
        return np.empty((0, 4))
    partner, p_pair = np.asarray(columns["partner"], np.intp), np.asarray(columns["p_pair"], np.float64)
    (own,) = np.nonzero((columns["frame"] == "a") & (partner >= 0) & (p_pair > LEAST_P_PAIR))
    known = (np.asarray(columns[name], np.float64) for name in (DIAMETER, SD))
    return np.column_stack([one[rows] for one in known for rows in (own, partner[own])])


def _separation_ns(shot: StoredDroplets) -> float | None:
    told = stored_json(shot.provenance, "velocity")
    return None if (stated := told.get("separation_ns")) is None else float(stated)
