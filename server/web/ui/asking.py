"""What a person asks for outside of the event loop, and how the page tells what came of it."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from nicegui import ui

from daq.errors import DaqError
from server.lab.errors import ServerError
from server.lab.jobs.job import Job, JobState
from server.web.ui.visiting import require_operator, told


async def queue(request: Callable[[], list[Job]]) -> None:
    """Ask for jobs in a thread, and say what came of it."""

    async def ask() -> None:
        text, is_work = answer_of(await asyncio.to_thread(request))
        ui.notify(text, type="positive" if is_work else "warning")

    await try_to(ask)


def answer_of(jobs: list[Job]) -> tuple[str, bool]:
    """What an operator is told of a request, and whether there is work to be done."""
    waiting = sum(job.state in (JobState.QUEUED, JobState.RUNNING) for job in jobs)
    if not jobs:
        return "nothing to do: the run has no valid shot", False
    if not waiting:
        return "nothing to do: it is done already", False
    return f"{waiting} {'job is' if waiting == 1 else 'jobs are'} queued, see Jobs", True


async def try_to(action: Callable[[], Awaitable[Any]]) -> None:
    """Do it for an operator, and say why it was refused."""
    try:
        require_operator()
        await action()
    except (DaqError, ServerError) as error:
        ui.notify(told(error), type="negative")
