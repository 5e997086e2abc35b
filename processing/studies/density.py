"""Reconstruction quality against droplet density (Fig. 7 of the paper).

A volume is filled with Gaussian blobs, projected onto the images of four pinhole cameras, reconstructed, and
compared with the truth.
"""

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, ScalarFormatter
from numpy.typing import NDArray

from processing.geometry import FloatArray, PinholeCamera, view_camera
from processing.quality import quality_factor
from processing.reconstruction.line_of_sight import DEFAULT_THREADS, line_of_sight
from processing.reconstruction.method import ReconstructionMethod
from processing.reconstruction.plan import Plan, plan_reconstruction
from processing.reconstruction.smart import smart
from processing.volume import VoxelGrid

Volume = NDArray[np.float32]
Image = NDArray[np.float32]

SCALE_VOXEL_PER_MM = 60.0
AZIMUTHS_DEG = (45.0, 15.0, -15.0, -45.0)
FOCAL_LENGTHS_MM = (100.0, 85.0, 85.0, 100.0)
MAGNIFICATIONS = (0.45, 0.43, 0.44, 0.43)
IMAGE_SIZE_PX = (600, 560)
PAPER_QUALITY, PAPER_DENSITY_PER_MM3 = 0.5, 20.0
FAINTEST = 1e-3
"""Blobs end where they fall below this share of their maximum."""
COLOURS = {"mlos": "#0072b2", "minlos": "#e69f00", "gavlos": "#009e73", "smart": "#cc79a7"}


@dataclass(frozen=True)
class DensityStudy:
    """What to simulate; the defaults are the paper's.

    Parameters
    ----------
    shape : tuple[int, int, int]
        Voxels (nz, ny, nx) at 60 voxel/mm.
    counts : tuple of int
        Numbers of droplets.
    sigma_voxel : float
        Width of a droplet. The paper says "3 voxel diameter", which leaves it open; 1.5 reproduces its figure.
    methods : tuple of ReconstructionMethod
        GAVLOS, MINLOS, MLOS, SMART.
    iterations : int
        Of SMART.
    window, step : int
        Interrogation windows of the quality factor, in voxels.
    image_size_px : tuple[int, int]
        (width, height) of every view.
    """

    shape: tuple[int, int, int] = (250, 500, 500)
    counts: tuple[int, ...] = (1000, 2000, 4000, 8000, 16000)
    sigma_voxel: float = 1.5
    methods: tuple[ReconstructionMethod, ...] = (
        ReconstructionMethod.MLOS,
        ReconstructionMethod.MINLOS,
        ReconstructionMethod.GAVLOS,
        ReconstructionMethod.SMART,
    )
    iterations: int = 20
    window: int = 64
    step: int = 32
    image_size_px: tuple[int, int] = IMAGE_SIZE_PX

    @property
    def grid(self) -> VoxelGrid:
        """The simulated volume, centred on the world origin."""
        return VoxelGrid.centred(self.shape, 1 / SCALE_VOXEL_PER_MM)


@dataclass(frozen=True)
class DensityRow:
    """One point of Fig. 7: mean-subtracted quality factor of a method at a droplet density."""

    density_per_mm3: float
    method: str
    quality_factor: float
    sigma_voxel: float


def density_study(study: DensityStudy | None = None, threads: int = DEFAULT_THREADS) -> Iterator[DensityRow]:
    """Simulate, reconstruct and compare; yields each result as soon as it is known.

    The same study gives the same rows: droplets are placed by a generator seeded with their number.
    """
    study = study or DensityStudy()
    cameras = study_cameras(study.image_size_px)
    plan = plan_reconstruction(cameras, study.grid)
    volume = np.empty(study.shape, dtype=np.float32)
    for count in study.counts:
        truth = blob_volume(study.shape, count, study.sigma_voxel, np.random.default_rng(count))
        images = normalised([project_volume(truth, study.grid, camera) for camera in cameras])
        for method in study.methods:
            _reconstruct(plan, images, method, study.iterations, volume, threads)
            quality = quality_factor(truth, volume, study.window, study.step)
            yield DensityRow(count / study.grid.volume_mm3, method.value, quality, study.sigma_voxel)


def study_cameras(image_size_px: tuple[int, int] = IMAGE_SIZE_PX) -> list[PinholeCamera]:
    """The four views of the experiment (Table 1) as ideal pinhole cameras."""
    return [
        view_camera(
            azimuth_deg,
            focal_length_mm=focal_length_mm,
            magnification=magnification,
            scale_px_per_mm=SCALE_VOXEL_PER_MM,
            image_size_px=image_size_px,
        )
        for azimuth_deg, focal_length_mm, magnification in zip(
            AZIMUTHS_DEG, FOCAL_LENGTHS_MM, MAGNIFICATIONS, strict=True
        )
    ]


