"""FarEndHost: lets other processes work with the far ends of a simulated rig that run in this one."""

import json
import os
import socketserver
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from daq.errors import DaqError
from daq.faults import Fault
from daq.run_plan import RunPlan
from server.rig.config import RigConfig
from server.rig.far_end_line import ALIVE_S, tell
from server.rig.far_ends import FarEnds, run_far_ends
from server.rig.rig_lock import far_end_address, far_end_port, hold_far_ends
from server.rig.shared_door import SharedDoor

_POLL_S = 0.1
Asked = dict[str, Any]


class FarEndHost:
    """Answers on a local socket, see ``server.rig.far_end_line``.

    Parameters
    ----------
    config : RigConfig
        What the far ends were made from.
    ends : FarEnds
        They run.
    door : SharedDoor
        Their door.
    """

    def __init__(self, config: RigConfig, ends: FarEnds, door: SharedDoor) -> None:
        self._config, self._ends, self._door = config, ends, door
        self._over = threading.Event()
        self._tasks: dict[str, Callable[[Asked], Any]] = {
            "meet": lambda _: self._introduction(),
            "inject": lambda asked: ends.laboratory.inject(Fault.model_validate(asked["fault"])),
            "open_door": lambda _: ends.laboratory.open_door(),
            "close_door": lambda _: ends.laboratory.close_door(),
            "before_run": self._before_run,
            "after_run": lambda asked: ends.operator.after_run(Path(asked["run_dir"])),
            "clock_s": lambda _: ends.devices.generator.clock_s(),
        }

    def converse(self, handler: socketserver.StreamRequestHandler) -> None:
        """Answer one connection until the other side hangs up, or says what makes no sense."""
        with suppress(OSError, ValueError):
            for line in handler.rfile:
                asked = json.loads(line)
                if asked.get("do") == "follow_door":
                    self._tell_door(handler)
                else:
                    tell(handler.wfile, self._reply(asked))

    def end(self) -> None:
        """Let all followers go."""
        self._over.set()

    def revive(self) -> str | None:
        """Plug a pulse generator in again that has died; says so, or nothing if all is well."""
        generator = self._ends.devices.generator
        if not generator.has_died:
            return None
        died = generator.pid
        generator.unplug()
        generator.plug_in()
        return f"the pulse generator, process {died}, had died: it is plugged in again, process {generator.pid}"

    def _introduction(self) -> dict[str, Any]:
        devices = self._ends.devices
        return {
            "process": os.getpid(),
            "rig": simulated_part(self._config),
            "generator_port": devices.generator.port,
            "stage_port": devices.stage.port,
        }

    def _before_run(self, asked: Asked) -> None:
        run_dir = Path(asked["run_dir"]) if asked["run_dir"] else None
        self._ends.operator.before_run(RunPlan.model_validate(asked["plan"]), run_dir)

    def _reply(self, asked: Asked) -> dict[str, Any]:
        try:
            return {"answer": self._tasks[asked["do"]](asked)}
        except (DaqError, OSError, KeyError, ValueError) as error:
            kind = ValueError if isinstance(error, ValueError) else type(error)
            return {"error": str(error), "kind": kind.__name__}

    def _tell_door(self, handler: socketserver.StreamRequestHandler) -> None:
        with closing(self._door.follow(ALIVE_S)) as states:
            for closed in states:
                if self._over.is_set():
                    return
                tell(handler.wfile, {"answer": closed})


@contextmanager
def host_far_ends(config: RigConfig) -> Iterator[FarEndHost]:
    """Run the far ends of a simulated rig for other processes, until the block ends.

    Whoever asks while they are being started waits for them.

    Raises
    ------
    AlreadyHeld
        They run already, in the process that is named.
    DeviceError
        A simulated device cannot run.
    """
    door = SharedDoor()
    with (
        hold_far_ends(config),
        _Server(far_end_address(config)) as server,
        run_far_ends(config, door, lambda device: far_end_port(config, device)) as ends,
    ):
        host = FarEndHost(config, ends, door)
        with server.answering(host.converse):
            try:
                yield host
            finally:
                host.end()


class _Handler(socketserver.StreamRequestHandler):
    server: "_Server"

    def handle(self) -> None:
        self.server.converse(self)


class _Server(socketserver.ThreadingUnixStreamServer):
    """A thread per connection; none of them holds up the end of the process."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = 64

    def __init__(self, address: str) -> None:
        super().__init__(address, _Handler)

    @contextmanager
    def answering(self, converse: Callable[[socketserver.StreamRequestHandler], None]) -> Iterator[None]:
        self.converse = converse
        thread = threading.Thread(target=self.serve_forever, args=(_POLL_S,), name="far ends", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self.shutdown()
            thread.join()


def simulated_part(config: RigConfig) -> dict[str, Any]:
    """What of a rig file the far ends are made from."""
    part = config.model_dump(mode="json", include={"views", "target", "stage", "simulation"})
    for name, view in config.views.items():
        part["views"][name]["camera"]["profile"] = str(view.camera.profile.resolve())
    return part
