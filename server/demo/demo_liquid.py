"""Break-up of the demonstration: liquid that is no droplet, in exposure A of every shot, and judged by the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from daq.files.run_directory import RunReader
from processing.analysis.droplets.droplet_table import SizedDroplets
from processing.analysis.objects.break_up import NEAR_MM, Reach
from processing.analysis.objects.liquid_objects import LiquidObjects
from processing.analysis.objects.object_search import ExposureObjects
from processing.calibration.calibration import Calibration
from processing.geometry import FloatArray
from processing.runs.liquid.objects import LiquidSummary, RunObjects, summary_of
from processing.runs.workbench import read_references
from processing.synthetic.liquid.connected_balls import connected_length_mm
from processing.synthetic.liquid.nozzles import HOLLOW_CONE_FLOW
from server.demo.demo_droplets import measured_box, true_sprays


@dataclass(frozen=True, eq=False)
class MeasuredLiquid:
    """What exposure A of every shot says of liquid that is no droplet, and the truth.

    Parameters
    ----------
    found : tuple of ExposureObjects
        A shot each.
    true_mm : (shots,) array
        How far the balls of the simulated liquid touch, from the nozzle on.
    """

    found: tuple[ExposureObjects, ...]
    true_mm: FloatArray

    @property
    def objects(self) -> list[LiquidObjects]:
        """Of each shot."""
        return [one.objects for one in self.found]

    @property
    def reaches(self) -> list[Reach]:
        """How far liquid hangs together with the nozzle, shot by shot."""
        return [one.reach for one in self.found]

    @property
    def summary(self) -> LiquidSummary:
        """Numbers of objects, and the break-up length."""
        return summary_of(self.objects, len(self.found), self.reaches)

    @property
    def true_break_up_mm(self) -> float:
        """Half of the shots hang together so far."""
        return float(np.median(self.true_mm))


def measure_liquid(run_dir: Path, shots: Sequence[int], calibration: Calibration, truth_file: Path) -> MeasuredLiquid:
    """Look for objects in exposure A of every shot, and ask the truth how far the liquid hangs together."""
    with RunReader(run_dir) as run:
        objects = RunObjects.of(run, calibration, read_references(run), measured_box(calibration), None, ())
        if objects.search is None:
            raise ValueError(f"{run_dir.name}: no shadows")
        found = [objects.measure(run.read_shot(shot), {"a": SizedDroplets.none()})["a"].found for shot in shots]
        sprays = [true_sprays(run, shot, truth_file)["a"] for shot in shots]
    orifice_mm = np.array(HOLLOW_CONE_FLOW.orifice_mm)
    true_mm = [connected_length_mm(spray, orifice_mm, NEAR_MM) for spray in sprays]
    return MeasuredLiquid(tuple(found), np.array(true_mm))
