"""The web application: REST, events, live view and page in one process; ``serve`` runs it."""

import asyncio
import contextlib
import signal
import socket
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, closing
from functools import partial
from importlib.metadata import version
from types import FrameType
from typing import Any

import uvicorn
from fastapi import Depends, FastAPI, Request
from starlette.exceptions import HTTPException
from starlette.routing import Match

from daq.errors import DaqError
from processing.runs.volumes.volume_parts import VolumeParts
from server.lab.calibrations import CalibrationStore
from server.lab.desk.control import Control
from server.lab.desk.desk_watch import DeskWatch
from server.lab.desk.once import Once
from server.lab.desk.request_table import REQUESTS_FILE, opened_requests
from server.lab.duty import Duty, Work
from server.lab.jobs.job_recovery import opened_table
from server.lab.jobs.job_table import JobTable
from server.lab.live_view.live_feed import LiveFeed
from server.lab.live_view.live_volume import LiveVolume
from server.lab.monitor import RigMonitor
from server.lab.recipes.by_itself import follow_acquisition
from server.lab.runner import JobRunner
from server.lab.runs.run_index import INDEX_FILE, RunIndex
from server.lab.runs.run_store import RunStore
from server.lab.runs.unkept_runs import UnkeptRuns
from server.lab.services import Context, Services
from server.lab.starting.abort import abort_all
from server.lab.starting.alarms_now import alarms_now
from server.lab.starting.readiness import reasons_against
from server.lab.watch import CalibrationWatch
from server.web import port, problems
from server.web.abort_listener import AbortListener
from server.web.api import (
    bench,
    calibrations,
    devices,
    events,
    jobs,
    live,
    live_view,
    live_volume,
    rig,
    runs,
    shots,
    sign_in,
    single_shot,
    timing,
)
from server.web.api.desk import alarms, beat, control, readiness
from server.web.api.parameters import forbid_half_characters, forbid_unknown_query
from server.web.api.results import droplets, results, statistics, volume_parts
from server.web.body_limit import BodyLimit
from server.web.connections import config_of
from server.web.door import Door
from server.web.guard import Guard
from server.web.keys import Keys
from server.web.readings import Readings
from server.web.stream_cap import StreamCap
from server.web.ui.page import mount_page

_RESOURCES = (
    rig,
    devices,
    readiness,
    alarms,
    live_view,
    live_volume,
    single_shot,
    runs,
    shots,
    droplets,
    results,
    volume_parts,
    statistics,
    calibrations,
    jobs,
    events,
    bench,
    control,
    timing,
)
_REFUSING = [Depends(forbid_unknown_query), Depends(forbid_half_characters)]
_METHODS = ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"]
_DUTIES = ("processing", "automatic reconstruction", "lamps", "state of the rig", "live view")


def create_app(services: Services, abort_port: socket.socket | None = None) -> FastAPI:
    """Build the application.

    Parameters
    ----------
    services : Services
        Opened rig, acquisition, engine (started and ended with the application), configuration.
    abort_port : socket | None
        Where ABORT alone is listened for; None: any free port.
    """
    app = create_api(services, abort_port)
    mount_page(app, services.config)
    return app


def create_api(services: Services, abort_port: socket.socket | None = None) -> FastAPI:
    """Build the application without the page."""
    app = FastAPI(
        title="tomoshadow",
        version=version("tomoshadow"),
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        lifespan=lambda app: _life(app, services, abort_port),
        responses=problems.responses(400, 401, 403, 408, 413, 422, 429),
    )
    problems.install(app)
    for resource in _RESOURCES:
        app.include_router(resource.router, dependencies=_REFUSING)
    app.include_router(live.router)
    app.include_router(beat.router)
    app.include_router(sign_in.router)
    app.add_api_route("/api/{path:path}", _nothing_here, methods=_METHODS, include_in_schema=False)
    door = app.state.door = Door(Keys.of(services.config.server))
    problems.describe(app)
    app.add_middleware(StreamCap)
    app.add_middleware(Readings)
    app.add_middleware(BodyLimit)
    app.add_middleware(
        Guard, door=door, host_names=services.host_names, abort_port=lambda: app.state.abort_listener.port
    )
    return app


class _Server(uvicorn.Server):
    """Tells by which signal it ends before it waits for anything: a run makes light until then."""

    def __init__(self, config: uvicorn.Config, leave: Callable[[str], None]) -> None:
        super().__init__(config)
        self._leave = leave
        self._ended_by = ""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._ended_by = self._ended_by or f" by {signal.Signals(sig).name}"
        super().handle_exit(sig, frame)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await asyncio.to_thread(self._leave, f"the server was ended{self._ended_by}")
        await super().shutdown(sockets)


