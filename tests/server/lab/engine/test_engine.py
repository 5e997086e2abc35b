import asyncio
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from dask import config

from server.lab.engine import dask_engine
from server.lab.engine.dask_engine import DaskEngine
from server.lab.engine.inline_engine import InlineEngine
from server.lab.engine.task import Engine, TaskAborted, TaskError, Unavailable

ENGINES = pytest.mark.parametrize("make", [InlineEngine, DaskEngine])


def wait_for_module(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    deadline_s = time.monotonic() + 30
    while job["module"] not in sys.modules and time.monotonic() < deadline_s:
        time.sleep(0.02)
    names = ("MALLOC_MMAP_THRESHOLD_", "OMP_NUM_THREADS")
    return {"loaded": job["module"] in sys.modules, **{name: os.environ.get(name) for name in names}}


def double(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    should_stop()
    return {"value": 2 * job["value"]}


def refuse(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    raise ValueError(f"volume {job['value']} is empty")


def step_until_stopped(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    tick = threading.Event()
    while not should_stop():
        tick.wait(0.01)
    return {}


def die_once(job: dict[str, Any], should_stop: Callable[[], bool]) -> dict[str, Any]:
    mark = Path(job["mark"])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"niceness": os.nice(0)}


async def _observe(engine: Engine, tmp_path: Path) -> dict[str, Any]:
    """What an engine answers, task by task; that of a worker that dies once only where there are workers."""
    async with engine:
        seen: dict[str, Any] = {"result": await engine.submit("a", double, {"value": 21}, _ignore)}
        try:
            await engine.submit("b", refuse, {"value": 7}, _ignore)
        except TaskError as error:
            seen["error"] = str(error)
        seen["aborted"], seen["steps"] = await _abort_a_running_task(engine)
        if isinstance(engine, DaskEngine):
            seen["survived"] = await engine.submit("d", die_once, {"mark": str(tmp_path / "mark")}, _ignore)
    return seen


async def _abort_a_running_task(engine: Engine) -> tuple[bool, list[int]]:
    steps: list[int] = []
    going = asyncio.Event()

    def on_progress(count: int) -> None:
        steps.append(count)
        if count > 0:
            going.set()

    running = asyncio.ensure_future(engine.submit("c", step_until_stopped, {}, on_progress))
    await asyncio.wait_for(going.wait(), 20)
    await engine.abort("c")
    try:
        await asyncio.wait_for(running, 20)
    except TaskAborted:
        return True, steps
    return False, steps


def _ignore(_: int) -> None:
    pass


@ENGINES
def test_an_engine_returns_results_reports_errors_obeys_aborts_and_outlives_its_workers(
    make: Callable[[], Engine], tmp_path: Path
) -> None:
    seen = asyncio.run(_observe(make(), tmp_path))
    assert seen["result"] == {"value": 42}
    assert "ValueError: volume 7 is empty" in seen["error"]
    assert seen["aborted"]
    assert seen["steps"][0] == 0
    assert seen["steps"] == sorted(seen["steps"])
    assert seen.get("survived") == (None if make is InlineEngine else {"niceness": min(19, os.nice(0) + 10)})


@ENGINES
def test_a_task_for_which_nobody_waits_any_more_does_not_stay_behind(make: Callable[[], Engine]) -> None:
    """Its one worker is free again, and what asks for the same work anew has no second writer beside it."""

    async def go() -> dict[str, Any]:
        async with make() as engine:
            going = asyncio.Event()
            waiting = asyncio.ensure_future(
                engine.submit("a", step_until_stopped, {}, lambda steps: going.set() if steps else None)
            )
            await asyncio.wait_for(going.wait(), 60)
            waiting.cancel()
            await asyncio.wait({waiting})
            return await asyncio.wait_for(engine.submit("b", double, {"value": 21}, _ignore), 10)

    assert asyncio.run(go()) == {"value": 42}


def test_an_engine_that_was_not_started_says_so() -> None:
    with pytest.raises(TaskError, match="not running"):
        asyncio.run(DaskEngine().abort("x"))


def test_whoever_starts_workers_does_not_wait_for_them_and_a_task_is_told_that_they_did_not_start() -> None:
    async def go() -> None:
        engine = DaskEngine(memory_limit="much")
        with pytest.raises(StopIteration):  # it never gives the loop away
            engine.__aenter__().send(None)
        try:
            await engine.submit("a", double, {"value": 21}, _ignore)
        finally:
            await engine.close()

    with pytest.raises(Unavailable, match="the workers did not start: ValueError"):
        asyncio.run(go())


def test_workers_that_could_not_start_are_started_again_by_a_later_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.touch()  # no folder: as where a disk is not mounted

    async def go() -> dict[str, Any]:
        with config.set({"temporary-directory": str(scratch)}):
            async with DaskEngine() as engine:
                for _ in range(2):
                    with pytest.raises(Unavailable, match="the workers did not start"):
                        await engine.submit("a", double, {"value": 20}, _ignore)
                scratch.unlink()
                monkeypatch.setattr(dask_engine, "START_AGAIN_S", 0.0)
                return await engine.submit("b", double, {"value": 21}, _ignore)

    assert asyncio.run(go()) == {"value": 42}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # of what tests before have left
def test_workers_that_could_not_start_and_that_nobody_needed_end_without_a_word() -> None:
    complaints: list[dict[str, Any]] = []

    async def go() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
        async with DaskEngine(memory_limit="much"):
            pass
        gc.collect()

    asyncio.run(go())
    assert complaints == []


def test_workers_load_what_they_are_told_to_before_a_task_needs_it_and_keep_their_memory() -> None:
    module = "colorsys"  # nothing else loads it

    async def go() -> dict[str, Any]:
        async with DaskEngine(modules=[module]) as engine:
            return await engine.submit("a", wait_for_module, {"module": module}, _ignore)

    expected = {"loaded": True, "MALLOC_MMAP_THRESHOLD_": str(32 << 20), "OMP_NUM_THREADS": "1"}
    assert asyncio.run(go()) == expected
