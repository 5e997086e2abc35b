import xml.etree.ElementTree as ElementTree

import pytest

from daq.run_plan import PulsePair, RunPlan
from daq.timing import plan_shot_timing
from server.pictures.timing_sketch import timing_sketch
from tests.support.memory_rig import TIMING

VIEWS = ("view1", "view2")
SVG = "{http://www.w3.org/2000/svg}"


def sketch(width_ns: int = 1000, separation_ns: int = 6400, current_a: float = 5.0) -> ElementTree.Element:
    pulse = PulsePair(width_ns=width_ns, separation_ns=separation_ns, current_a=dict.fromkeys(VIEWS, current_a))
    plan = RunPlan(name="test", shots=1, pulse=pulse)
    return ElementTree.fromstring(timing_sketch(plan_shot_timing(plan, dict.fromkeys(VIEWS, TIMING))))


def pulses(root: ElementTree.Element) -> list[tuple[float, float]]:
    lit = [bar for bar in root.iter(f"{SVG}rect") if bar.get("height") == "10"]
    return [(float(bar.get("x", 0)), float(bar.get("width", 0))) for bar in lit]


@pytest.mark.parametrize(("width_ns", "separation_ns"), [(250, 2650), (1000, 6400), (2000, 19_000)])
def test_pulses_and_separation_are_to_scale(width_ns: int, separation_ns: int) -> None:
    root = sketch(width_ns, separation_ns)
    (a_px, a_width_px), (b_px, b_width_px), *others = pulses(root)
    assert len(others) == 2, "of the other view"
    assert a_width_px == b_width_px
    assert (b_px - a_px) / a_width_px == pytest.approx(separation_ns / width_ns, rel=0.05)


def test_a_pulse_lies_in_each_exposure_and_none_in_the_gap() -> None:
    root = sketch()
    bars = [bar for bar in root.iter(f"{SVG}rect") if bar.get("height") == "18"]
    (a_px, a_width_px), (b_px, b_width_px) = ((float(bar.get("x", 0)), float(bar.get("width", 0))) for bar in bars[:2])
    (first_px, first_width_px), (second_px, second_width_px) = pulses(root)[:2]
    assert a_px <= first_px < first_px + first_width_px <= a_px + a_width_px
    assert a_px + a_width_px < b_px <= second_px < second_px + second_width_px <= b_px + b_width_px


def test_without_current_there_is_no_pulse_and_that_is_told() -> None:
    root = sketch(current_a=0)
    assert pulses(root) == []
    assert "no light" in "".join(root.itertext())


def test_everything_is_inside_of_the_picture() -> None:
    root = sketch(2000, 19_000)
    _, _, width, height = map(float, root.get("viewBox", "").split())
    for bar in root.iter(f"{SVG}rect"):
        assert 0 <= float(bar.get("x", -1)) <= float(bar.get("x", -1)) + float(bar.get("width", -1)) <= width
    for text in root.iter(f"{SVG}text"):
        assert 0 <= float(text.get("y", -1)) <= height
