"""RigMonitor: the lamps. Asks every device once a second, outside the event loop, and remembers the answers."""

import asyncio
import contextlib
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from daq.devices import Device, DeviceIdentity, GeneratorState, Rig
from daq.errors import DaqError
from server.lab.duty import Duty, Health, Lamp, pause
from server.lab.errors import told

_PERIOD_S = 1.0
STALE_S = 5.0
"""Answers older than this are told with their age: devices give up on each question sooner."""
_LOW_DISK_BYTES = 20e9


class RigMonitor:
    """Watches a rig.

    Parameters
    ----------
    rig : Rig
        Opened devices.
    data_dir : Path
        Its file system must have room for runs.
    now_s : Callable[[], float]
        A clock that never goes back.
    """

    def __init__(self, rig: Rig, data_dir: Path, now_s: Callable[[], float] = time.monotonic) -> None:
        self._rig = rig
        self._data_dir = data_dir
        self._now_s = now_s
        self._identities: dict[str, DeviceIdentity] = {}
        self._answers: tuple[Lamp, ...] = ()
        self._answered_s = now_s()

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """What every device last answered; never green where that is long ago."""
        age_s = self._now_s() - self._answered_s
        return self._answers if age_s < STALE_S else tuple(_aged(lamp, age_s) for lamp in self._answers)

    async def run(self, duty: Duty) -> None:
        """Ask until cancelled."""
        while True:
            with duty.item("devices"):
                await self.ask()
            await pause(_PERIOD_S)

    async def ask(self) -> None:
        """Ask every device once."""
        self._answers = await asyncio.to_thread(self._asked)
        self._answered_s = self._now_s()

    def _asked(self) -> tuple[Lamp, ...]:
        stage = self._rig.stage
        return (
            *(_lit(view, "camera", self._camera) for view in self._rig.cameras),
            _lit("pulse generator", "generator", self._generator),
            _lit("interlock", "interlock", self._interlock),
            *(() if stage is None else (_lit("stage", "stage", lambda name: self._identity(name, stage)),)),
            _lit("disk", "disk", self._disk),
        )

    def _camera(self, view: str) -> tuple[Health, str]:
        camera = self._rig.cameras[view]
        return (Health.FAULT, "has stopped answering") if camera.is_lost else self._identity(view, camera)

    def _identity(self, name: str, device: Device) -> tuple[Health, str]:
        """A camera is asked who it is once: later questions would come between the commands of a run."""
        with contextlib.suppress(DaqError):
            if name not in self._identities:
                self._identities[name] = device.identity()
        known = self._identities.get(name)
        if known is None:
            return Health.FAULT, "does not answer"
        return Health.OK, f"{known.vendor} {known.model}, {known.serial}"

    def _generator(self, _: str) -> tuple[Health, str]:
        status = self._rig.generator.status()
        health = Health.FAULT if status.state is GeneratorState.FAULT else Health.OK
        return health, ", ".join([status.state.value, *status.faults])

    def _interlock(self, _: str) -> tuple[Health, str]:
        closed = self._rig.interlock.is_closed()
        return (Health.OK, "closed") if closed else (Health.FAULT, "open: the light is locked")

    def _disk(self, _: str) -> tuple[Health, str]:
        free = shutil.disk_usage(self._data_dir).free
        return Health.WARN if free < _LOW_DISK_BYTES else Health.OK, f"{free / 1e9:.0f} GB free"


def _lit(name: str, kind: str, ask: Callable[[str], tuple[Health, str]]) -> Lamp:
    """Lamp of one device; an error of any kind is a red one, and hides no other device."""
    try:
        health, detail = ask(name)
    except Exception as error:  # noqa: BLE001  a driver's own mistake must not freeze the lamps
        health, detail = Health.FAULT, told(error)
    return Lamp(name=name, kind=kind, health=health, detail=detail)


def _aged(lamp: Lamp, age_s: float) -> Lamp:
    health = Health.WARN if lamp.health is Health.OK else lamp.health
    return lamp.model_copy(update={"health": health, "detail": f"no answer for {age_s:.0f} s; before: {lamp.detail}"})
