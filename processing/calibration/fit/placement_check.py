"""Do the views of a calibration stand where they can? Refuses what turned cameras, mirrors and exchanged files give."""

from collections.abc import Iterator, Mapping

from processing.calibration.errors import CalibrationError
from processing.calibration.fit.placement import (
    SAME_STRETCH,
    common_stretch,
    doubtful_views,
    exchanged_views,
    in_one_place,
    opposite_views,
    same_either_way,
    sight_azimuth_deg,
    turned_views,
)
from processing.calibration.observation import CalibrationSet
from processing.calibration.verdict import Doubt
from processing.geometry import FloatArray, ViewMapping


def check_placements(calibration_set: CalibrationSet, mappings: Mapping[str, ViewMapping]) -> Iterator[Doubt]:
    """What speaks against views by where they stand.

    Parameters
    ----------
    calibration_set : CalibrationSet
        What the mappings were fitted to, at known places.
    mappings : Mapping[str, ViewMapping]
        The fits.

    Raises
    ------
    CalibrationError
        Some views agree with the rig, others only with the target's axes turned, or in the places of others; names
        them and the remedy.
    """
    middle_mm, azimuths_deg = calibration_set.middle_mm, calibration_set.azimuths_deg
    turned_deg = turned_views(mappings, middle_mm, azimuths_deg)
    if turned_deg and (len(turned_deg) < len(mappings) or len(set(turned_deg.values())) > 1):
        raise CalibrationError("; ".join(_some_turned(calibration_set, mappings, middle_mm, turned_deg)))
    if turned_deg:
        yield _all_turned(calibration_set, turned_deg)
    doubtful_deg = doubtful_views(mappings, middle_mm, azimuths_deg)
    yield from _doubtful(calibration_set, mappings, middle_mm, doubtful_deg)
    in_line = {name: angle for name, angle in azimuths_deg.items() if not turned_deg and name not in doubtful_deg}
    for name in opposite_views(mappings, middle_mm, in_line):
        yield Doubt(
            (name,),
            f"{name}: {_both_azimuths(calibration_set, name, mappings[name], middle_mm)}, on the other side of the "
            "target than the other views agree on: do x and z count the other way there, or is its azimuth half a turn "
            "off?",
        )
    for pair in in_one_place(mappings, middle_mm):
        yield _together(*pair)


def _all_turned(calibration_set: CalibrationSet, turned_deg: Mapping[str, int]) -> Doubt:
    turn_deg, upright = next(iter(turned_deg.values())), _upright(calibration_set, turned_deg)
    text = (
        f"every view sees the target's axes turned by {turn_deg} deg about z: so do x and y of all results, unless "
        "azimuths count the other way, or all images are mirrored"
    )
    return Doubt(tuple(turned_deg), f"{text}; {upright}" if upright else text)


def _together(one: str, other: str) -> Doubt:
    return Doubt(
        (one, other),
        f"{one} and {other} seem to stand in one place: if one of them hangs upside down (roll_deg) or looks by a "
        "mirror (mirrored), say so, else their lines of sight do not meet",
    )


def _some_turned(
    calibration_set: CalibrationSet,
    mappings: Mapping[str, ViewMapping],
    middle_mm: FloatArray,
    turned_deg: Mapping[str, int],
) -> list[str]:
    """What may be the reason where some views see the axes turned and others do not, the likeliest one first."""
    texts = [_turned(calibration_set, name, mappings[name], middle_mm, turn) for name, turn in turned_deg.items()]
    undecided = same_either_way(mappings, middle_mm, turned_deg)
    texts += [f"{name}: looks the same either way; if it is turned too, say --roll for it" for name in undecided]
    texts += [f"or {question}" for question in _exchanged(mappings, middle_mm, calibration_set.azimuths_deg)]
    all_turned = len(turned_deg) + len(undecided) == len(mappings)
    upright = _upright(calibration_set, turned_deg) if all_turned else ""
    likelier = upright or _stretched(calibration_set, mappings, middle_mm)
    return [likelier, *(f"else: {text}" for text in texts)] if likelier else texts


