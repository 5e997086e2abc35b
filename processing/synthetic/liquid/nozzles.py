"""The paper's two nozzles as random sprays: a liquid sheet, ligaments where it breaks up, droplets beyond.

Not modelled: air drag, collisions, secondary break-up, the body of the nozzle, and liquid that follows out of it
between two exposures: at 25 mm/ms and 6.4 us the sheet of frame B begins 0.16 mm below the orifice.
"""

from collections.abc import Sequence

import numpy as np

from processing.synthetic.liquid.breakup import droplets, free_rims, leading_rim, ligaments, perforate, sheet_film
from processing.synthetic.liquid.sheet import FlatFan, HollowCone, NozzleFlow, Sheet, SprayShape
from processing.synthetic.spray import Spray

Seed = int | Sequence[int]

HOLLOW_CONE_FLOW = NozzleFlow(
    orifice_mm=(0.0, -8.4, 0.0),
    orifice_diameter_mm=0.2,
    velocity_mm_per_s=25_000,
    breakup_mm=4.2,
    holes=25,
    ligaments=110,
    droplets=3600,
    median_diameter_mm=0.040,
    diameter_spread=0.40,
    spread_rad=0.045,
    bottom_mm=10.0,
)
"""Simplex nozzle, water at 6 bar. 3600 droplets carry about 0.35 x the ideal flow through d0, as such nozzles do.

The orifice lies 0.2 mm below the top of the paper's 18 x 17.25 x 9 mm volume, so that its upper 7.3 mm (36 d0: sheet,
break-up and first droplets) hold the whole cone. Below, at 63 degrees, the cone leaves the volume through z = -4.5 and
4.5 mm; those droplets still cast shadows, as on the real rig.
"""

FLAT_FAN_FLOW = NozzleFlow(
    orifice_mm=(0.0, -8.4, 0.0),
    orifice_diameter_mm=0.23,
    velocity_mm_per_s=28_000,
    breakup_mm=7.0,
    holes=45,
    ligaments=120,
    droplets=3000,
    median_diameter_mm=0.050,
    diameter_spread=0.40,
    spread_rad=0.05,
    bottom_mm=10.0,
)
"""Flat-fan nozzle, water at 6 bar; the perforated sheet fills the upper half of the paper's volume."""


def hollow_cone_spray(seed: Seed, full_angle_deg: float = 63.0, flow: NozzleFlow = HOLLOW_CONE_FLOW) -> Spray:
    """One realisation of the hollow cone; equal seeds give equal sprays."""
    return _spray(HollowCone(np.deg2rad(full_angle_deg)), flow, seed)


def flat_fan_spray(seed: Seed, full_angle_deg: float = 65.0, flow: NozzleFlow = FLAT_FAN_FLOW) -> Spray:
    """One realisation of the flat fan in the x-y plane; equal seeds give equal sprays."""
    return _spray(FlatFan(np.deg2rad(full_angle_deg)), flow, seed)


def _spray(shape: SprayShape, flow: NozzleFlow, seed: Seed) -> Spray:
    rng = np.random.default_rng(seed)
    sheet = Sheet(shape, flow, rng)
    film, hole_rims = perforate(sheet, sheet_film(sheet, rng), rng)
    parts = [film, hole_rims, leading_rim(sheet, rng), free_rims(sheet, rng), ligaments(sheet, rng)]
    return Spray.joined([*parts, droplets(sheet, rng)])
