"""Cameras disarmed side by side, without waiting for a frozen one."""

import threading
import time
from collections.abc import Mapping

from daq.devices import Camera
from daq.errors import DaqError


def disarm_cameras(cameras: Mapping[str, Camera], deadline_s: float) -> dict[str, str]:
    """Disarm all cameras side by side; returns what went wrong by view.

    A camera that is off the network blocks for seconds; its thread is left behind, nobody waits for it.
    """
    deadline = time.monotonic() + deadline_s
    problems: dict[str, str] = {}
    threads = {
        view: threading.Thread(target=_disarm, args=(view, camera, problems), name=f"disarm-{view}", daemon=True)
        for view, camera in cameras.items()
    }
    for thread in threads.values():
        thread.start()
    for thread in threads.values():
        thread.join(max(0.0, deadline - time.monotonic()))
    late = {view: f"{view}: not disarmed within {deadline_s:g} s" for view, one in threads.items() if one.is_alive()}
    return {**problems, **late}


def _disarm(view: str, camera: Camera, problems: dict[str, str]) -> None:
    try:
        camera.disarm()
    except DaqError as error:
        problems[view] = str(error)
