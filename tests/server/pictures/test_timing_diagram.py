"""Requested and actual timing side by side, and the picture of it."""

import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq.run_plan import PulsePair, RunPlan
from daq.shot import FiredTrain, LightPulse
from daq.timing import CameraTiming, ShotTiming, plan_shot_timing
from server.pictures.timing_diagram import picture, timing_diagram
from server.rig.shot_timing import Guards, fired_timing, guards_of, timing_table
from tests.support.serving import Serving, plan_of

FAST = CameraTiming(1_000, 8_000, 500, 30_000_000, 16_000_000)
SLOW = CameraTiming(20_000, 1_500_000, 2_000, 60_000_000, 1_000_000)
CAMERAS = {"left": FAST, "right": SLOW}


def planned(separation_ns: int = 6400, left_a: float = 20.0, right_a: float = 10.0) -> ShotTiming:
    pulse = PulsePair(separation_ns=separation_ns, current_a={"left": left_a, "right": right_a})
    return plan_shot_timing(RunPlan(name="diagram", shots=1, pulse=pulse), CAMERAS)


def trained(timing: ShotTiming, shift_ns: int, grid_ns: int = 1) -> FiredTrain:
    """A generator that shifts all edges and rounds them down to its grid."""

    def edge(time_ns: int) -> int:
        return (time_ns + shift_ns) // grid_ns * grid_ns

    pulses = {
        name: tuple(
            LightPulse(edge(window.open_ns), window.close_ns - window.open_ns, view.current_a)
            for window in (view.pulse_a, view.pulse_b)
            if view.current_a
        )
        for name, view in timing.views.items()
    }
    return FiredTrain(1, {name: edge(view.camera_trigger_ns) for name, view in timing.views.items()}, pulses)


@settings(max_examples=50)
@given(
    shift_ns=st.integers(0, 2_000_000), separation_ns=st.integers(3_500, 100_000), left_a=st.sampled_from([0.0, 20.0])
)
def test_a_train_without_rounding_is_the_request(shift_ns: int, separation_ns: int, left_a: float) -> None:
    requested = planned(separation_ns, left_a)
    assert fired_timing(requested, CAMERAS, trained(requested, shift_ns)) == requested


def test_a_rounded_train_shows_the_rounding_and_exposures_follow_their_trigger() -> None:
    requested = planned(6403)
    actual = fired_timing(requested, CAMERAS, trained(requested, 1_600_000, grid_ns=8))
    table = timing_table(requested, actual)["left"]
    assert (table["requested"]["separation_ns"], table["actual"]["separation_ns"]) == (6403, 6400)
    for view, camera in ((actual.views[name], CAMERAS[name]) for name in CAMERAS):
        assert view.frame_a.close_ns - view.camera_trigger_ns == camera.frame_a_close_ns
        assert view.frame_b.open_ns - view.frame_a.close_ns == camera.gap_ns
    assert table["actual"]["guard_before_ns"] + 500 + table["actual"]["guard_after_ns"] == 6400 - 1000


def test_a_view_without_light_stays_dark() -> None:
    requested = planned(right_a=0.0)
    actual = fired_timing(requested, CAMERAS, trained(requested, 1_600_000))
    assert (actual.views["left"].current_a, actual.views["right"].current_a) == (20.0, 0.0)


def test_guards_are_the_distances_from_the_frame_boundary() -> None:
    assert guards_of(planned().views["left"]) == Guards(2450, 2450)


def texts(svg: bytes) -> list[str]:
    root = ElementTree.fromstring(svg)
    return [
        "".join(node.itertext()).replace("\N{NARROW NO-BREAK SPACE}", "")
        for node in root.iter()
        if node.tag.endswith("}text")
    ]


def test_the_drawing_names_every_distance_in_ns() -> None:
    written = texts(picture(timing_diagram(planned(right_a=0.0), "paper"), "svg"))
    assert {"paper", "separation 6400 ns", "gap 500 ns", "gap 2000 ns", "2450 ns", "1700 ns"} <= set(written)
    assert {"light, 20 A", "no light", "A: 8 µs", "whole shot [ms]"} <= set(written)
    assert written.count("1000 ns") == 4
    far = [text for text in written if "rising edge" in text]
    assert far == ["◂ rising edge at \N{MINUS SIGN}1517300 ns"], "the near trigger is drawn, the far one told"


def test_the_same_shot_gives_the_same_drawing() -> None:
    assert picture(timing_diagram(planned()), "svg") == picture(timing_diagram(planned()), "svg")


@pytest.mark.parametrize("separation_ns", [3_500, 6_400, 130_000])
def test_pulses_are_where_they_were_asked_for(separation_ns: int) -> None:
    """In pixels: amber pulses of the zoomed panel are as far apart as the axis says."""
    timing = plan_shot_timing(
        RunPlan(name="x", shots=1, pulse=PulsePair(separation_ns=separation_ns, current_a={"right": 10.0})),
        {"right": SLOW},
    )
    figure = timing_diagram(timing)
    encoded = np.frombuffer(picture(figure, "png"), np.uint8)
    pixels = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    assert pixels is not None
    lower = pixels[pixels.shape[0] // 2 :]
    amber = (np.abs(lower.astype(int) - (0, 169, 242)).max(axis=2) < 30).any(axis=0)
    columns = np.flatnonzero(amber)
    axes = figure.axes[1]
    scale_px = axes.transData.transform([[0, 0], [separation_ns + 1000, 0]])[:, 0]
    lit_px = (scale_px[1] - scale_px[0]) * 130 / figure.dpi
    assert columns[-1] - columns[0] == pytest.approx(lit_px, abs=5)


def test_titles_may_hold_anything() -> None:
    assert re.search(rb"a &lt;b&gt; &amp; c", picture(timing_diagram(planned(), "a <b> & c"), "svg"))


def test_the_api_draws_what_a_new_run_would_ask_for(server: Serving) -> None:
    answer = server.http.get("/api/rig/timing.svg", params={"separation_ns": 9000})
    assert answer.headers["content-type"] == "image/svg+xml"
    assert "separation 9000 ns" in texts(answer.content)


def test_the_api_refuses_pulses_that_the_cameras_cannot_separate(server: Serving) -> None:
    for separation_ns, reason in ((2000, "is below"), (1, "greater than or equal")):
        answer = server.http.get("/api/rig/timing.svg", params={"separation_ns": separation_ns})
        assert answer.status_code == 422
        assert reason in answer.json()["detail"]


def test_the_api_draws_what_a_run_has_fired(server: Serving) -> None:
    run_id, _ = server.run_to_its_end(plan_of(shots=1))
    written = texts(server.http.get(f"/api/runs/{run_id}/timing.svg").content)
    assert f"{run_id}: first shot as fired" in written
    assert written.count("light, 5 A") == 2


def test_the_api_has_no_diagram_of_an_absent_run(server: Serving) -> None:
    assert server.http.get("/api/runs/absent/timing.svg").status_code == 404
