"""FarEndGuest: works with far ends of a simulated rig that run in another process, and outlives their restart."""

import logging
import threading
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from daq.errors import AlreadyHeld, DaqError, DeviceTimeout, DeviceUnavailable
from daq.faults import Fault
from daq.run_plan import RunPlan
from daq.simulation.interlock import DoorSwitch
from server.rig.config import RigConfig
from server.rig.far_end_host import simulated_part
from server.rig.far_end_line import ANSWER_LIMIT_S, SILENT_S, answer_of, ask, connected, tell
from server.rig.rig_lock import far_end_address

_LOG = logging.getLogger(__name__)
_RETRY_S = 0.5
_LOST_AFTER = 2
"""Attempts: at first the drivers say what has ended, which is more than an open door."""


class FarEndGuest:
    """Laboratory and observer of runs at the other end of a line; a context manager, which follows the door meanwhile.

    Parameters
    ----------
    config : RigConfig
        A rig whose far ends run, as ``far_end_line.somebody_listens`` tells.
    switch : DoorSwitch
        The interlock of this process, which moves as the door does. A door that nobody can tell about is open.
    """

    def __init__(self, config: RigConfig, switch: DoorSwitch) -> None:
        self._config = config
        self._address = far_end_address(config)
        self._switch = switch
        self._known: dict[str, Any] = {}
        self._leaving = threading.Event()
        self._first_word = threading.Event()
        self._thread = threading.Thread(target=self._follow_door, name="laboratory door", daemon=True)

    def __enter__(self) -> Self:
        """Join them.

        Raises
        ------
        AlreadyHeld
            They run, but were started with another rig file.
        DeviceUnavailable
            They do not answer.
        """
        self._known = self._meet()
        self._thread.start()
        if not self._first_word.wait(ANSWER_LIMIT_S):
            raise DeviceTimeout("far ends", "follow_door", ANSWER_LIMIT_S)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._leaving.set()
        self._thread.join(SILENT_S)

    @property
    def generator_port(self) -> str:
        """Serial port of the pulse generator; the same after a restart."""
        return str(self._known["generator_port"])

    @property
    def stage_port(self) -> str:
        """Serial port of the stage; the same after a restart."""
        return str(self._known["stage_port"])

    is_apart = True
    """They may end while their guest goes on."""

    def ask(self) -> str:
        """Who runs them; DeviceUnavailable if they do not answer."""
        return f"process {self._ask('meet')['process']}"

    def inject(self, fault: Fault) -> None:
        """Let something go wrong; ValueError if the laboratory has no such view."""
        self._ask("inject", fault=fault.model_dump(mode="json"))

    def open_door(self) -> None:
        """Open the interlock."""
        self._ask("open_door")

    def close_door(self) -> None:
        """Allow light."""
        self._ask("close_door")

    def before_run(self, plan: RunPlan, run_dir: Path | None) -> None:
        """Spray on or off, target in; the truth begins."""
        folder = str(run_dir.resolve()) if run_dir else None
        self._ask("before_run", plan=plan.model_dump(mode="json"), run_dir=folder)

    def after_run(self, run_dir: Path) -> None:
        """See that the truth of this run is complete."""
        self._ask("after_run", run_dir=str(run_dir.resolve()))

    def clock_s(self) -> float:
        """The generator's own time."""
        return float(self._ask("clock_s"))

    def _ask(self, do: str, **details: Any) -> Any:
        try:
            return ask(self._address, do, **details)
        except OSError as error:
            raise DeviceUnavailable("far ends", self._in_words(error)) from error

    def _in_words(self, error: Exception) -> str:
        return (
            f"those of rig {self._config.name!r} do not answer ({error}): start them again "
            "(tomoshadow simulate --config, with the file of this rig)"
        )

    def _meet(self) -> dict[str, Any]:
        known: dict[str, Any] = self._ask("meet")
        if differing := list(_differences(known["rig"], simulated_part(self._config))):
            raise AlreadyHeld(
                f"rig {self._config.name!r}: its far ends run in process {known['process']}, which was started with "
                f"another rig file ({', '.join(differing)}): end it (Ctrl-C), or use that file"
            )
        return known

    def _follow_door(self) -> None:
        """Thread: until the guest leaves, also where the far ends end and come back."""
        failures = 0
        while not self._leaving.wait(_RETRY_S if failures else 0):
            try:
                if failures:
                    self._meet()
                    _LOG.warning("the far ends of rig %r are back", self._config.name)
                failures = 0
                self._stay()
            except (OSError, DaqError, LookupError, ValueError) as error:
                failures += 1
                if failures == _LOST_AFTER:
                    self._switch.break_wire()
                    _LOG.error("%s", error if isinstance(error, DaqError) else self._in_words(error))

    def _stay(self) -> None:
        with connected(self._address, SILENT_S) as line:
            tell(line, {"do": "follow_door"})
            while not self._leaving.is_set():
                self._move(closed=bool(answer_of(line)))

    def _move(self, *, closed: bool) -> None:
        move = self._switch.close_door if closed else self._switch.open_door
        move()
        self._first_word.set()


def _differences(one: Any, other: Any, key: str = "") -> Iterator[str]:
    """Keys of two rig files whose values differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in sorted({*one, *other}):
            yield from _differences(one.get(name), other.get(name), f"{key}.{name}".lstrip("."))
    elif one != other:
        yield f"{key}: {one} there, {other} here"
