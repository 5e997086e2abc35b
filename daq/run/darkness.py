"""Darkness: whatever goes wrong in a run or a live view, the light goes off first, and then the reason is found."""

from collections.abc import Callable

from daq.causes import CauseCode
from daq.errors import DaqError, DeviceError, DeviceOvertaken, DeviceRefused, InterlockOpen
from daq.run import light
from daq.run.ending import code_of
from daq.run.shooting import Shooting
from daq.run.side_by_side import disarming_of


def attempt(run: Shooting, action: Callable[[], None]) -> None:
    """Do something at the top of a thread: an error of any kind ends the run, the light goes off before all else."""
    try:
        action()
    except (DaqError, OSError) as error:
        fail(run, error)
    except Exception as error:  # noqa: BLE001  the top of a thread: a bug must not leave the light on
        fail(run, DaqError(f"internal error: {error!r}"))


def fail(run: Shooting, error: Exception) -> None:
    """Light off, then end the run by the reason of an error."""
    light.try_to_switch_off(run.rig)
    if isinstance(error, DeviceOvertaken):
        run.ending.wait_for_reason(run.limits.light_off_s)
    error = _reason_of(run, error)
    is_first = run.ending.fail(error, code_of(error, run.rig))
    if not is_first and not isinstance(error, DeviceOvertaken) and str(error) != run.ending.cause:
        run.say(str(error))


def darken(run: Shooting) -> str | None:
    """Light confirmed off; returns why not. Cameras are disarmed meanwhile: no dead one makes it late."""
    disarming = disarming_of(run.rig.cameras)
    reason = light.confirm_off(run.rig, run.limits.light_off_s)
    _look_for_more_causes(run, answers=reason is None)
    if reason:
        run.ending.fail(DaqError(f"light not confirmed off: {reason}"), CauseCode.LIGHT_NOT_OFF)
    for problem in disarming.errors(run.limits.disarm_s).values():
        run.say(str(problem))
    return reason


def _look_for_more_causes(run: Shooting, *, answers: bool) -> None:
    """What has failed may have had two reasons: an open door hides that the generator was reset, if that answers."""
    if not run.ending.at_once:
        return
    for look in (light.check_generator, light.check_permitted) if answers else (light.check_closed,):
        try:
            look(run.rig)
        except DaqError as error:
            run.ending.fail(error, code_of(error, run.rig))


def _reason_of(run: Shooting, error: Exception) -> Exception:
    """Why the generator refuses: it went off by itself when a door was opened, and may be the first to say so."""
    if isinstance(error, DeviceRefused) and error.device == run.rig.generator.name:
        try:
            light.check_permitted(run.rig)
        except (DeviceRefused, InterlockOpen) as reason:
            return reason
        except DeviceError:
            return error
    return error
