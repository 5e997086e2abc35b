"""RunGuard: watches interlock and generator during a run or a live view, and is the generator's heartbeat.

It has a thread of its own, because the acquisition thread waits for cameras, a stage and files: the light
goes off when the interlock opens, whatever acquisition waits for. Firing stays with the acquisition thread,
so a heartbeat without acquisition never makes light.
"""

import threading
from contextlib import suppress
from types import TracebackType
from typing import Self

from daq.errors import DaqError, DeviceOvertaken
from daq.run import light
from daq.run.ending import code_of
from daq.run.shooting import Shooting


class RunGuard:
    """Ends the run when light is no longer permitted.

    Parameters
    ----------
    run : Shooting
        Its interlock is watched, its generator gets a status request at the period of its limits, which is well below
        what the generator permits. Its ending is told about the error, after the light is off.
    """

    def __init__(self, run: Shooting) -> None:
        self._rig = run.rig
        self._ending = run.ending
        self._period_s = run.limits.heartbeat_s
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="run-guard", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        self._thread.join()

    def _watch(self) -> None:
        """Thread: an edge of the interlock ends the wait at once."""
        try:
            while not self._done.is_set():
                with suppress(DeviceOvertaken):  # switched off between two positions of the stage: dark, ask again
                    light.check_permitted(self._rig)
                self._rig.interlock.wait_for_change(self._period_s)
        except DaqError as error:
            # Else somebody has switched off: a silent generator would be asked for one more second.
            if not (self._ending.at_once or self._done.is_set()):
                light.try_to_switch_off(self._rig)
            self._ending.fail(error, code_of(error, self._rig))
