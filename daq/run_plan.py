"""RunPlan: what a run shall do; LivePlan: what a live view shows. The same in configuration, API and file."""

from enum import IntEnum, StrEnum
from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.names import RunName
from daq.recipe import Recipe
from daq.run_notes import RunNotes, Spray


class ImageKey(IntEnum):
    """What a shot shows; the values of NeXus ``image_key``, 4 added for a background without spray."""

    SAMPLE = 0
    FLAT = 1
    DARK = 2
    INVALID = 3
    BACKGROUND = 4


class RunKind(StrEnum):
    """What the operator prepares before the run: spray on, spray off, light off, target in the volume."""

    SAMPLE = "sample"
    BACKGROUND = "background"
    DARK = "dark"
    CALIBRATION = "calibration"

    @property
    def image_key(self) -> ImageKey:
        """ImageKey of every valid shot of such a run."""
        return _IMAGE_KEYS[self]


_IMAGE_KEYS = {
    RunKind.SAMPLE: ImageKey.SAMPLE,
    RunKind.CALIBRATION: ImageKey.SAMPLE,
    RunKind.BACKGROUND: ImageKey.BACKGROUND,
    RunKind.DARK: ImageKey.DARK,
}


class PulsePair(FrozenModel):
    """The two light pulses of a double exposure, the same timing for all views."""

    width_ns: Annotated[int, Field(ge=250, le=2000, description="pulse duration tau_p")] = 1000
    separation_ns: Annotated[
        int, Field(ge=2000, le=200_000, description="start of pulse A to start of pulse B, delta t")
    ] = 6400
    current_a: Annotated[
        dict[str, Annotated[float, Field(ge=0, le=30)]],
        Field(description="peak LED current per view in ampere; 0 leaves the view dark"),
    ]


class RunPlan(FrozenModel):
    """A planned sequence of shots of one kind."""

    name: Annotated[RunName, Field(description="what the operator calls the run; its id adds the time")]
    kind: Annotated[RunKind, Field(description="what was prepared: spray, no spray, no light, or the target")] = (
        RunKind.SAMPLE
    )
    shots: Annotated[int, Field(ge=1, le=100_000, description="number of double exposures")]
    rate_hz: Annotated[float, Field(gt=0, le=100, description="shots per second")] = 1.0
    pulse: Annotated[PulsePair, Field(description="the light of every shot")]
    stage_z_mm: Annotated[
        tuple[float, ...], Field(description="target positions; shots are taken at each; empty: the stage stays")
    ] = ()
    references: Annotated[
        tuple[str, ...], Field(description="run ids of the dark and background runs that belong to this one")
    ] = ()
    refire_quota: Annotated[
        int, Field(ge=0, le=1000, description="how many shots with a proven frame miss may be fired again")
    ] = 3
    calibration: Annotated[str | None, Field(description="id of the calibration that reconstructs this run")] = None
    recipes: Annotated[
        tuple[Recipe, ...] | None,
        Field(
            max_length=8,
            description="what is made of every valid shot of a sample run by itself; empty: nothing; null: as usual",
        ),
    ] = None
    notes: Annotated[RunNotes, Field(description="conditions that no device knows")] = RunNotes()
    spray: Annotated[Spray | None, Field(description="where nozzle and axis are; null where nobody stated it")] = None

    @property
    def total_shots(self) -> int:
        """Number of shots of the whole run: ``shots`` at each stage position."""
        return self.shots * max(1, len(self.stage_z_mm))


class LivePlan(FrozenModel):
    """What a live view shows."""

    rate_hz: Annotated[float, Field(ge=0.1, le=10, description="shots per second")] = 2.0
    pulse: Annotated[
        PulsePair | None, Field(description="the light of every shot; null: none, the cameras see what light there is")
    ] = None

    def __str__(self) -> str:
        """For people."""
        return f"live view at {self.rate_hz:g} Hz, {'pulsed' if self.pulse else 'ambient'} light"
