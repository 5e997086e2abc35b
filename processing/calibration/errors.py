"""The errors of calibration.

::

    CalibrationError        a calibration cannot be made, read or trusted; names view or file, value and limit
    ├── OutOfRange          droplets show that a view has moved further than can be measured
    └── TargetNotFound      an image does not show the target well enough
        └── OriginUnknown   it shows a grid, but not which of the target's points these are
"""

from processing.errors import BadInput

UNFIT = (
    "its points are those of no camera: are they where the table or the target says? A target of one plane is needed, "
    "a plate with dots on two levels is not supported"
)


class CalibrationError(BadInput):
    """A calibration cannot be made, read or trusted; the text names view or file, value and limit."""


class OutOfRange(CalibrationError):
    """A view has moved about as far as a disparity is looked for, or further."""


class TargetNotFound(CalibrationError):
    """An image does not show the target well enough to assign its points."""


class OriginUnknown(TargetNotFound):
    """An image shows a grid, but nothing tells which points of the target these are."""