def blob_volume(shape: tuple[int, int, int], count: int, sigma_voxel: float, rng: np.random.Generator) -> Volume:
    """Volume (z, y, x) of Gaussian blobs of height 1 at uniformly distributed positions; overlaps add up."""
    volume = np.zeros(shape, dtype=np.float32)
    reach = max(2, int(np.ceil(3.5 * sigma_voxel)))
    for centre in rng.uniform(0, np.array(shape[::-1]) - 1, (count, 3))[:, ::-1]:
        nearest = np.rint(centre).astype(int)
        first, end = np.maximum(nearest - reach, 0), np.minimum(nearest + reach + 1, shape)
        offsets = [np.arange(a, b) - c for a, b, c in zip(first, end, centre, strict=True)]
        along_z, along_y, along_x = (np.exp(-(offset**2) / (2 * sigma_voxel**2)) for offset in offsets)
        region = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        volume[region] += along_z[:, None, None] * along_y[:, None] * along_x
    volume[volume < FAINTEST] = 0
    return volume


def project_volume(volume: Volume, grid: VoxelGrid, camera: PinholeCamera) -> Image:
    """Image (rows, columns) of a volume: each plane interpolated bilinearly at the pixels (eq. 5), then summed."""
    image = np.zeros(camera.image_size_px[::-1], dtype=np.float32)
    x_mm, y_mm, _ = grid.origin_mm
    to_plane = np.array([[grid.pitch_mm, 0, x_mm], [0, grid.pitch_mm, y_mm], [0, 0, 1]])
    for plane, z_mm in zip(volume, grid.z_mm, strict=True):
        to_image: FloatArray = camera.plane_homography(float(z_mm)) @ to_plane
        image += cv2.warpPerspective(plane, to_image, camera.image_size_px, flags=cv2.INTER_LINEAR)
    return image


def normalised(images: Sequence[Image]) -> list[Image]:
    """Images divided by the brightest pixel of all."""
    brightest = max(float(image.max()) for image in images)
    return [image / np.float32(brightest) for image in images]


def density_csv(rows: Sequence[DensityRow]) -> str:
    """The rows as CSV text with a header line."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(DensityRow)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def density_figure(rows: Sequence[DensityRow], study: DensityStudy | None = None) -> Figure:
    """Quality factor of the rows of a study against droplet density, one curve per method (Fig. 7, right)."""
    study = study or DensityStudy()
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    for method in dict.fromkeys(row.method for row in rows):
        curve = sorted((row.density_per_mm3, row.quality_factor) for row in rows if row.method == method)
        axes.plot(*zip(*curve, strict=True), marker="o", label=method.upper(), color=COLOURS.get(method))
    axes.axhline(PAPER_QUALITY, color="0.4", linestyle="--", linewidth=1)
    axes.axvline(PAPER_DENSITY_PER_MM3, color="0.4", linestyle="--", linewidth=1)
    axes.plot(PAPER_DENSITY_PER_MM3, PAPER_QUALITY, marker="s", color="0.2", linestyle="none")
    axes.annotate(
        "paper: MLOS usable\nup to about 20 droplets/mm³\n(Q > 0.5)",
        (PAPER_DENSITY_PER_MM3, 0.03),
        xytext=(-6, 0),
        textcoords="offset points",
        ha="right",
        fontsize="small",
        color="0.3",
    )
    densities = sorted({row.density_per_mm3 for row in rows})
    axes.set(xscale="log", ylim=(0, 1.02), xlabel="droplet density [1/mm³]", ylabel="quality factor Q [-]")
    axes.set_xticks(densities)
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{density:.3g}" for density in densities])
    axes.set_title(
        rf"Gaussian droplets of $\sigma$ = {study.sigma_voxel:g} voxel; "
        f"Q mean-subtracted in {study.window}³ windows at steps of {study.step}",
        fontsize="small",
    )
    axes.grid(alpha=0.25)
    axes.legend(frameon=False, loc="upper right")
    return figure


def _reconstruct(
    plan: Plan, images: Sequence[Image], method: ReconstructionMethod, iterations: int, out: Volume, threads: int
) -> None:
    if method is ReconstructionMethod.SMART:
        smart(plan, images, iterations=iterations, out=out, threads=threads)
    else:
        line_of_sight(plan, images, method, out, threads=threads)
