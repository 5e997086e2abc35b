"""What is made of recorded shots by itself: what the plan of their run states, and nothing else."""

import asyncio

from daq.recipe import Recipe
from daq.run.events import ShotRecorded
from daq.run_plan import RunKind
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.droplets.measure_settings import MeasureSettings
from server.lab.droplets.measurement import queue_measurement
from server.lab.duty import Duty
from server.lab.events import RUN_EVENTS
from server.lab.recipes.stated import settings_of
from server.lab.reconstruction import request_reconstruction
from server.lab.services import Context

_SHOT_RECORDED = RUN_EVENTS[ShotRecorded]


async def follow_acquisition(context: Context, duty: Duty) -> None:
    """Queue jobs for every shot that is recorded from now on; acquisition knows nothing of it."""
    events = context.services.events
    async for event in events.follow(events.newest):
        if event is not None and event.name == _SHOT_RECORDED and event.data["valid"]:
            with duty.item("recorded shots"):
                await asyncio.to_thread(follow_recipes, context, event.data["run_id"], event.data["index"])


def follow_recipes(context: Context, run_id: str, shot: int) -> None:
    """Queue what is made of a recorded shot, if its run has a calibration, and it is not a single shot."""
    if context.unkept_runs.has(run_id):
        return
    summary = context.runs.summary(run_id)
    if summary.kind is RunKind.SAMPLE and summary.calibration is not None:
        for recipe in summary.recipes or ():
            _queue(context, run_id, shot, summary.calibration, recipe)


def _queue(context: Context, run_id: str, shot: int, calibration: str, recipe: Recipe) -> None:
    settings = settings_of(recipe)
    if isinstance(settings, ReconstructionSettings):
        request_reconstruction(context, run_id, [shot], calibration, settings)
    elif isinstance(settings, MeasureSettings):
        queue_measurement(context, run_id, [shot], calibration, settings)
