"""Break-up of a liquid sheet: film, perforations, rims, ligaments, droplets; each a random ``Spray``."""

import numpy as np
from numpy.typing import NDArray

from processing.synthetic.liquid.sheet import Periodic, Sheet
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.stamping import FloatArray

_FILM_DIAMETER_MM = 0.20
_FILM_PITCH_MM = 0.08
"""Each point of the film lies under about five balls, so that their lattice does not show."""
_CHAIN_STEP = 0.35
"""Distance of the balls of a chain relative to their diameter: the outline is straight within 2 % of the radius."""


def sheet_film(sheet: Sheet, rng: np.random.Generator) -> Spray:
    """The film from the orifice to its edge: rings of faintly opaque balls."""
    first_rad, last_rad = sheet.shape.angle_range_rad
    ring_s_mm = np.arange(_FILM_PITCH_MM, 1.4 * sheet.flow.breakup_mm, _FILM_PITCH_MM)
    arcs_mm = ring_s_mm * sheet.shape.arc_factor * (last_rad - first_rad)
    counts = np.maximum(4, np.rint(arcs_mm / _FILM_PITCH_MM)).astype(int)
    s_mm = np.repeat(ring_s_mm, counts)
    fractions = np.concatenate([(np.arange(count) + rng.uniform()) / count for count in counts])
    angles_rad = first_rad + (last_rad - first_rad) * fractions
    kept = s_mm < sheet.edge_mm(angles_rad)
    s_mm, angles_rad = s_mm[kept], angles_rad[kept]
    return Spray(
        sheet.points(s_mm, angles_rad),
        np.full(len(s_mm), _FILM_DIAMETER_MM),
        sheet.velocities(angles_rad),
        np.full(len(s_mm), LiquidKind.SHEET, np.uint8),
        sheet.opacities(s_mm, angles_rad),
    )


def perforate(sheet: Sheet, film: Spray, rng: np.random.Generator) -> tuple[Spray, Spray]:
    """The film with holes, and the rims around them; holes open towards the edge of the sheet."""
    angles_rad = rng.uniform(*sheet.shape.angle_range_rad, sheet.flow.holes)
    relative_s = rng.uniform(0.45, 1.0, sheet.flow.holes)
    s_mm = relative_s * sheet.edge_mm(angles_rad)
    radii_mm = rng.uniform(0.06, 0.15, sheet.flow.holes) + rng.uniform(0.2, 0.7, sheet.flow.holes) * (relative_s - 0.45)
    rims = []
    for s, angle_rad, radius_mm in zip(s_mm, angles_rad, radii_mm, strict=True):
        rims.append(_hole_rim(sheet, s, angle_rad, radius_mm, rng))
    centres_mm = sheet.points(s_mm, angles_rad)
    return _outside(film, centres_mm, radii_mm), _outside(Spray.joined(rims), centres_mm, 0.8 * radii_mm)


def _outside(spray: Spray, centres_mm: FloatArray, radii_mm: FloatArray) -> Spray:
    """The balls of a spray whose centres lie outside of all spheres."""
    outside = np.ones(len(spray), bool)
    for centre_mm, radius_mm in zip(centres_mm, radii_mm, strict=True):
        outside &= np.linalg.norm(spray.positions_mm - centre_mm, axis=1) > radius_mm
    return spray.where(outside)


def _hole_rim(sheet: Sheet, s_mm: float, angle_rad: float, radius_mm: float, rng: np.random.Generator) -> Spray:
    diameter_mm = rng.uniform(0.028, 0.045)
    turn = np.linspace(0, 2 * np.pi, int(2 * np.pi * radius_mm / (_CHAIN_STEP * diameter_mm)), endpoint=False)
    wobble = radius_mm * (1 + 0.06 * Periodic(rng, 4)(turn / (2 * np.pi)))
    rim_s_mm = s_mm + 1.1 * wobble * np.cos(turn)
    rim_rad = angle_rad + 0.95 * wobble * np.sin(turn) / (s_mm * sheet.shape.arc_factor)
    first_rad, last_rad = sheet.shape.angle_range_rad
    on_sheet = (rim_s_mm < sheet.edge_mm(rim_rad)) & (rim_rad >= first_rad) & (rim_rad <= last_rad)
    diameters_mm = diameter_mm * (1 + 0.15 * Periodic(rng, 6)(turn / (2 * np.pi)))
    return _chain(sheet, rim_s_mm[on_sheet], rim_rad[on_sheet], diameters_mm[on_sheet], 1.0)


def leading_rim(sheet: Sheet, rng: np.random.Generator) -> Spray:
    """The thick edge where the sheet ends, torn open in places."""
    diameter_mm = 0.06
    fine_rad = np.linspace(*sheet.shape.angle_range_rad, 4000)
    edge_mm = sheet.edge_mm(fine_rad)
    steps_mm = np.hypot(np.diff(edge_mm), edge_mm[1:] * sheet.shape.arc_factor * np.diff(fine_rad))
    length_mm = np.concatenate([[0.0], np.cumsum(steps_mm)])
    angles_rad = np.interp(np.arange(0, length_mm[-1], _CHAIN_STEP * diameter_mm), length_mm, fine_rad)
    angles_rad = angles_rad[Periodic(rng, 12)(sheet.fraction(angles_rad)) > -0.6]
    thickness = 1 + 0.25 * Periodic(rng, 40)(sheet.fraction(angles_rad))
    diameters_mm = np.clip(diameter_mm * thickness, 0.03, 0.12)
    return _chain(sheet, sheet.edge_mm(angles_rad), angles_rad, diameters_mm, 0.97)


