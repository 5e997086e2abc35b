from collections.abc import Callable

import numpy as np
import pytest

from daq.run_plan import ImageKey
from daq.shot import DoubleFrame, ExposureRecord, FiredTrain, LightPulse, Shot
from server.lab.live_view.light_assistant import SeenLight, advise, seen_light

Lamp = Callable[[float], float]
"""Light in percent of the range by current; what is above 100 saturates."""


def see(lamp: Lamp, current_a: float) -> SeenLight:
    light = lamp(current_a)
    return SeenLight(current_a, min(light, 100.0), 30.0 if light > 100 else 0.0)


def follow(lamp: Lamp, current_a: float, limit_a: float, presses: int = 6) -> list[SeenLight]:
    """What is seen when an operator presses the button again and again."""
    seen = [see(lamp, current_a)]
    for _ in range(presses):
        advice = advise(seen, limit_a)
        if advice.current_a is None:
            break
        seen.append(see(lamp, advice.current_a))
    return seen


@pytest.mark.parametrize("start_a", [0.5, 2.0, 10.0, 24.0])
@pytest.mark.parametrize("gain", [2.5, 5.0, 12.0])
def test_a_proportional_lamp_comes_to_half_of_the_range(start_a: float, gain: float) -> None:
    seen = follow(lambda current_a: gain * current_a, start_a, 26.0)
    assert seen[-1].light_percent == pytest.approx(50, abs=3)
    if not (seen[0].is_dark or seen[0].is_saturated):
        assert len(seen) <= 2, "one press is enough"


@pytest.mark.parametrize("offset", [4.0, 20.0, -15.0])
def test_a_lamp_that_is_not_proportional_comes_there_too_and_is_told(offset: float) -> None:
    seen = follow(lambda current_a: max(0.0, offset + 4 * current_a), 4.0, 26.0)
    assert seen[-1].light_percent == pytest.approx(50, abs=3)
    if offset > 0:
        assert "not proportional" in advise(seen[:2], 26.0).text


@pytest.mark.parametrize("seed", range(20))
def test_no_advice_exceeds_the_limit_or_is_negative(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        limit_a = float(rng.uniform(0.1, 30))
        seen = [
            SeenLight(float(rng.uniform(0, 30)), float(rng.uniform(0, 100)), float(rng.choice([0, 0.05, 2])))
            for _ in range(rng.integers(1, 5))
        ]
        advice = advise(seen, limit_a)
        assert advice.text
        if advice.current_a is not None:
            assert 0 <= advice.current_a <= limit_a
            assert f"{advice.current_a:g} A" in advice.text


def test_a_lamp_that_is_too_weak_stays_at_its_limit_and_says_what_helps() -> None:
    advice = advise([SeenLight(10.0, 20.0)], 12.0)
    assert advice.current_a == 12.0
    assert "its limit, about 24 %; for more light open the aperture" in advice.text


def test_saturated_light_is_not_known_and_is_halved() -> None:
    advice = advise([SeenLight(20.0, 90.0, saturated_percent=5.0)], 26.0)
    assert (advice.current_a, "saturated" in advice.text) == (10.0, True)


def test_where_no_light_comes_at_the_limit_nothing_is_changed() -> None:
    advice = advise([SeenLight(26.0, 1.6)], 26.0)
    assert (advice.current_a, "is the lens covered" in advice.text) == (None, True)


def test_more_current_without_more_light_is_no_lamp() -> None:
    advice = advise([SeenLight(5.0, 30.0), SeenLight(10.0, 28.0)], 26.0)
    assert (advice.current_a, "no more light" in advice.text) == (None, True)


@pytest.mark.parametrize("light", [48.0, 50.0, 52.5])
def test_what_is_near_enough_is_left_alone(light: float) -> None:
    assert advise([SeenLight(9.0, light)], 12.0).current_a is None


def test_a_shot_says_what_was_fired_and_the_brighter_exposure_counts() -> None:
    dim, bright, seen = np.full((20, 20), 60, np.uint8), np.full((20, 20), 100, np.uint8), ExposureRecord(True, 1)
    views = {
        "lit": DoubleFrame(dim, bright, seen, seen),
        "half": DoubleFrame(dim, bright, seen, ExposureRecord(valid=False)),
        "gone": DoubleFrame(dim, bright, ExposureRecord(valid=False), ExposureRecord(valid=False)),
    }
    train = FiredTrain(1, pulses={"lit": (LightPulse(0, 1000, 9.5), LightPulse(6400, 1000, 9.5))})
    found = seen_light(Shot(0, ImageKey.SAMPLE, views, train), dict.fromkeys(views, 8))
    assert found == {"lit": SeenLight(9.5, 39.2), "half": SeenLight(0.0, 23.5)}