def _doubtful(
    calibration_set: CalibrationSet,
    mappings: Mapping[str, ViewMapping],
    middle_mm: FloatArray,
    doubtful_deg: Mapping[str, float],
) -> Iterator[Doubt]:
    """Views beside their azimuths, and what would explain it; refuses those that stand in the places of others."""
    azimuths_deg = calibration_set.azimuths_deg
    if not doubtful_deg:
        return
    if exchanged := list(_exchanged(mappings, middle_mm, azimuths_deg)):
        both = [f"{name} {_both_azimuths(calibration_set, name, mappings[name], middle_mm)}" for name in doubtful_deg]
        raise CalibrationError("; ".join([*both, *exchanged]))
    for name, off_deg in doubtful_deg.items():
        text = f"{_both_azimuths(calibration_set, name, mappings[name], middle_mm)}, {off_deg:.1f} deg apart"
        yield Doubt((name,), f"{name}: {text}")
    if stretched := _stretched(calibration_set, mappings, middle_mm):
        yield Doubt(tuple(azimuths_deg), stretched)


def _stretched(calibration_set: CalibrationSet, mappings: Mapping[str, ViewMapping], middle_mm: FloatArray) -> str:
    """A question where one length that is wrong explains where all views stand; else nothing."""
    stretch = common_stretch(mappings, middle_mm, calibration_set.azimuths_deg)
    if stretch is None or abs(stretch - 1) <= SAME_STRETCH:
        return ""
    pitch = calibration_set.target and f"pitch_mm {stretch * calibration_set.target.pitch_mm:.3g}"
    return (
        f"all views would stand where the rig says if x were {stretch:.3g} times as long: is "
        f"{pitch or 'the unit of x and y'} right, or z counted in other steps?"
    )


def _upright(calibration_set: CalibrationSet, turned_deg: Mapping[str, int]) -> str:
    """A question where a board that is not square tells the same turn to all views; else nothing."""
    target = calibration_set.target
    if target is None or target.columns == target.rows or {abs(turn) for turn in turned_deg.values()} != {90}:
        return ""
    return (
        f"have columns and rows of the target been exchanged (columns = {target.rows}, rows = {target.columns})? "
        "Rows are level in the image"
    )


def _exchanged(
    mappings: Mapping[str, ViewMapping], middle_mm: FloatArray, azimuths_deg: Mapping[str, float]
) -> Iterator[str]:
    exchanged = exchanged_views(mappings, middle_mm, azimuths_deg)
    if exchanged:
        places = ", ".join(f"{name} stands in the place of {place}" for name, place in exchanged.items())
        names = " and ".join([", ".join(list(exchanged)[:-1]), list(exchanged)[-1]])
        yield f"have {names} been exchanged? Then all views agree with the rig ({places})"


def _turned(
    calibration_set: CalibrationSet, name: str, mapping: ViewMapping, middle_mm: FloatArray, turn_deg: int
) -> str:
    said_deg = calibration_set.rolls_deg.get(name, 0.0)
    roll_deg = 180 - (180 - said_deg - turn_deg) % 360  # above -180, up to 180
    both = _both_azimuths(calibration_set, name, mapping, middle_mm)
    mirror = (
        f"Does it look by a mirror? Say --mirrored {name} (mirrored in the manifest). Or is "
        if turn_deg == 180
        else "Is "
    )
    return (
        f"{name}: {both}; with x and y turned by {turn_deg} deg both agree. {mirror}the camera turned about its axis? "
        f"Say --roll {name}={roll_deg:g} (roll_deg in configuration or manifest), "
        f"or --roll {name}={said_deg:g} if it is not, and the rig is wrong"
    )


def _both_azimuths(calibration_set: CalibrationSet, name: str, mapping: ViewMapping, middle_mm: FloatArray) -> str:
    fitted_deg = sight_azimuth_deg(mapping, middle_mm)
    return f"stands at {fitted_deg:.3g} deg by the target, at {calibration_set.azimuths_deg[name]:g} deg by the rig"