def free_rims(sheet: Sheet, rng: np.random.Generator) -> Spray:
    """The thick rims along the free sides of a fan; none on a cone."""
    rims = [_free_rim(sheet, angle_rad, rng.uniform(0.09, 0.13)) for angle_rad in sheet.shape.free_edges_rad]
    return Spray.joined([*rims, Spray.of_droplets(np.empty((0, 3)), np.empty(0))])


def _free_rim(sheet: Sheet, angle_rad: float, diameter_mm: float) -> Spray:
    s_mm = np.arange(0.1, 1.15 * sheet.flow.breakup_mm, _CHAIN_STEP * diameter_mm)
    thinner_at_orifice = np.minimum(1, 0.5 + 0.25 * s_mm)
    return _chain(sheet, s_mm, np.full(len(s_mm), angle_rad), diameter_mm * thinner_at_orifice, 1.0)


def ligaments(sheet: Sheet, rng: np.random.Generator) -> Spray:
    """Curved threads with bulbs at their ends, torn off the edge; the further from it, the shorter."""
    return Spray.joined([_ligament(sheet, rng) for _ in range(sheet.flow.ligaments)])


def _ligament(sheet: Sheet, rng: np.random.Generator) -> Spray:
    angle_rad = rng.uniform(*sheet.shape.angle_range_rad)
    age = rng.exponential(0.35)
    start_mm = float(sheet.edge_mm(np.array([angle_rad]))[0]) * (0.9 + age)
    length_mm = rng.uniform(0.4, 2.0) / (1 + 2 * age)
    diameter_mm = rng.uniform(0.04, 0.085)
    step_mm = _CHAIN_STEP * diameter_mm
    path_mm = np.arange(0, length_mm, step_mm)
    heading_rad = rng.uniform(0, np.pi) + np.cumsum(rng.normal(0, np.sqrt(step_mm), len(path_mm)))
    s_mm = start_mm + np.cumsum(step_mm * np.cos(heading_rad))
    angles_rad = angle_rad + np.cumsum(step_mm * np.sin(heading_rad)) / (start_mm * sheet.shape.arc_factor)
    across_mm = rng.normal(0, 0.05 + 0.1 * age) + rng.normal(0, 0.25) * path_mm
    necking = 1 + 0.25 * np.sin(2 * np.pi * path_mm / (4.5 * diameter_mm) + rng.uniform(0, 2 * np.pi))
    to_end_mm = np.minimum(path_mm, length_mm - path_mm)
    bulbs = 1 + 0.6 * np.exp(-((to_end_mm / diameter_mm) ** 2))
    return _chain(sheet, s_mm, angles_rad, diameter_mm * necking * bulbs, rng.uniform(0.85, 1.0), across_mm, angle_rad)


def droplets(sheet: Sheet, rng: np.random.Generator) -> Spray:
    """Droplets from shortly before the edge to the bottom of the scene, a constant number per length of flight."""
    flow = sheet.flow
    angles_rad = rng.uniform(*sheet.shape.angle_range_rad, flow.droplets)
    slopes = np.tan(rng.normal(0, flow.spread_rad, flow.droplets))[:, None]
    rays = sheet.shape.directions(angles_rad) + slopes * sheet.shape.normals(angles_rad)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    first_mm = sheet.edge_mm(angles_rad) * rng.uniform(0.8, 1.3, flow.droplets)
    last_mm = (flow.bottom_mm - flow.orifice_mm[1]) / np.maximum(rays[:, 1], 0.2)
    s_mm = first_mm + (last_mm - first_mm) * rng.uniform(size=flow.droplets)
    diameters_mm = rng.lognormal(np.log(flow.median_diameter_mm), flow.diameter_spread, flow.droplets)
    diameters_mm = np.clip(diameters_mm, 0.01, 0.2)
    slowed = 1 - 0.35 * np.exp(-diameters_mm / flow.median_diameter_mm)
    turbulence = rng.normal(0, 0.03, (flow.droplets, 3))
    return Spray.of_droplets(
        flow.orifice_mm + s_mm[:, None] * rays,
        diameters_mm,
        flow.velocity_mm_per_s * (slowed[:, None] * rays + turbulence),
    )


def _chain(
    sheet: Sheet,
    s_mm: FloatArray,
    angles_rad: FloatArray,
    diameters_mm: FloatArray,
    relative_speed: float,
    across_mm: FloatArray | float = 0.0,
    flight_rad: float | None = None,
) -> Spray:
    """Overlapping balls on the sheet; they fly along their own rays, or all along the ray ``flight_rad``."""
    flight: NDArray[np.float64] = angles_rad if flight_rad is None else np.full(len(s_mm), flight_rad)
    return Spray(
        sheet.points(s_mm, angles_rad, across_mm),
        diameters_mm,
        sheet.velocities(flight, relative_speed),
        np.full(len(s_mm), LiquidKind.LIGAMENT, np.uint8),
        np.ones(len(s_mm)),
    )
