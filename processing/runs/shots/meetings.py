"""What the exposures of a run say of each other: in which of them lines of sight meet seldom, and views are pale.

A single exposure tells neither: how many droplets there are differs from spray to spray, and how sharp a view is from
rig to rig. So each keeps its figures, which cost a hundredth of a second, and they are compared as they come.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from processing.reconstruction.settings import FrozenValue
from processing.runs.results_file import ExposureKey
from processing.runs.stored_exposures import StoredExposure

MEETING = "meeting"
"""Of a stored volume: what its exposure is compared with others by; a JSON table."""
SELDOM = 0.5
"""Of how often lines of sight meet in half of the shots."""
MISSED = 3.0
"""Standard deviations of the count that is missed."""
PALE = 0.85
"""Of the usual contrast: a view that is less sharp by the size of a droplet, or a third darker over half of it."""
SURE = 5.0
"""Standard deviations of a contrast."""
FEWEST = 10
"""Of fewer droplets contrasts say nothing."""
FEWEST_EXPOSURES = 3
"""Of fewer, which is the odd one nobody knows."""


class Meeting(FrozenValue):
    """At how many droplets of an exposure lines of sight of all views meet, and how well each view shows these."""

    droplets: Annotated[int, Field(description="of some in the middle of the volume")]
    contrasts: Annotated[
        Mapping[str, float],
        Field(description="by view: three quarters of them are more intense than so many times the middle view's"),
    ] = {}
    errors: Annotated[Mapping[str, float], Field(description="standard deviations of these by chance")] = {}


Meetings = Mapping[ExposureKey, Meeting]


def meetings_of(volumes: list[dict[str, Any]]) -> dict[ExposureKey, Meeting]:
    """Of records of volumes, those that have one."""
    told = [one for one in volumes if one.get("meeting")]
    return {(one["shot"], one["frame"]): Meeting.model_validate(one["meeting"]) for one in told}


def stored_meetings(exposures: Iterable[StoredExposure]) -> dict[ExposureKey, Meeting]:
    """What the exposures of stored volumes are compared by; of older ones, and what nobody can read, nothing."""
    found: dict[ExposureKey, Meeting] = {}
    for one in exposures:
        with suppress(ValueError, KeyError):
            found[one.key] = Meeting.model_validate(one.table(MEETING))
    return found


def seldom_meeting(meetings: Meetings) -> list[int]:
    """Shots in which lines of sight meet much more seldom than in the others, the most seldom first.

    Of a shot that exposure counts in which they are fewer.
    """
    counts: dict[int, int] = {}
    for (shot, _), meeting in meetings.items():
        counts[shot] = min(meeting.droplets, counts.get(shot, meeting.droplets))
    usual = float(np.median(list(counts.values()))) if counts else 0.0
    least = min(SELDOM * usual, usual - MISSED * np.sqrt(usual))
    odd = [shot for shot, count in counts.items() if count < least]
    return sorted(odd, key=counts.__getitem__)


def pale_views(meetings: Meetings) -> dict[ExposureKey, dict[str, str]]:
    """What is said of views that show droplets much paler, beside the other views, than in most exposures of a run."""
    said: dict[ExposureKey, dict[str, str]] = {}
    for frame in dict.fromkeys(frame for _, frame in meetings):
        told = {key: one for key, one in meetings.items() if key[1] == frame and one.droplets >= FEWEST}
        if len(told) < FEWEST_EXPOSURES:
            continue
        for view in sorted(set.intersection(*(set(one.contrasts) for one in told.values()))):
            said |= {key: {**said.get(key, {}), view: text} for key, text in _pale(told, view).items()}
    return said


def with_odd(faults: Sequence[Mapping[str, Any]], meetings: Meetings) -> list[Mapping[str, Any]]:
    """Faults of exposures of one kind, and those that only the others tell."""
    pale = {shot: views for (shot, _), views in pale_views(meetings).items()}
    known = [
        {**fault, "odd_light": {**pale[fault["shot"]], **fault.get("odd_light", {})}}
        if fault["shot"] in pale
        else fault
        for fault in faults
    ]
    others = pale.keys() - {fault["shot"] for fault in faults}
    return [*known, *({"shot": shot, "odd_light": pale[shot]} for shot in sorted(others))]


def _pale(told: Meetings, view: str) -> dict[ExposureKey, str]:
    droplets = np.array([one.droplets for one in told.values()])
    contrasts = np.array([one.contrasts[view] for one in told.values()])
    usual = float(np.median(contrasts))
    by_chance = float(np.median([one.errors[view] for one in told.values()] * np.sqrt(droplets))) / np.sqrt(droplets)
    pale = contrasts < usual - np.maximum((1 - PALE) * usual, SURE * by_chance)
    return {key: _text(contrast / usual) for key, contrast, is_so in zip(told, contrasts, pale, strict=True) if is_so}


def _text(share: float) -> str:
    return (
        f"shows droplets with {100 * share:.0f} % of the contrast that it has in other shots, beside the other views: "
        "is it out of focus, or veiled?"
    )
