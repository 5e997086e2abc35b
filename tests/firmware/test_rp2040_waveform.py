"""Every edge of the real image, in ns: what the outputs do is what was planned, quantised, and answered."""

import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from daq.drivers.pulse_protocol import COUNTERS, FIELDS, Command, ErrorNumber, Reply
from tests.support.rp2040_board import CAMERA_PULSE_NS, PAPER, PERIOD_MS, Board, Channel, Waveform

TICK_NS = 8
SERIES_SHOTS = int(os.environ.get("TOMOSHADOW_SERIES_SHOTS", "80"))
PLANS = int(os.environ.get("TOMOSHADOW_PLANS", "12"))
"""``make mutants`` shoots 1000, and tries 100 plans."""
HEADER = (Path(__file__).resolve().parents[2] / "firmware" / "core" / "limits.h").read_text()
LIMIT = {name: int(value) for name, value in re.findall(r"(\w+) = (\d+)", HEADER)}


@pytest.fixture(scope="module")
def shared() -> Board:
    board = Board()
    board.pico.run_ms(2 * PERIOD_MS)  # a start waits for the period of any train
    return board


@pytest.fixture
def board(shared: Board) -> Iterator[Board]:
    yield shared
    shared.ask(Command.OFF)
    shared.pico.run_ms(PERIOD_MS)


