"""The errors of data acquisition.

::

    DaqError
    ├── PlanError             the plan cannot run on this rig; names value and limit
    ├── BusyError             a run is active; there is no queue of runs
    ├── AlreadyHeld           another process holds the rig, the data directory or the port
    ├── DeviceError           a device did not do what it was asked to
    │   ├── DeviceUnavailable   it is absent, or held by somebody else
    │   ├── DeviceTimeout       it did not answer before the deadline
    │   ├── DeviceRefused       it answered, and said no
    │   ├── DeviceOvertaken     it was switched off while it was asked
    │   └── ProtocolError       it answered something that makes no sense
    ├── InterlockOpen         the light must not be switched on
    ├── NotAcknowledged       a cause of the last run waits to be acknowledged
    ├── InvalidShots          too many shots are invalid
    ├── RecorderError         a shot could not be stored
    │   ├── RecorderOverflow    the disk does not keep up
    │   └── StorageError        the disk refuses; the text says what to do
    │       ├── DiskFull          it is full, or its margin is reached
    │       ├── DiskReadOnly      it takes nothing any more
    │       ├── DiskForbidden     the permission to write is missing
    │       └── DiskGone          the folder was moved or deleted, or its disk is not mounted
    └── ShotFileError         a run directory or a shot file cannot be read
        ├── ForeignFile         it belongs to another run, or is no shot
        ├── RenamedFile         it is another shot of this run
        ├── DamagedNumbers      its numbers are not those that were written
        └── DamagedFrame        the bytes of an exposure are not those that were written
"""


class DaqError(Exception):
    """Base of every error that daq raises on purpose; ``code`` is one of ``daq.run.refusals``, if it is a refusal."""

    code: str = ""


class PlanError(DaqError):
    """The plan cannot run on this rig; the text names value and limit."""


class BusyError(DaqError):
    """Another run is active."""


class AlreadyHeld(DaqError):
    """Somebody else holds the rig, the data directory or the port; the text says who."""


class DeviceError(DaqError):
    """A device did not do what it was asked to.

    Parameters
    ----------
    device : str
        Name of the device in the rig configuration, for example ``view2``.
    reason : str
        What happened, with values and limits.
    """

    def __init__(self, device: str, reason: str) -> None:
        super().__init__(f"{device}: {reason}")
        self.device = device
        self.reason = reason


class DeviceUnavailable(DeviceError):
    """The device is absent, or another client holds it."""


class DeviceTimeout(DeviceError):
    """The device did not answer before the deadline.

    Parameters
    ----------
    device : str
        Name of the device in the rig configuration.
    command : str
        What it was asked to do.
    limit_s : float
        The deadline that passed.
    """

    def __init__(self, device: str, command: str, limit_s: float) -> None:
        super().__init__(device, f"no answer to {command!r} within {limit_s:g} s")
        self.command = command
        self.limit_s = limit_s


class DeviceRefused(DeviceError):
    """The device answered, and refused."""


class DeviceOvertaken(DeviceError):
    """The device was switched off while it was asked: nobody knows what it did with the command, and it is dark."""


class ProtocolError(DeviceError):
    """The device answered something that makes no sense."""


class InterlockOpen(DaqError):
    """The interlock is open: the light must not be switched on."""


class NotAcknowledged(DaqError):
    """A run ended for several reasons, and some of them are still to be acknowledged; the text names them."""


class InvalidShots(DaqError):
    """Too many shots in a row are invalid, or all of a run; the text says what the last one lacks."""


class RecorderError(DaqError):
    """A shot could not be stored."""


class RecorderOverflow(RecorderError):
    """The recorder's queue is full: the disk does not keep up with the cameras."""


class StorageError(RecorderError):
    """The disk refuses; the text names the path and says what to do."""


class DiskFull(StorageError):
    """The disk is full, or has no more room than what a run leaves free."""


class DiskReadOnly(StorageError):
    """The disk is mounted for reading only."""


class DiskForbidden(StorageError):
    """The permission to write there is missing."""


class DiskGone(StorageError):
    """The folder was moved or deleted, or its disk is not mounted any more."""


class ShotFileError(DaqError):
    """A run directory or a shot file cannot be read; the text names the file."""


class ForeignFile(ShotFileError):
    """The file belongs to another run, or is no shot at all."""


class RenamedFile(ShotFileError):
    """The file holds another shot than its name says."""


class DamagedNumbers(ShotFileError):
    """The numbers of a shot are not those that were written beside its frames."""


class DamagedFrame(ShotFileError):
    """The bytes of an exposure are not those that were written; the text names view and exposure."""
