"""The end of a run: light confirmed off, then cameras disarmed, without waiting for a frozen one."""

import threading
import time
from collections.abc import Mapping

from daq.devices import Camera, GeneratorState, Rig
from daq.errors import DaqError, DeviceError
from daq.run.guard import switch_off

_RETRY_S = 0.05


def confirm_light_off(rig: Rig, deadline_s: float) -> str | None:
    """Switch off until the generator itself says that it is not armed; returns why it could not be confirmed."""
    deadline = time.monotonic() + deadline_s
    pause = threading.Event()
    while True:
        reason = switch_off(rig) or _still_armed(rig)
        if reason is None or time.monotonic() >= deadline:
            return reason
        pause.wait(_RETRY_S)


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


def _still_armed(rig: Rig) -> str | None:
    try:
        state = rig.generator.status().state
    except DeviceError as error:
        return str(error)
    lights = state in (GeneratorState.ARMED, GeneratorState.LIT)
    return f"{rig.generator.name}: still {state} after off" if lights else None


def _disarm(view: str, camera: Camera, problems: dict[str, str]) -> None:
    try:
        camera.disarm()
    except DaqError as error:
        problems[view] = str(error)
