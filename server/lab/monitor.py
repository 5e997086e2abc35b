"""RigMonitor: the lamps. Asks every device once a second, and opens again what was lost, outside the event loop.

Each device has a thread of its own: one that is slow makes no other lamp old.
"""

import asyncio
import contextlib
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from daq.devices import Camera, Device, DeviceIdentity, GeneratorState, Rig, TranslationStage
from daq.errors import DaqError
from server.lab.duty import Duty, Health, Lamp, pause
from server.lab.errors import Conflict, NotFound, told
from server.rig.laboratory import Laboratory

PERIOD_S = 1.0
"""Every device is asked so often."""
STALE_S = 2.5
"""No lamp is green whose answer is older; devices are asked once a second, and have a second to answer."""
_LOW_DISK_BYTES = 20e9

Look = Callable[[], tuple[Health, str]]
"""Asks a device; health and detail of its lamp, or an error if it does not answer."""
Clock = Callable[[], float]


def _ask_who(laboratory: Laboratory) -> tuple[Health, str]:
    return Health.OK, laboratory.ask()


def _always() -> bool:
    return True


class RigMonitor:
    """Watches a rig.

    Parameters
    ----------
    rig : Rig
        Opened devices.
    data_dir : Path
        Its file system must have room for runs.
    resting : Callable[[], bool]
        No run is under way: what was lost may be opened again.
    laboratory : Laboratory | None
        Of a simulated rig. It has a lamp where it runs in another process.
    now_s : Callable[[], float]
        A clock that never goes back.
    period_s : float
        Every device is asked so often.
    """

    def __init__(
        self,
        rig: Rig,
        data_dir: Path,
        resting: Callable[[], bool] = _always,
        laboratory: Laboratory | None = None,
        now_s: Clock = time.monotonic,
        period_s: float = PERIOD_S,
    ) -> None:
        self._rig = rig
        self._data_dir = data_dir
        self._resting = resting
        self._laboratory = laboratory
        self._period_s = period_s
        self._who: dict[str, DeviceIdentity] = {}
        self._watched = tuple(_Watched(name, kind, look, now_s) for name, kind, look in self._looks())
        self._threads = {name: ThreadPoolExecutor(1, f"lamp {name}") for name, _, _ in self._looks()}

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """What every device answers; never green where that is long ago."""
        return tuple(watched.lamp for watched in self._watched)

    @property
    def identities(self) -> Mapping[str, DeviceIdentity]:
        """Who the devices are that have said so, by the names of their lamps."""
        return dict(self._who)

    async def reconnect(self, name: str) -> None:
        """Ask a device now who and how it is, and open it again if it was lost.

        Raises
        ------
        NotFound
            No lamp has this name.
        Conflict
            A run is under way.
        """
        watched = next((one for one in self._watched if one.name == name), None)
        if watched is None:
            raise NotFound(f"there is no device {name!r}")
        if not self._resting():
            raise Conflict(f"{name}: devices are opened again between runs only; wait for the end of what goes on")
        self._who.pop(name, None)
        await self._ask(watched)

    async def run(self, duty: Duty) -> None:
        """Ask until cancelled."""
        async with asyncio.TaskGroup() as group:
            for watched in self._watched:
                group.create_task(self._keep_asking(watched, duty))

    def close(self) -> None:
        """Ask no more: the threads end, one that waits for a silent device when it has been answered or not."""
        for thread in self._threads.values():
            thread.shutdown(wait=False, cancel_futures=True)

    async def ask(self) -> None:
        """Ask every device once."""
        await asyncio.gather(*map(self._ask, self._watched))

    async def _keep_asking(self, watched: "_Watched", duty: Duty) -> None:
        while True:
            with duty.item(watched.name):
                await self._ask(watched)
            await pause(self._period_s)

    async def _ask(self, watched: "_Watched") -> None:
        await asyncio.get_running_loop().run_in_executor(self._threads[watched.name], watched.ask)

    def _looks(self) -> Iterator[tuple[str, str, Look]]:
        for view, camera in self._rig.cameras.items():
            yield view, "camera", partial(self._camera, view, camera)
        yield "pulse generator", "generator", self._generator
        yield "interlock", "interlock", self._interlock
        if self._rig.stage is not None:
            yield "stage", "stage", partial(self._stage, self._rig.stage)
        yield "disk", "disk", self._disk
        if self._laboratory is not None and self._laboratory.is_apart:
            yield "far ends", "simulator", partial(_ask_who, self._laboratory)

    def _camera(self, view: str, camera: Camera) -> tuple[Health, str]:
        with self._known(view, camera):
            if self._resting():
                camera.recover()
            camera.ask()
        return Health.OK, self._told(view)

    def _stage(self, stage: TranslationStage) -> tuple[Health, str]:
        with self._known("stage", stage):
            if self._resting():
                stage.recover()
            stage.position_mm()
        return Health.OK, self._told("stage")

    def _told(self, name: str) -> str:
        known = self._who.get(name)
        return f"{known.vendor} {known.model}, {known.serial}" if known else ""

    @contextlib.contextmanager
    def _known(self, name: str, device: Device) -> Iterator[None]:
        """A device is asked who it is once, between runs: in a run the question would come between its commands."""
        try:
            yield
        except DaqError:
            self._who.pop(name, None)  # whoever answers next may be another one
            raise
        if name not in self._who and self._resting():
            self._who[name] = device.identity()

    def _generator(self) -> tuple[Health, str]:
        with self._known("pulse generator", self._rig.generator):
            if self._resting():
                self._rig.generator.recover()
            status = self._rig.generator.status()
        health = Health.FAULT if status.state is GeneratorState.FAULT else Health.OK
        return health, ", ".join([status.state.value, *status.faults])

    def _interlock(self) -> tuple[Health, str]:
        with self._known("interlock", self._rig.interlock):
            closed = self._rig.interlock.is_closed()
        return (Health.OK, "closed") if closed else (Health.FAULT, "open: the light is locked")

    def _disk(self) -> tuple[Health, str]:
        free = shutil.disk_usage(self._data_dir).free
        return Health.WARN if free < _LOW_DISK_BYTES else Health.OK, f"{free / 1e9:.0f} GB free"


class _Watched:
    """One device, and what came of asking it."""

    def __init__(self, name: str, kind: str, look: Look, now_s: Clock) -> None:
        self.name = name
        self._kind = kind
        self._look = look
        self._now_s = now_s
        self._answer = (Health.WARN, "not asked yet")
        self._answered_s: float | None = None
        self._silence = ""

    def ask(self) -> None:
        """Ask once, in its own thread; an error of any kind is a red lamp, and hides no other device."""
        try:
            answer = self._look()
        except Exception as error:  # noqa: BLE001  a driver's own mistake must not freeze the lamp
            self._silence = told(error)
        else:
            self._answer, self._answered_s, self._silence = answer, self._now_s(), ""

    @property
    def lamp(self) -> Lamp:
        """The lamp at present."""
        age_s = None if self._answered_s is None else round(self._now_s() - self._answered_s, 1)
        health, detail = self._state(age_s or 0.0)
        return Lamp(name=self.name, kind=self._kind, health=health, detail=detail, age_s=age_s)

    def _state(self, age_s: float) -> tuple[Health, str]:
        if silence := self._silence:
            return Health.FAULT, f"{silence}; last answer {age_s:.0f} s ago" if age_s else silence
        health, detail = self._answer
        if age_s < STALE_S:
            return health, detail
        return Health.WARN if health is Health.OK else health, f"no answer for {age_s:.0f} s"