def quantised(channel: Channel) -> Channel:
    def nearest(time_ns: int) -> int:
        return (time_ns + TICK_NS // 2) // TICK_NS * TICK_NS

    names = ("camera_ns", "a_start_ns", "a_width_ns", "b_start_ns", "b_width_ns")
    return replace(channel, **{name: nearest(getattr(channel, name)) for name in names})


def answered(reply: Reply) -> Channel:
    return Channel(**{name: reply.number(name) for name in FIELDS[Command.CHANNEL].reply[1:]})


def planned(channels: list[Channel | None]) -> Waveform:
    return sorted(edge for i, channel in enumerate(channels) if channel for edge in channel.edges(i))


def test_it_boots_through_the_boot_rom_and_says_who_it_is(board: Board) -> None:
    identity = board.ask(Command.ID)
    assert identity.fields["model"] == "tomoshadow-pulse"
    assert (identity.fields["build"], identity.number("channels"), identity.number("tick_ns")) == ("rp2040", 4, TICK_NS)
    assert identity.boot >= 1
    assert board.ask(Command.STATUS).fields == (
        {"interlock": "1", "estop": "1"} | dict.fromkeys(("state", "faults", "source", "shots_left", *COUNTERS), "0")
    )


def test_the_pulse_pair_of_the_paper(board: Board) -> None:
    board.configure([PAPER] * 4)
    board.arm(1)
    waveform = board.shoot()
    assert waveform == planned([PAPER] * 4)
    for i in range(4):
        a_on, a_off, b_on, b_off = (at for at, output, _ in waveform if output == f"light{i}")
        assert (a_off - a_on, b_off - b_on, b_on - a_on) == (1000, 1000, 6400)
    assert (26_400 - 20_000) / TICK_NS == 800


def test_trims_of_one_tick_and_a_lead_for_each_channel(board: Board) -> None:
    channels: list[Channel | None] = [
        replace(
            PAPER, camera_ns=1000 * i, a_start_ns=20_000 - 8 * i, a_width_ns=1000 + 8 * i, b_width_ns=1000 - 8 * i
        ).straddling()
        for i in range(4)
    ]
    board.configure(channels)
    board.arm(1)
    assert board.shoot() == planned(channels)


LAST_NS = LIMIT["MAX_EDGE_NS"]
EXTREMES = {
    "shortest and closest, at once": Channel(0, 0, 200, 600, 200),
    "longest and widest": Channel(0, 8, 2000, 200_008, 2000),
    "short then long": Channel(5000, 100_000, 200, 102_000, 2000),
    "long then short": Channel(5000, 100_000, 2000, 102_400, 200),
    "the last edges": Channel(LAST_NS, LAST_NS - 200_000, 1000, LAST_NS, 2000),  # two frames of no length
}


@pytest.mark.parametrize("name", EXTREMES)
def test_the_limits(board: Board, name: str) -> None:
    channel = EXTREMES[name].straddling()
    channels: list[Channel | None] = [None, channel, None, None]
    board.configure(channels)
    board.arm(1)
    assert board.shoot(PERIOD_MS + LAST_NS / 1e6) == planned(channels)


@pytest.mark.parametrize(
    ("channel", "error"),
    [
        (replace(PAPER, a_width_ns=2001), ErrorNumber.WIDTH),
        (replace(PAPER, b_width_ns=199), ErrorNumber.WIDTH),
        (replace(PAPER, b_start_ns=220_001), ErrorNumber.SEPARATION),
        (replace(PAPER, a_start_ns=LAST_NS + 1), ErrorNumber.EDGE),
        (replace(PAPER, current_ma=30_001), ErrorNumber.CURRENT),
        (replace(PAPER, frame_a_close_ns=20_999), ErrorNumber.STRADDLE),
    ],
)
def test_beyond_the_limits_nothing_is_loaded(board: Board, channel: Channel, error: ErrorNumber) -> None:
    board.ask(Command.NEW)
    fields = (getattr(channel, name) for name in FIELDS[Command.CHANNEL].request[1:])
    assert board.ask(Command.CHANNEL, 0, *fields).error is error
    assert board.ask(Command.LOAD).error is ErrorNumber.NO_TRAIN


@st.composite
def channels(draw: st.DrawFn) -> Channel:
    a_width_ns, b_width_ns = draw(st.integers(200, 2000)), draw(st.integers(200, 2000))
    a_start_ns = draw(st.integers(0, 150_000))
    longest_ns = LIMIT["MAX_SEPARATION_NS"] - a_width_ns - TICK_NS
    gap_ns = draw(st.integers(LIMIT["MIN_DARK_NS"] + 2 * TICK_NS, longest_ns))
    camera_ns = draw(st.integers(0, a_start_ns))
    current_ma = draw(st.sampled_from([0, 10, 9_900, LIMIT["MAX_CURRENT_MA"]]))
    return Channel(
        camera_ns, a_start_ns, a_width_ns, a_start_ns + a_width_ns + gap_ns, b_width_ns, current_ma
    ).straddling()


@settings(max_examples=PLANS)
@given(plan=st.lists(st.none() | channels(), min_size=4, max_size=4).filter(any))
def test_any_plan_is_fired_as_answered(shared: Board, plan: list[Channel | None]) -> None:
    replies = iter(shared.configure(plan))
    actual = [channel and answered(next(replies)) for channel in plan]
    for channel, answer in zip(plan, actual, strict=True):
        if channel and answer:
            assert replace(answer, frame_a_close_ns=0, frame_b_open_ns=0) == replace(
                quantised(channel), frame_a_close_ns=0, frame_b_open_ns=0
            )
    shared.arm(1)
    assert shared.shoot() == planned(actual)
    assert shared.pico.shot_set_points_ma == tuple(channel.current_ma if channel else 0 for channel in plan)
    assert shared.pico.set_points_ma() == (0, 0, 0, 0), "they are zeroed after the last shot"


def test_a_series_has_no_jitter(board: Board) -> None:
    board.configure([PAPER] * 4)
    board.arm(SERIES_SHOTS)
    first = board.shoot()
    for _ in range(SERIES_SHOTS - 1):
        assert board.shoot() == first
    assert board.ask(Command.STATUS).number("state") == 0
    assert not any(board.pico.levels().values())


def test_a_dark_channel_triggers_its_camera_alone(board: Board) -> None:
    dark = replace(PAPER, current_ma=0)
    board.configure([dark, None, PAPER, None])
    board.arm(1)
    waveform = board.shoot()
    assert waveform == planned([dark, None, PAPER, None])
    assert [edge for edge in waveform if edge[1].endswith("0")] == [
        (0, "camera0", True),
        (CAMERA_PULSE_NS, "camera0", False),
    ]
