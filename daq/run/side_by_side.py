"""Cameras asked side by side, each in a thread of its own: nobody waits for a frozen one longer than he wants to."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from daq.devices import Camera
from daq.errors import DeviceTimeout

Answer = TypeVar("Answer")


class SideBySide(Generic[Answer]):
    """One action on several cameras, begun at once.

    A camera that is off the network blocks for seconds; its thread is left behind.

    Parameters
    ----------
    what : str
        The action, for errors.
    action : Callable[[Camera], Answer]
        Called with every camera.
    cameras : Mapping[str, Camera]
        By view.
    """

    def __init__(self, what: str, action: Callable[[Camera], Answer], cameras: Mapping[str, Camera]) -> None:
        self._what = what
        self._action = action
        self._answers: dict[str, Answer] = {}
        self._errors: dict[str, Exception] = {}
        self._threads = {
            view: threading.Thread(target=self._act, args=(view, camera), name=f"{what}-{view}", daemon=True)
            for view, camera in cameras.items()
        }
        for thread in self._threads.values():
            thread.start()

    def wait(self, deadline_s: float) -> bool:
        """Wait for all of them, at most so long; whether all are done."""
        deadline = time.monotonic() + deadline_s
        for thread in self._threads.values():
            thread.join(max(0.0, deadline - time.monotonic()))
        return not any(thread.is_alive() for thread in self._threads.values())

    @property
    def has_failed(self) -> bool:
        """One of them has raised an error; others may still be at work."""
        return bool(self._errors)

    @property
    def answers(self) -> dict[str, Answer]:
        """What those gave that are done, by view in the order of the cameras."""
        return {view: self._answers[view] for view in self._threads if view in self._answers}

    def errors(self, deadline_s: float) -> dict[str, Exception]:
        """What went wrong by view; DeviceTimeout where it is not done by the deadline."""
        self.wait(deadline_s)
        late = (view for view, thread in self._threads.items() if thread.is_alive())
        return {**self._errors, **{view: DeviceTimeout(view, self._what, deadline_s) for view in late}}

    def _act(self, view: str, camera: Camera) -> None:
        try:
            self._answers[view] = self._action(camera)
        except Exception as error:  # noqa: BLE001  the top of a thread; who waits raises it
            self._errors[view] = error


def disarming_of(cameras: Mapping[str, Camera]) -> SideBySide[None]:
    """Begin to disarm all cameras."""
    return SideBySide("disarm", lambda camera: camera.disarm(), cameras)
