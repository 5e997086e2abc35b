"""Do the views of a calibration stand where they can? Refuses what a camera that hangs upside down would give."""

from collections.abc import Iterator, Mapping

import numpy as np

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.placement import (
    doubtful_views,
    exchanged_views,
    in_one_place,
    placement,
    same_either_way,
    turned_views,
)
from processing.calibration.observation import CalibrationSet, stacked
from processing.geometry import FloatArray, ViewMapping


def check_placements(calibration_set: CalibrationSet, mappings: Mapping[str, ViewMapping]) -> Iterator[str]:
    """Notes on views that stand where they hardly can.

    Parameters
    ----------
    calibration_set : CalibrationSet
        What the mappings were fitted to, at known places.
    mappings : Mapping[str, ViewMapping]
        The fits, in a right-handed world.

    Raises
    ------
    CalibrationError
        Some views agree with the rig, others only with the target's axes turned; names them and the remedy.
    """
    middle_mm = np.mean([stacked(seen.planes)[0].mean(axis=0) for seen in calibration_set.views.values()], axis=0)
    azimuths_deg = calibration_set.azimuths_deg
    turned_deg = turned_views(mappings, middle_mm, azimuths_deg)
    if turned_deg and (len(turned_deg) < len(mappings) or len(set(turned_deg.values())) > 1):
        texts = [_turned(calibration_set, name, mappings[name], middle_mm, turn) for name, turn in turned_deg.items()]
        undecided = same_either_way(mappings, middle_mm, turned_deg)
        texts += [f"{name}: looks the same either way; if it is turned too, say --roll for it" for name in undecided]
        texts += [f"or {question}" for question in _exchanged(mappings, middle_mm, azimuths_deg)]
        raise CalibrationError("; ".join(texts))
    if turned_deg:
        turn_deg = next(iter(turned_deg.values()))
        yield f"every view sees the target's axes turned by {turn_deg} deg about z: so do x and y of all results"
    doubtful_deg = doubtful_views(mappings, middle_mm, azimuths_deg)
    for name, off_deg in doubtful_deg.items():
        yield f"{name}: {_both_azimuths(calibration_set, name, mappings[name], middle_mm)}, {off_deg:.0f} deg apart"
    if doubtful_deg:
        yield from _exchanged(mappings, middle_mm, azimuths_deg)
    for one, other in in_one_place(mappings, middle_mm):
        yield (
            f"{one} and {other} seem to stand in one place: if one of them hangs upside down, say so (roll_deg), "
            "else their lines of sight do not meet"
        )


def _exchanged(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> Iterator[str]:
    for one, other in exchanged_views(mappings, middle_mm, azimuths_deg):
        yield f"have {one} and {other} been exchanged? Then all views agree with the rig"


def _turned(
    calibration_set: CalibrationSet, name: str, mapping: ViewMapping, middle_mm: FloatArray, turn_deg: int
) -> str:
    said_deg = calibration_set.rolls_deg.get(name, 0.0)
    roll_deg = 180 - (180 - said_deg - turn_deg) % 360  # above -180, up to 180
    both = _both_azimuths(calibration_set, name, mapping, middle_mm)
    return (
        f"{name}: {both}; with x and y turned by {turn_deg} deg both agree. Is the camera turned about its axis? "
        f"Say --roll {name}={roll_deg:g} (roll_deg in configuration or manifest), "
        f"or --roll {name}={said_deg:g} if it is not, and the rig is wrong"
    )


def _both_azimuths(calibration_set: CalibrationSet, name: str, mapping: ViewMapping, middle_mm: FloatArray) -> str:
    fitted_deg = placement(mapping, middle_mm).azimuth_deg
    return f"stands at {fitted_deg:.0f} deg by the target, at {calibration_set.azimuths_deg[name]:g} deg by the rig"
