"""RigMonitor: the lamps. Asks every device once a second, outside the event loop, and remembers the answers."""

import asyncio
import contextlib
import shutil
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path

from daq.devices import Device, DeviceIdentity, GeneratorState, Rig
from daq.errors import DaqError
from daq.frozen_model import FrozenModel
from server.lab.live import pause

_PERIOD_S = 1.0
_LOW_DISK_BYTES = 20e9


class Health(StrEnum):
    """Colour of a lamp: green, amber, red."""

    OK = "ok"
    WARN = "warn"
    FAULT = "fault"


class Lamp(FrozenModel):
    """State of one part of the rig."""

    name: str
    kind: str
    health: Health
    detail: str


class RigMonitor:
    """Watches a rig.

    Parameters
    ----------
    rig : Rig
        Opened devices.
    data_dir : Path
        Its file system must have room for runs.
    """

    def __init__(self, rig: Rig, data_dir: Path) -> None:
        self._rig = rig
        self._data_dir = data_dir
        self._identities: dict[str, DeviceIdentity] = {}
        self.lamps: tuple[Lamp, ...] = ()

    async def run(self) -> None:
        """Ask until cancelled."""
        while True:
            await self.ask()
            await pause(_PERIOD_S)

    async def ask(self) -> None:
        """Ask every device once."""
        self.lamps = tuple(await asyncio.to_thread(lambda: list(self._lamps())))

    def _lamps(self) -> Iterator[Lamp]:
        for view, camera in self._rig.cameras.items():
            lost = Lamp(name=view, kind="camera", health=Health.FAULT, detail="has stopped answering")
            yield lost if camera.is_lost else self._identity_lamp(view, "camera", camera)
        yield self._generator_lamp()
        yield self._interlock_lamp()
        if self._rig.stage is not None:
            yield self._identity_lamp("stage", "stage", self._rig.stage)
        yield self._disk_lamp()

    def _identity_lamp(self, name: str, kind: str, device: Device) -> Lamp:
        """A camera is asked who it is once: later questions would come between the commands of a run."""
        with contextlib.suppress(DaqError):
            if name not in self._identities:
                self._identities[name] = device.identity()
        known = self._identities.get(name)
        if known is None:
            return Lamp(name=name, kind=kind, health=Health.FAULT, detail="does not answer")
        return Lamp(name=name, kind=kind, health=Health.OK, detail=f"{known.vendor} {known.model}, {known.serial}")

    def _generator_lamp(self) -> Lamp:
        try:
            status = self._rig.generator.status()
        except DaqError as error:
            return Lamp(name="pulse generator", kind="generator", health=Health.FAULT, detail=str(error))
        detail = ", ".join([status.state.value, *status.faults])
        health = Health.FAULT if status.state is GeneratorState.FAULT else Health.OK
        return Lamp(name="pulse generator", kind="generator", health=health, detail=detail)

    def _interlock_lamp(self) -> Lamp:
        try:
            closed = self._rig.interlock.is_closed()
        except DaqError as error:
            return Lamp(name="interlock", kind="interlock", health=Health.FAULT, detail=str(error))
        detail = "closed" if closed else "open: the light is locked"
        return Lamp(name="interlock", kind="interlock", health=Health.OK if closed else Health.FAULT, detail=detail)

    def _disk_lamp(self) -> Lamp:
        free = shutil.disk_usage(self._data_dir).free
        health = Health.WARN if free < _LOW_DISK_BYTES else Health.OK
        return Lamp(name="disk", kind="disk", health=health, detail=f"{free / 1e9:.0f} GB free")