def serve(app: FastAPI, listener: socket.socket, leave: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM, then return. One process: acquisition, jobs and pages share its state.

    Parameters
    ----------
    app : FastAPI
        What to serve.
    listener : socket
        Where; listens already.
    leave : Callable[[str], None]
        Gets the cause within a tenth of a second of the signal, before clients and jobs are waited for.

    Raises
    ------
    DaqError
        The application did not start; the log says why.
    """
    server = _Server(config_of(app), leave)
    # The server passes a signal on once it has ended. By default SIGTERM would then kill the process before the caller
    # has switched off the light and closed the devices.
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with contextlib.suppress(KeyboardInterrupt):
            server.run(sockets=[listener])
    finally:
        signal.signal(signal.SIGTERM, previous)
    if not server.started:
        raise DaqError("the server did not start: the lines above say why")


@asynccontextmanager
async def _life(app: FastAPI, services: Services, abort_port: socket.socket | None) -> AsyncIterator[None]:
    services.data_dir.mkdir(parents=True, exist_ok=True)
    services.events.attach()
    async with AsyncExitStack() as stack:
        stack.callback(services.events.detach)
        jobs_table = stack.enter_context(opened_table(services.data_dir, services.events))
        await stack.enter_async_context(services.engine)
        index = stack.enter_context(closing(RunIndex(services.data_dir / INDEX_FILE)))
        requests = stack.enter_context(opened_requests(services.data_dir / REQUESTS_FILE, services.events))
        context = app.state.context = _context(services, jobs_table, index, Once(table=requests))
        stack.callback(context.monitor.close)
        held = abort_port or stack.enter_context(port.listening(services.config.server.host, 0))
        app.state.abort_listener = stack.enter_context(_abort_listener(services, held))
        await context.monitor.ask()
        follow = partial(follow_acquisition, context)
        works: tuple[Work, ...] = (
            context.runner.run,
            follow,
            context.monitor.run,
            context.desk.run,
            context.live.run,
        )
        for duty, work in zip(context.duties, works, strict=True):
            await stack.enter_async_context(_in_background(duty.keep(work)))
        yield


def _abort_listener(services: Services, held: socket.socket) -> AbortListener:
    has_token = Keys.of(services.config.server).are_any
    names = None if has_token else [name.lower() for name in services.host_names]
    return AbortListener(partial(abort_all, services), held, names)


def _context(services: Services, table: JobTable, index: RunIndex, once: Once) -> Context:
    store = CalibrationStore(services.data_dir / "calibrations")
    watch = CalibrationWatch(services.events)
    acquisition, period_s = services.acquisition, services.asked_every_s

    def resting() -> bool:
        return acquisition.status().resting

    context = Context(
        services=services,
        runs=RunStore(services.data_dir, acquisition.status, index),
        unkept_runs=UnkeptRuns(services.data_dir, table),
        calibrations=store,
        jobs=table,
        runner=JobRunner(services.engine, table, services.tasks, services.events, services.data_dir, store, watch),
        watch=watch,
        monitor=RigMonitor(services.rig, services.data_dir, resting, services.laboratory, period_s=period_s),
        desk=DeskWatch(
            acquisition.status,
            lambda: reasons_against(context),
            lambda: alarms_now(context),
            period_s=period_s / 2,
        ),
        live=LiveFeed(services.rig.cameras, lambda: acquisition.newest_shot, acquisition.keep_live),
        live_volume=LiveVolume(
            services.rig.cameras,
            store,
            lambda: acquisition.newest_shot,
            lambda: acquisition.status().state,
            services.settings,
        ),
        parts=VolumeParts(),
        control=Control(lambda: not resting(), services.events.publish),
        once=once,
        duties=tuple(Duty(name, services.events) for name in _DUTIES),
    )
    return context


@asynccontextmanager
async def _in_background(work: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    task = asyncio.create_task(work)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def _nothing_here(request: Request) -> None:
    """Answer unknown paths below /api here: behind the page's mount they would get HTML."""
    if allowed := _methods_of(request):
        raise HTTPException(405, headers={"Allow": ", ".join(allowed)})
    raise HTTPException(404, f"there is nothing at {request.url.path}")


def _methods_of(request: Request) -> list[str]:
    """Methods of a path that has none for the method of this request: every method is a route of its own."""
    routes = (route for resource in _RESOURCES for route in resource.router.routes)
    matching = (route for route in routes if route.matches(request.scope)[0] is Match.PARTIAL)
    return sorted({method for route in matching for method in getattr(route, "methods", None) or ()})
