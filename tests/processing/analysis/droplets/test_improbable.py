"""What is told must be probable, and what is not known is no doubt."""

from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets import bright_shot
from processing.analysis.droplets.bright_shot import BrightExposure, measure_bright
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.droplets.verdicts.improbable import judged_by_probability
from tests.support.bright_scenes import scene, search_of


@pytest.fixture(scope="module")
def shot() -> BrightExposure:
    truth = scene()
    return measure_bright(truth.images, search_of(truth))


@pytest.mark.parametrize(
    ("improbable", "verdict"),
    [(0.0, ShotVerdict.GOOD), (0.15, ShotVerdict.GOOD), (0.3, ShotVerdict.DOUBTFUL), (1.0, ShotVerdict.DOUBTFUL)],
)
def test_where_too_many_are_improbable_the_shot_is_doubtful(
    shot: BrightExposure, improbable: float, verdict: ShotVerdict
) -> None:
    p_real = np.ones(len(shot.droplets))
    p_real[: round(improbable * len(p_real))] = 0.05
    told = judged_by_probability(replace(shot, droplets=replace(shot.droplets, p_real=p_real)))
    assert told.verdict is verdict
    assert [" % are expected to be ghosts, limit 20 %" in reason for reason in told.reasons] == [True] * len(
        told.reasons
    )


def test_what_is_not_known_is_no_doubt(shot: BrightExposure) -> None:
    assert shot.verdict is ShotVerdict.GOOD
    assert judged_by_probability(replace(shot, droplets=shot.droplets.unsure())).verdict is ShotVerdict.GOOD


def test_it_is_asked_of_every_shot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bright_shot, "REALITY", replace(bright_shot.REALITY, base=-40.0))
    truth = scene()
    told = measure_bright(truth.images, search_of(truth))
    assert told.verdict is ShotVerdict.DOUBTFUL
    assert "are expected to be ghosts" in told.reasons[-1]
    assert np.isnan(told.droplets.p_real).all(), "of a doubtful shot nobody knows"
