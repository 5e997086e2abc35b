"""Views of every kind, and plans and images of them, small enough to be compared with the textbook."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import pytest
from hypothesis import strategies as st
from numpy.typing import NDArray

from processing.calibration.fit.polynomial import fit_polynomial
from processing.calibration.polynomial_mapping import PolynomialMapping
from processing.geometry import FloatArray, PinholeCamera, ViewMapping, view_camera
from processing.reconstruction.choices import Accuracy
from processing.reconstruction.planning.node_view import NodeView, sample_mapping
from processing.reconstruction.planning.plan import MAX_DEVIATION_PX, Plan, plan_reconstruction
from processing.volume import VoxelGrid

PITCH_MM = 1 / 60
Images = list[NDArray[np.float32]]


@contextmanager
def instruction_set(name: str) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TOMOSHADOW_ISA", name)
        yield


@dataclass(frozen=True)
class Mirrored:
    """A central camera that looks into a mirror."""

    camera: PinholeCamera

    @property
    def image_size_px(self) -> tuple[int, int]:
        return self.camera.image_size_px

    @property
    def centre_mm(self) -> FloatArray:
        return self.camera.centre_mm

    def project(self, points_mm: FloatArray) -> FloatArray:
        image_px = self.camera.project(points_mm)
        return np.column_stack([self.image_size_px[0] - 1 - image_px[:, 0], image_px[:, 1]])


@dataclass(frozen=True)
class Bent:
    """A central camera behind a medium that bends lines of sight: with depth, in waves along x, as a saddle."""

    camera: PinholeCamera
    bend_px_per_mm2: float = 0.0
    wavelength_mm: float = 0.0
    saddle_px_per_mm2: float = 0.0

    @property
    def image_size_px(self) -> tuple[int, int]:
        return self.camera.image_size_px

    @property
    def centre_mm(self) -> FloatArray:
        return self.camera.centre_mm

    def project(self, points_mm: FloatArray) -> FloatArray:
        image_px = self.camera.project(points_mm)
        x_mm, y_mm, z_mm = points_mm.T
        image_px[:, 0] += self.bend_px_per_mm2 * z_mm**2 + self.saddle_px_per_mm2 * (x_mm**2 - y_mm**2)
        if self.wavelength_mm:
            image_px[:, 1] += np.sin(2 * np.pi * x_mm / self.wavelength_mm)
        return image_px


class Kind(Enum):
    """Of mappings: those of a camera, and others made of it."""

    PINHOLE = "pinhole"
    MIRRORED = "mirrored"
    TILTED = "tilted"
    POLYNOMIAL = "polynomial"

    def of(self, camera: PinholeCamera) -> ViewMapping:
        if self is Kind.MIRRORED:
            return Mirrored(camera)
        if self is Kind.TILTED:
            return replace(camera, tilt_rad=(0.08, -0.06))
        return polynomial_of(camera) if self is Kind.POLYNOMIAL else camera


def polynomial_of(camera: PinholeCamera) -> PolynomialMapping:
    """What a polynomial makes of a camera within a millimetre of the origin."""
    axes_mm = [np.linspace(-1, 1, n) for n in (6, 6, 4)]
    points_mm = np.stack(np.meshgrid(*axes_mm, indexing="ij"), axis=-1).reshape(-1, 3)
    return fit_polynomial(points_mm, camera.project(points_mm), camera.image_size_px)[0]


@st.composite
def views(draw: st.DrawFn) -> ViewMapping:
    """Any azimuth, pitch and roll, distortion, and any kind."""
    camera = view_camera(
        draw(st.floats(-60, 60)),
        focal_length_mm=85,
        magnification=0.43,
        scale_px_per_mm=60,
        image_size_px=(draw(st.integers(70, 120)), draw(st.integers(50, 90))),
        pitch_deg=draw(st.floats(-15, 15)),
        roll_deg=draw(st.floats(-180, 180)),
        distortion=np.array([draw(st.floats(-2, 2)), 0, draw(st.floats(-0.005, 0.005)), 0.003, 0]),
    )
    kind: Kind = draw(st.sampled_from(Kind))
    return kind.of(camera)


@st.composite
def plans(draw: st.DrawFn) -> tuple[Plan, list[ViewMapping]]:
    """A plan of 2 to 8 views, rectified or by nodes of any spacing, and its mappings."""
    shape = (draw(st.integers(1, 12)), draw(st.integers(1, 40)), draw(st.integers(1, 70)))
    mappings = [draw(views()) for _ in range(draw(st.sampled_from(range(2, 9))))]  # lists would be short
    grid = VoxelGrid.centred(shape, PITCH_MM)
    spacings = draw(st.lists(st.sampled_from([0, 0, 0, 16, 16, 8, 4, 2]), min_size=8, max_size=8))
    plan = plan_reconstruction(mappings, grid, draw(st.sampled_from(Accuracy)))
    mixed = [
        sampled_densely(mapping, grid, spacing) if spacing else view
        for mapping, spacing, view in zip(mappings, spacings, plan.views, strict=False)
    ]
    return Plan(grid, tuple(mixed)), mappings


@st.composite
def cases(draw: st.DrawFn) -> tuple[Plan, Images]:
    """A plan, and images of noise with empty regions."""
    plan, mappings = draw(plans())
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    images = [(0.2 + 0.8 * rng.random(mapping.image_size_px[::-1])).astype(np.float32) for mapping in mappings]
    for image in images:
        image[: draw(st.integers(0, 30))] = 0
        image[:, : draw(st.integers(0, 50))] = 0
    return plan, images


def sampled_densely(mapping: ViewMapping, grid: VoxelGrid, spacing: int) -> NodeView:
    """The mapping by nodes that are so close to each other, or closer where it needs that."""
    view = sample_mapping(mapping, grid, MAX_DEVIATION_PX)
    while view.spacing > spacing:
        view = sample_mapping(mapping, grid, 0.99 * view.deviation_px)
    return view


def random_plan(rng: np.random.Generator) -> tuple[Plan, list[ViewMapping]]:
    """The same by a generator, with views that see all of the volume or a part.

    Hypothesis likes round numbers. With them pixels meet the edge of the volume exactly, and whether they see anything
    of it is a matter of rounding: SMART asks that.
    """
    grid = VoxelGrid.centred(tuple(rng.integers((1, 5, 20), (13, 30, 90)).tolist()), PITCH_MM)
    mappings = [random_view(rng) for _ in range(rng.integers(2, 9))]
    planned = plan_reconstruction(mappings, grid, list(Accuracy)[rng.integers(2)]).views
    by_nodes = 0.5 * rng.integers(3)
    views = [
        sampled_densely(mapping, grid, 2 ** int(rng.integers(1, 5))) if rng.random() < by_nodes else view
        for mapping, view in zip(mappings, planned, strict=True)
    ]
    return Plan(grid, tuple(views)), mappings


def random_view(rng: np.random.Generator) -> ViewMapping:
    camera = view_camera(
        rng.uniform(-60, 60),
        focal_length_mm=85,
        magnification=0.43,
        scale_px_per_mm=60,
        image_size_px=tuple(rng.integers((70, 60), (150, 130)).tolist()),
        pitch_deg=rng.uniform(-15, 15),
        roll_deg=rng.choice([8, 180]) * rng.uniform(-1, 1),
        distortion=rng.uniform(-1, 1, 5) * (2, 0, 0.005, 0.005, 0),
    )
    return list(Kind)[rng.integers(len(Kind))].of(camera)
