import asyncio

import pytest

from daq.errors import RecorderOverflow
from processing.errors import BadInput
from server.lab import duty as module
from server.lab.duty import Duty, Health
from server.lab.errors import NotFound
from server.lab.events import EventPublisher


def duty_of() -> tuple[Duty, EventPublisher]:
    events = EventPublisher()
    return Duty("counting", events), events


def test_an_item_that_fails_is_told_until_the_same_part_works_again() -> None:
    duty, events = duty_of()
    for _ in range(3):
        with duty.item("first"):
            raise ValueError("no number")
    with duty.item("second"):
        pass
    assert duty.lamp is not None
    assert (duty.lamp.health, duty.lamp.detail) == (Health.FAULT, "first: ValueError: no number")
    with duty.item("first"):
        pass
    assert duty.lamp is None
    assert [event.data["error"] for event in events.since(0)] == ["ValueError: no number", None]


def test_an_error_that_was_raised_on_purpose_is_told_by_its_text_alone() -> None:
    duty, _ = duty_of()
    for error in (BadInput("a.json: is empty"), RecorderOverflow("a.json: is empty"), NotFound("a.json: is empty")):
        duty.fail("first", error)
        assert duty.lamp is not None
        assert duty.lamp.detail == "first: a.json: is empty"


def test_a_loop_that_ends_by_an_error_is_started_again_after_a_pause_that_grows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    duty, _ = duty_of()
    pauses_s: list[float] = []
    starts = 0

    async def pause(period_s: float) -> None:
        pauses_s.append(period_s)

    async def work(duty: Duty) -> None:
        nonlocal starts
        starts += 1
        if starts == 9:
            with duty.item("first"):
                pass
            assert duty.lamp is None
        if starts < 11:
            raise ValueError(f"attempt {starts}")

    monkeypatch.setattr(module, "pause", pause)
    asyncio.run(duty.keep(work))
    assert pauses_s == [1, 2, 4, 8, 16, 32, 60, 60, 1, 2]
    assert duty.lamp is not None
    assert duty.lamp.detail == "its loop: ValueError: attempt 10"


def test_a_duty_can_be_cancelled() -> None:
    duty, _ = duty_of()

    async def work(duty: Duty) -> None:
        with duty.item("waiting"):
            await asyncio.Event().wait()

    async def go() -> bool:
        task = asyncio.create_task(duty.keep(work))
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.wait([task])
        return task.cancelled()

    assert asyncio.run(go())
    assert duty.lamp is None
