"""What the droplets of one shot say of a calibration: how far each view is from where the others put them."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain, zip_longest
from typing import Any

from processing.analysis.near_or_far import depth_reversed
from processing.calibration.calibration import Calibration
from processing.calibration.droplets.agreement import strangers
from processing.calibration.droplets.disparity import MIN_VIEWS, REACH_PX, ViewDisparity, measured_box, shot_disparity
from processing.calibration.droplets.displaced_view import displaced_view
from processing.calibration.droplets.droplet_matching import MAX_SEEDS
from processing.calibration.droplets.self_calibration import CLEARER, NOISE_PX
from processing.calibration.errors import CalibrationError, OutOfRange
from processing.calibration.fit.health import LIMITS_PX, judge
from processing.calibration.verdict import Verdict
from processing.count import counted
from processing.geometry import FloatArray
from processing.runs.shots.turned_views import meeting_sights

ALARM_PX, STOP_PX = LIMITS_PX[Verdict.USABLE], LIMITS_PX[Verdict.WARN]
"""Disparity of a view above which an operator should know, and above which volumes are not worth having."""

FEW_SEEDS = 300
"""Droplets of an exposure that are followed at first: a fifth of the work."""
SURE = 2.0
"""Standard uncertainties."""
_EXPOSURES = "AB"

Exposure = list[FloatArray]


@dataclass(frozen=True)
class ShotCheck:
    """What the droplets of one shot say of a calibration.

    Parameters
    ----------
    shot : int
        Index of the shot.
    views : dict[str, ViewDisparity]
        By view; empty where the droplets do not tell.
    problem : str
        Why they do not tell.
    beyond : tuple of str
        Views one of which, at least, has moved further than can be measured; none, where droplets do not tell that.
    agreed : bool
        Some views agree. Where none do, none is known to be wrong: the spots of noisy images are no droplets.
    sights : dict of str to int
        At how many droplets of all shots that were asked at once lines of sight meet, by what is assumed.
    untold : str
        What speaks against the calibration that no droplet tells.
    """

    shot: int
    views: dict[str, ViewDisparity]
    problem: str = ""
    beyond: tuple[str, ...] = ()
    agreed: bool = True
    sights: Mapping[str, int] = field(default_factory=dict)
    untold: str = ""

    @property
    def worst_px(self) -> float:
        """Largest disparity of a view."""
        return max(view.disparity_px for view in self.views.values())

    @property
    def most_px(self) -> float:
        """No view is further off, whatever the uncertainty of its disparity hides."""
        return max(view.disparity_px + SURE * view.uncertainty_px for view in self.views.values())

    @property
    def moved(self) -> str | None:
        """The view whose motion alone explains an alarm, clearly better than that of any other would."""
        if len(self.beyond) == 1:
            return self.beyond[0]
        if len(self.views) < 2 or self.certain_px <= ALARM_PX:
            return None
        best, second = sorted(self.views, key=lambda name: self.views[name].left_px)[:2]
        clearly = self.views[second].left_px > CLEARER * max(self.views[best].left_px, NOISE_PX)
        return best if clearly else None

    @property
    def verdict(self) -> Verdict | None:
        """By the limits of a hold-out error: ``warn`` is an alarm, ``refuse`` stops reconstruction.

        A view that has moved further than can be measured is refused too; where no views agree, that is an alarm, and
        so is what no droplet tells.
        """
        if self.beyond:
            return Verdict.REFUSE if self.agreed else Verdict.WARN
        told = judge(self.certain_px) if self.views else None
        return Verdict.WARN if self.untold and told is not Verdict.REFUSE else told

    def record(self) -> dict[str, Any]:
        """What was found, for a program: JSON values."""
        return {
            "shot": self.shot,
            "verdict": self.verdict,
            "moved": self.moved,
            "views": {name: view.disparity_px for name, view in self.views.items()},
            "uncertainty_px": {name: view.uncertainty_px for name, view in self.views.items()},
            "problem": "; ".join(filter(None, (self.problem, self.untold))) or None,
        }

    @property
    def certain_px(self) -> float:
        """The largest disparity of a view that is certain."""
        return max(view.certain_px for view in self.views.values())


def check_shots(by_shot: Mapping[int, Sequence[Exposure]], calibration: Calibration) -> list[ShotCheck]:
    """Measure the disparity of every view by the droplets (N, 2) of each exposure and view, for some shots of a run.

    Whether depth is reversed is asked once, of all shots together; if it is, none of them tells anything else.
    """
    sights = meeting_sights(calibration, exposures_in_turn(by_shot))
    if problem := depth_reversed(sights):
        return [ShotCheck(shot, {}, problem, tuple(calibration.views), sights=sights) for shot in by_shot]
    checks = (check_places(shot, exposures, calibration) for shot, exposures in by_shot.items())
    return [replace(check, sights=sights) for check in checks]


def exposures_in_turn(by_shot: Mapping[int, Sequence[Exposure]]) -> list[Exposure]:
    """Exposure A of every shot, then B of every shot."""
    return [one for one in chain.from_iterable(zip_longest(*by_shot.values())) if one is not None]


def check_places(shot: int, exposures: Sequence[Exposure], calibration: Calibration) -> ShotCheck:
    """Measure the disparity of every view in one shot, where depth is known not to be reversed.

    Droplets of all exposures tell together; where one exposure alone speaks against the calibration, that counts.
    """
    together = _checked(shot, exposures, calibration)
    if len(exposures) == 1 or together.verdict is Verdict.REFUSE:
        return together
    alone = (_checked(shot, [one], calibration, STOP_PX) for one in exposures)
    named = (_in_exposure(name, check) for name, check in zip(_EXPOSURES, alone, strict=False))
    return next((check for check in named if check.beyond or check.verdict is Verdict.REFUSE), together)


def _checked(
    shot: int, exposures: Sequence[Exposure], calibration: Calibration, limit_px: float = ALARM_PX
) -> ShotCheck:
    try:
        require_droplets(calibration, exposures)
        return _look(shot, exposures, calibration, limit_px)
    except CalibrationError as error:
        return _unmeasured(shot, exposures, calibration, error)


def _in_exposure(name: str, check: ShotCheck) -> ShotCheck:
    return replace(check, problem=f"exposure {name} by itself: {check.problem}") if check.problem else check


def _look(shot: int, exposures: Sequence[Exposure], calibration: Calibration, limit_px: float) -> ShotCheck:
    """Few droplets are enough where no view can be beyond the limit; if one may be, or they do not tell, many tell."""
    with suppress(CalibrationError):
        if (few := _measured(shot, exposures, calibration, FEW_SEEDS)).most_px < limit_px:
            return few
    return _measured(shot, exposures, calibration, MAX_SEEDS)


def _measured(shot: int, exposures: Sequence[Exposure], calibration: Calibration, seeds: int) -> ShotCheck:
    mappings = [view.mapping for view in calibration.views.values()]
    measured = shot_disparity(mappings, exposures, measured_box(calibration), seeds)
    return ShotCheck(shot, dict(zip(calibration.views, measured, strict=True)))


def _unmeasured(
    shot: int, exposures: Sequence[Exposure], calibration: Calibration, error: CalibrationError
) -> ShotCheck:
    """A shot without disparities: a view has moved too far for that, or the droplets do not tell."""
    names = list(calibration.views)
    mappings, box = [view.mapping for view in calibration.views.values()], measured_box(calibration)
    displaced = displaced_view(mappings, exposures, box)
    alone = strangers(mappings, exposures, box) if displaced is None else [displaced]
    if len(alone) == 1:
        name = names[alone[0]]
        problem = f"{name} has moved further than {REACH_PX:g} px, or shows other droplets: the other views agree"
        return ShotCheck(shot, {}, problem, (name,))
    if isinstance(error, OutOfRange):
        problem = f"{error}: a view has moved further than {REACH_PX:g} px, or several have"
        return ShotCheck(shot, {}, problem, tuple(names[number] for number in alone) or tuple(names))
    if alone:
        problem = f"{error}: several views have moved further than {REACH_PX:g} px, or most spots are noise"
        return ShotCheck(shot, {}, problem, tuple(names[number] for number in alone), agreed=False)
    told = "too few droplets, or too many, to tell whether a view has moved"
    return ShotCheck(shot, {}, f"{error}: {told}" if len(names) >= MIN_VIEWS else str(error))


def require_droplets(calibration: Calibration, exposures: Sequence[Exposure]) -> None:
    """Refuse exposures in none of which some view sees a droplet: the others cannot tell anything of it."""
    seen = zip(calibration.views, zip(*exposures, strict=True), strict=True)
    counts = {name: sum(map(len, droplets_px)) for name, droplets_px in seen}
    if blind := [name for name, count in counts.items() if not count]:
        by_view = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise CalibrationError(
            f"{', '.join(blind)}: no droplet is seen (droplets in {counted(len(exposures), 'exposure')}: {by_view}); "
            "is a lens covered, or a light off?"
        )
