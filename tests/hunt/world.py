"""Sprays whose truth is known, and the pictures that a rig takes of them: all is drawn from the world's seed."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from tests.hunt.light import ALL_ROUND, Bodies, behind_blur, by_waves, covered, spots
from tests.hunt.rig import SIZE_PX, Array, Eye, eyes

HALF_MM = np.array([1.7, 1.3, 1.2])
"""Half-widths of the box that is measured."""
SEPARATION_NS = 6400
STATED = 0.5
"""Share of the shadows whose light is stated, and right."""
DARK = 0.03
"""Of the camera, over its full scale."""
Polarity = Literal["shadow", "bright"]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Droplets of one shot, and how they fly.

    Parameters
    ----------
    places_mm : (N, 3) array
        In exposure A.
    ways_mm : (N, 3) array
        From exposure A to B.
    diameters_um : (N,) array
        Of balls of the same volume.
    halves_mm : (N, 3) array
        From the middle of a rod to where its end begins; 0 of droplets.
    """

    places_mm: Array
    ways_mm: Array
    diameters_um: Array
    halves_mm: Array

    @property
    def round(self) -> "Cloud":
        """Its droplets, without rods."""
        return self.kept(~np.any(self.halves_mm, axis=1))

    @property
    def moved(self) -> "Cloud":
        """The same in exposure B."""
        return replace(self, places_mm=self.places_mm + self.ways_mm)

    def kept(self, chosen: NDArray[np.bool_]) -> "Cloud":
        """Some of them."""
        return Cloud(self.places_mm[chosen], self.ways_mm[chosen], self.diameters_um[chosen], self.halves_mm[chosen])

    def with_(self, other: "Cloud") -> "Cloud":
        """Both together."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__dataclass_fields__)
        return Cloud(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class World:
    """A rig before a spray, and what is stated of both.

    Parameters
    ----------
    kind : str
        Name in the table of worlds.
    seed : int
        Of everything that is drawn.
    clouds : tuple of Cloud
        Of each shot: what is true.
    views : tuple of Eye
        As they are, which is not always as they were calibrated.
    blurs_px : tuple of float
        Gaussian, of each view; behind a sharp lens none counts.
    ratio : float | None
        Aperture of the light over that of the lens; None: blur is Gaussian.
    noise : float
        Standard deviation over the light of the background.
    photons : float
        Share of the variance that goes with the light.
    bits : int
        Of a grey value.
    exposures : int
        1, or 2 where droplets fly.
    polarity : {"shadow", "bright"}
        Of the images.
    stated_ns : int
        Separation, as the run says it.
    stated_light : str
        ``--light``; empty: estimated.
    strange : Cloud, optional
        Droplets besides those that are to be measured, as outside of the box, in all shots.
    squeeze : float
        Height over width of shadows.
    smear_mm : tuple of float
        Way of all droplets while the light is on.
    defocus_px : tuple of float
        Diameter of a disc that blurs each view.
    """

    kind: str
    seed: int
    clouds: tuple[Cloud, ...]
    views: tuple[Eye, ...]
    blurs_px: tuple[float, ...]
    ratio: float | None = None
    noise: float = 0.01
    photons: float = 0.5
    bits: int = 12
    exposures: int = 2
    polarity: Polarity = "shadow"
    stated_ns: int = SEPARATION_NS
    stated_light: str = ""
    strange: Cloud | None = None
    squeeze: float = 1.0
    smear_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    defocus_px: tuple[float, ...] = ()
    ratios: tuple[float | None, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class Pictures:
    """What cameras record, over their full scale.

    Parameters
    ----------
    shots : (shots, exposures, views, rows, columns) array
        With noise, before they become grey values.
    backgrounds, darks : (views, rows, columns) array
        Of exposure A and B alike.
    missing : frozenset of (shot, exposure, view)
        Frames that did not arrive.
    """

    shots: Array
    backgrounds: Array
    darks: Array
    missing: frozenset[tuple[int, int, int]] = frozenset()


def taken(world: World) -> Pictures:
    """Record all shots of a world, its background and its dark image."""
    rng = np.random.default_rng([world.seed, 1])
    lamps = np.stack([_lamp(rng) for _ in world.views])
    darks = np.full_like(lamps, DARK)
    shots = np.stack([np.stack(_exposures(world, cloud)) for cloud in world.clouds])
    if world.polarity == "bright":
        seen = DARK + 0.35 * shots
        return Pictures(seen + world.noise * 0.35 * rng.standard_normal(seen.shape), darks, darks)
    deviation = world.noise * np.sqrt(1 - world.photons + world.photons * np.clip(shots, 0, None))
    seen = DARK + lamps * (shots + deviation * rng.standard_normal(shots.shape))
    reference = lamps * (1 + world.noise / 10 * rng.standard_normal(lamps.shape))
    return Pictures(seen, DARK + reference, darks)


def _lamp(rng: np.random.Generator) -> Array:
    """Light that falls off to one side."""
    row, column = np.mgrid[-1 : 1 : SIZE_PX[1] * 1j, -1 : 1 : SIZE_PX[0] * 1j]
    turn, fall = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.15)
    return np.asarray(rng.uniform(0.55, 0.75) * (1 - fall * (np.cos(turn) * column + np.sin(turn) * row)))


def _exposures(world: World, cloud: Cloud) -> list[Array]:
    seen = cloud if world.strange is None else cloud.with_(world.strange)
    return [np.stack(_images(world, one)) for one in (seen, seen.moved)[: world.exposures]]


def _images(world: World, cloud: Cloud) -> list[Array]:
    steps = np.linspace(-0.5, 0.5, 5) if any(world.smear_mm) else [0.0]
    out = []
    for number, eye in enumerate(world.views):
        images = [
            _image(world, replace(cloud, places_mm=cloud.places_mm + step * np.array(world.smear_mm)), eye, number)
            for step in steps
        ]
        out.append(np.mean(images, axis=0))
    return out


def _image(world: World, cloud: Cloud, eye: Eye, number: int) -> Array:
    places_px, scale = eye.sees(cloud.places_mm)
    if world.polarity == "bright":
        return spots(places_px, cloud.diameters_um / 40, world.blurs_px[number], SIZE_PX)
    ends_px, _ = eye.sees(cloud.places_mm + cloud.halves_mm)
    radii_px = 0.5e-3 * cloud.diameters_um * scale / np.cbrt(world.squeeze)
    mask = covered(Bodies(places_px, radii_px, ends_px - places_px, world.squeeze), SIZE_PX)
    ratio = world.ratios[number] if world.ratios else world.ratio
    image = behind_blur(mask, world.blurs_px[number]) if ratio is None else by_waves(mask, ratio, eye.airy_px)
    return out_of_focus(image, world.defocus_px[number]) if world.defocus_px else image


def out_of_focus(image: Array, disc_px: float) -> Array:
    """Blurred by an even disc, in frequencies: its transform is that of a circular aperture."""
    if not disc_px:
        return image
    rows, columns = image.shape
    waves = np.pi * disc_px * np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns))
    transfer = np.divide(2 * j1(waves), waves, out=np.ones_like(waves), where=waves > 0)
    return np.asarray(np.fft.irfft2(np.fft.rfft2(image) * transfer, image.shape))


def _sizes_um(rng: np.random.Generator, count: int, how: str) -> Array:
    if how == "mono":
        return np.full(count, rng.uniform(30, 70)) * rng.normal(1, 0.005, count)
    if how == "bimodal":
        return np.where(rng.random(count) < 0.7, rng.normal(28, 2, count), rng.normal(75, 5, count))
    return np.clip(rng.lognormal(np.log(rng.uniform(32, 45)), rng.uniform(0.25, 0.45), count), 20, 150)


def placed(rng: np.random.Generator, diameters_um: Array, how: str = "uniform") -> Array:
    """Places in the box at which no two droplets touch, one after the other."""
    places = np.empty((0, 3))
    for number, diameter_um in enumerate(diameters_um):
        while True:
            place = _place_mm(rng, how)
            apart_mm = np.linalg.norm(places - place, axis=1)
            if np.all(apart_mm > 1e-3 * (diameter_um + diameters_um[:number])) and np.all(abs(place) < HALF_MM - 0.03):
                places = np.vstack([places, place])
                break
    return places


def _place_mm(rng: np.random.Generator, how: str) -> Array:
    """Anywhere; around an axis along y; or on a cone around it."""
    y = rng.uniform(-HALF_MM[1], HALF_MM[1])
    if how == "spray":
        x, z = rng.normal(0, 0.55, 2)
    elif how == "cone":
        turn, radius = rng.uniform(0, 2 * np.pi), 0.7 + 0.25 * y + rng.normal(0, 0.08)
        x, z = radius * np.cos(turn), radius * np.sin(turn)
    else:
        x, z = rng.uniform(-1, 1, 2) * HALF_MM[[0, 2]]
    return np.array([x, y, z])


def drawn_cloud(rng: np.random.Generator, count: int, sizes: str, places: str, way_mm: Array) -> Cloud:
    """Droplets with a motion in common, gradients, and a scatter of their own."""
    diameters_um = _sizes_um(rng, count, sizes)
    places_mm = placed(rng, diameters_um, places)
    gradients = rng.normal(0, 0.01, (3, 3))
    ways_mm = way_mm + places_mm @ gradients + rng.normal(0, 0.2 / 60, (count, 3))
    return Cloud(places_mm, ways_mm, diameters_um, np.zeros((count, 3)))


def _threads(rng: np.random.Generator, way_mm: Array) -> Cloud:
    """Two rods, well inside."""
    places_mm = rng.uniform(-0.6, 0.6, (2, 3)) * HALF_MM
    turn = rng.uniform(0, 2 * np.pi, 2)
    halves_mm = rng.uniform(0.2, 0.3, 2)[:, None] * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(2)])
    return Cloud(places_mm, np.tile(way_mm, (2, 1)), rng.uniform(80, 120, 2), halves_mm)


@dataclass(frozen=True)
class Kind:
    """How worlds of one name are drawn.

    Parameters
    ----------
    sizes : str
        Of the droplets: "lognormal", "mono", "bimodal".
    places : str
        "uniform", "spray" or "cone".
    least, most : int
        Droplets of a shot.
    shots : int
        How many.
    views : int
        2 to 4.
    ratio : tuple of float
        Apertures of the light, one of which is drawn; empty: Gaussian blur.
    exposures : int
        1, or 2 where droplets fly.
    threads : bool
        With two ligaments.
    polarity : {"shadow", "bright"}
        Of the images.
    """

    sizes: str = "lognormal"
    places: str = "uniform"
    least: int = 25
    most: int = 60
    shots: int = 1
    views: int = 4
    ratio: tuple[float, ...] = ()
    exposures: int = 2
    threads: bool = False
    polarity: Polarity = "shadow"


KINDS = {
    "few": Kind(least=5, most=8, shots=3, exposures=1),
    "some": Kind(),
    "single": Kind(exposures=1),
    "many": Kind(least=120, most=200, exposures=1),
    "mono": Kind(sizes="mono"),
    "bimodal": Kind(sizes="bimodal"),
    "spray": Kind(places="spray"),
    "cone": Kind(places="cone", least=40, most=80),
    "three views": Kind(views=3, least=20, most=40),
    "two views": Kind(views=2, least=10, most=12, exposures=1),
    "sharp": Kind(ratio=(0.5, 0.7, 0.9, 1.2), exposures=1, least=40, most=60),
    "diffuse": Kind(ratio=(1.6, 8.0), exposures=1, least=40, most=60),
    "threads": Kind(threads=True),
    "bright": Kind(polarity="bright", least=30, most=80),
}


def drawn(kind: str, seed: int) -> World:
    """The world of that name and seed."""
    how, rng = KINDS[kind], np.random.default_rng([seed, *kind.encode()])
    way_mm = rng.uniform([-2, 5, -2], [2, 12, 2]) / 60
    clouds = tuple(_drawn_shot(how, rng, way_mm) for _ in range(how.shots))
    views = eyes(how.views)
    narrow = rng.uniform(0.7, 0.95)
    blurs_px = tuple(narrow * (1.2 if abs(eye.azimuth_deg) > 30 else 1.0) for eye in views)
    ratio = float(rng.choice(how.ratio)) if how.ratio else None
    return World(
        kind=kind,
        seed=seed,
        clouds=clouds,
        views=views,
        blurs_px=blurs_px,
        ratio=ratio,
        noise=float(rng.uniform(0.005, 0.018)) if how.polarity == "shadow" else float(rng.uniform(0.01, 0.05)),
        photons=float(rng.choice([0.0, 0.5, 0.9])),
        bits=int(rng.choice([8, 10, 12])),
        exposures=how.exposures,
        polarity=how.polarity,
        stated_light=_light_in_words(ratio) if how.polarity == "shadow" and rng.random() < STATED else "",
    )


def _light_in_words(ratio: float | None) -> str:
    """As ``--light`` takes it."""
    if ratio is None:
        return "gaussian"
    return "incoherent" if ratio >= ALL_ROUND else f"{ratio:g}"


def _drawn_shot(how: Kind, rng: np.random.Generator, way_mm: Array) -> Cloud:
    cloud = drawn_cloud(rng, int(rng.integers(how.least, how.most + 1)), how.sizes, how.places, way_mm)
    return cloud.with_(_threads(rng, way_mm)) if how.threads else cloud
