"""Configuration of the devices that a rig has once: pulse generator, interlock, stage."""

from typing import Annotated

from pydantic import Field, field_validator

from daq.frozen_model import FrozenModel


class PulseGeneratorConfig(FrozenModel):
    """The microcontroller that fires light and cameras."""

    port: Annotated[str, Field(min_length=1, description="serial port, best by its id: /dev/serial/by-id/...")]


class InterlockConfig(FrozenModel):
    """Input line of the door and enclosure switches."""

    chip: Annotated[str, Field(min_length=1, description="for example /dev/gpiochip0")]
    line: Annotated[int, Field(ge=0, le=1023, description="line of that chip")]
    active_low: Annotated[bool, Field(description="the closed chain connects the line to ground")] = False


class StageConfig(FrozenModel):
    """Motorised stage of the calibration target; absent from a rig that has none."""

    port: Annotated[str, Field(min_length=1, description="serial port, for example /dev/ttyUSB0")]
    range_mm: Annotated[tuple[float, float], Field(description="lowest and highest z")]
    zero_mm: Annotated[float, Field(description="position on the stage's own scale where z is 0")] = 0.0
    microstep_um: Annotated[float, Field(gt=0, le=100, description="data sheet of the stage")] = 0.047625

    @field_validator("range_mm")
    @classmethod
    def _rises(cls, range_mm: tuple[float, float]) -> tuple[float, float]:
        if not range_mm[0] < range_mm[1]:
            raise ValueError("the first value must be below the second")
        return range_mm
