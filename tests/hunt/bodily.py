"""Distortions of what is before the lenses: of droplets, views and light, and of what is stated of them.

Each takes a world and an amount between 0 and 1, which it makes an amount of its own, and says it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.hunt.rig import SCALE_PX_PER_MM, Array, Eye
from tests.hunt.world import HALF_MM, SEPARATION_NS, Cloud, World, drawn_cloud

Rng = np.random.Generator
Changed = tuple[World, str]


def between(low: float, high: float, amount: float) -> float:
    """By factors alike from the low to the high one."""
    return float(low * (high / low) ** amount)


def _one_view(world: World, rng: Rng) -> int:
    return int(rng.integers(len(world.views)))


def _with_view(world: World, number: int, eye: Eye) -> World:
    views = list(world.views)
    views[number] = eye
    return replace(world, views=tuple(views))


def view_shifted(world: World, amount: float, rng: Rng) -> Changed:
    number, far_px, turn = _one_view(world, rng), between(0.2, 20, amount), rng.uniform(0, 2 * np.pi)
    shift_px = (far_px * np.cos(turn), far_px * np.sin(turn))
    return _with_view(world, number, replace(world.views[number], shift_px=shift_px)), f"{far_px:.2g} px"


def views_shifted(world: World, amount: float, rng: Rng) -> Changed:
    """All views alike along y."""
    far_px = between(1, 20, amount)
    views = tuple(replace(eye, shift_px=(0.0, far_px)) for eye in world.views)
    return replace(world, views=views), f"{far_px:.2g} px"


def view_scaled(world: World, amount: float, rng: Rng) -> Changed:
    number, more = _one_view(world, rng), between(0.002, 0.1, amount) * rng.choice([-1, 1])
    return _with_view(world, number, replace(world.views[number], zoom=1 + more)), f"{100 * more:+.2g} %"


def views_scaled(world: World, amount: float, rng: Rng) -> Changed:
    more = between(0.005, 0.2, amount) * rng.choice([-1, 1])
    return replace(world, views=tuple(replace(eye, zoom=1 + more) for eye in world.views)), f"{100 * more:+.2g} %"


def view_rolled(world: World, amount: float, rng: Rng) -> Changed:
    number, roll_deg = _one_view(world, rng), between(0.05, 5, amount)
    return _with_view(world, number, replace(world.views[number], roll_deg=roll_deg)), f"{roll_deg:.2g} deg"


def views_exchanged(world: World, _amount: float, rng: Rng) -> Changed:
    one, other = rng.choice(len(world.views), 2, replace=False)
    views = list(world.views)
    views[one], views[other] = views[other], views[one]
    return replace(world, views=tuple(views)), f"{one + 1} and {other + 1}"


def view_blurred(world: World, amount: float, rng: Rng) -> Changed:
    number, blur_px = _one_view(world, rng), between(1.0, 4, amount)
    blurs_px = list(world.blurs_px)
    blurs_px[number] = blur_px
    return replace(world, blurs_px=tuple(blurs_px)), f"{blur_px:.2g} px"


def view_out_of_focus(world: World, amount: float, rng: Rng) -> Changed:
    number, disc_px = _one_view(world, rng), between(1.5, 12, amount)
    return replace(
        world, defocus_px=tuple(disc_px * (n == number) for n in range(len(world.views)))
    ), f"{disc_px:.2g} px"


def views_out_of_focus(world: World, amount: float, _rng: Rng) -> Changed:
    disc_px = between(1.5, 8, amount)
    return replace(world, defocus_px=(disc_px,) * len(world.views)), f"{disc_px:.2g} px"


def smeared(world: World, amount: float, rng: Rng) -> Changed:
    """Motion while the light is on, down with some along x."""
    way_px = between(0.4, 6, amount)
    way_mm = way_px / SCALE_PX_PER_MM
    return replace(world, smear_mm=(0.2 * way_mm, 0.98 * way_mm, 0.0)), f"{way_px:.2g} px"


def flattened(world: World, amount: float, _rng: Rng) -> Changed:
    less = between(0.02, 0.4, amount)
    return replace(world, squeeze=1 - less), f"{100 * less:.2g} %"


def droplets_outside(world: World, amount: float, rng: Rng) -> Changed:
    """Before or behind the box, where its views look."""
    count = max(1, round(between(0.1, 1.5, amount) * len(world.clouds[0].round.diameters_um)))
    cloud = drawn_cloud(rng, count, "lognormal", "uniform", world.clouds[0].ways_mm.mean(axis=0))
    beyond = cloud.places_mm[:, 2] + np.where(rng.random(count) < 0.5, -1, 1) * 2 * HALF_MM[2]
    return _besides(world, replace(cloud, places_mm=np.column_stack([cloud.places_mm[:, :2], beyond]))), f"{count}"


def second_motion(world: World, amount: float, rng: Rng) -> Changed:
    """A share of the droplets flies elsewhere."""
    share, far = between(0.05, 0.5, amount), rng.uniform(-20, 20, 3) / SCALE_PX_PER_MM
    clouds = tuple(_partly_moved(cloud, rng.random(len(cloud.ways_mm)) < share, far) for cloud in world.clouds)
    return replace(world, clouds=clouds), f"{100 * share:.2g} %"


def _partly_moved(cloud: Cloud, chosen: NDArray[np.bool_], far_mm: Array) -> Cloud:
    return replace(cloud, ways_mm=cloud.ways_mm + chosen[:, None] * far_mm)


def resting_droplets(world: World, amount: float, rng: Rng) -> Changed:
    """A share of them stands still."""
    share = between(0.05, 0.9, amount)
    clouds = tuple(
        replace(cloud, ways_mm=cloud.ways_mm * (rng.random(len(cloud.ways_mm)) >= share)[:, None])
        for cloud in world.clouds
    )
    return replace(world, clouds=clouds), f"{100 * share:.2g} %"


def fast_droplets(world: World, amount: float, _rng: Rng) -> Changed:
    """All of them, by so many times their way."""
    times = between(1.5, 8, amount)
    return replace(
        world, clouds=tuple(replace(cloud, ways_mm=times * cloud.ways_mm) for cloud in world.clouds)
    ), f"x{times:.2g}"


def separation_wrong(world: World, amount: float, rng: Rng) -> Changed:
    times = between(1.05, 3, amount) ** rng.choice([-1, 1])
    return replace(world, stated_ns=round(times * SEPARATION_NS)), f"x{times:.2g}"


def light_stated_wrong(world: World, _amount: float, rng: Rng) -> Changed:
    stated = str(rng.choice(["0.4", "0.6", "0.8", "1.0", "1.5", "incoherent", "gaussian"]))
    return replace(world, stated_light=stated), f"{stated}, true {world.ratio or 'gaussian'}"


def lamps_unlike(world: World, amount: float, rng: Rng) -> Changed:
    """Each view in a light of its own."""
    low, high = between(0.95, 0.5, amount), between(1.05, 2.0, amount)
    return replace(
        world, ratios=tuple(float(rng.choice([low, high])) for _ in world.views)
    ), f"{low:.2g} and {high:.2g}"


def threads_among(world: World, amount: float, rng: Rng) -> Changed:
    """Short rods, no droplets."""
    count = round(between(1, 8, amount))
    cloud = drawn_cloud(rng, count, "mono", "uniform", world.clouds[0].ways_mm.mean(axis=0))
    turn = rng.uniform(0, 2 * np.pi, count)
    halves_mm = rng.uniform(0.03, 0.25, count)[:, None] * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    return _besides(world, replace(cloud, halves_mm=halves_mm)), f"{count}"


def a_large_one(world: World, amount: float, rng: Rng) -> Changed:
    """One droplet that is much larger, and counts as one."""
    diameter_um = between(200, 900, amount)
    place_mm = rng.uniform(-0.4, 0.4, (1, 3)) * HALF_MM
    clouds = tuple(_cleared(cloud, place_mm, diameter_um) for cloud in world.clouds)
    return replace(world, clouds=clouds), f"{diameter_um:.2g} um"


def _cleared(cloud: Cloud, place_mm: Array, diameter_um: float) -> Cloud:
    apart_mm = np.linalg.norm(cloud.places_mm - place_mm, axis=1) - 0.5e-3 * (cloud.diameters_um + diameter_um)
    way_mm = cloud.ways_mm.mean(axis=0)[None]
    return cloud.kept(apart_mm > 0.03).with_(Cloud(place_mm, way_mm, np.array([diameter_um]), np.zeros((1, 3))))


def _besides(world: World, cloud: Cloud) -> World:
    return replace(world, strange=cloud if world.strange is None else world.strange.with_(cloud))
