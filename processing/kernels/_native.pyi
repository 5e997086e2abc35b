from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

MAX_VIEWS: int
METHODS: tuple[str, ...]
"""Of line of sight."""
BLOCK_COLUMNS: int
"""Voxels along x that are computed at once."""
BLOCK_ROWS: int
"""Rows y of a block that is stored; parts of a volume begin at multiples of it."""
OVERHANG_COLUMNS: int
OVERHANG_ROWS: int
"""Of a rectified image, from where the last voxel of a block is seen."""
MAP_SPACING_PX: int
"""From node to node of what ``resample`` takes."""
NODE_SPACINGS: tuple[int, ...]
"""Voxels from node to node that a mapped view may have, widest first."""

MAX_BLOB_WINDOW_PX: int
"""Rows and columns of an image that a blob may reach, and that an image needs."""
BLOB_REACH_SIGMAS: float
"""Where a blob ends."""

DISC_ROWS: int
DISC_NODES: int
DISC_ROWS_PER_OCTAVE: int
SMALLEST_DISC: float
LARGEST_DISC: float
"""Of a table of discs: rows of equal radius, its nodes along distance, and radii in units of the blur."""
LEAST_BLUR_PX: float
COVERAGE_CELLS: int
"""Along a row and a column of a pixel."""

@final
class View:
    """An image and where voxels are seen in it; immutable, keeps its arrays alive."""

    @staticmethod
    def rectified(
        pixels: NDArray[np.int16],
        unit: float,
        scale: NDArray[np.float64],
        shift_u: NDArray[np.float64],
        shift_v: NDArray[np.float64],
        foot: tuple[float, float, float],
        cull: bool = True,
    ) -> View: ...
    @staticmethod
    def mapped(
        pixels: NDArray[np.int16], unit: float, nodes: NDArray[np.float32], spacing: int, cull: bool = True
    ) -> View: ...

def quantise(image: NDArray[np.float32], before: int, after: int, out: NDArray[np.int16], threads: int) -> float: ...
def resample(image: NDArray[np.float32], nodes: NDArray[np.float32], out: NDArray[np.int16], threads: int) -> float: ...
def preprocess(
    pixels: NDArray[np.uint8] | NDArray[np.uint16],
    dark: NDArray[np.float32] | None,
    background: NDArray[np.float32] | None,
    full_scale: float,
    window: int,
    noise_floor: float,
    out: NDArray[np.float32],
    threads: int,
) -> None: ...
def sliding_minimum(image: NDArray[np.float32], window: int, out: NDArray[np.float32], threads: int) -> None: ...
def line_of_sight(
    views: Sequence[View],
    method: str,
    volume: NDArray[np.float32] | NDArray[np.float16] | NDArray[np.uint8],
    threads: int,
    first_row: int = 0,
    grid_rows: int = 0,
    first_column: int = 0,
    grid_columns: int = 0,
) -> None: ...
def sum_of_sight(
    exposures: Sequence[Sequence[View]],
    method: str,
    volume: NDArray[np.float32],
    threads: int,
    first_row: int = 0,
    grid_rows: int = 0,
    first_column: int = 0,
    grid_columns: int = 0,
    mean: bool = False,
) -> None: ...

@final
class Blocks:
    """A volume that is stored where it is not empty, in 16 bits: 6 of exponent, 10 of mantissa."""

    @staticmethod
    def of_views(
        views: Sequence[View],
        shape: tuple[int, int, int],
        exponent: float,
        floor: float,
        most: float,
        threads: int,
        memory: Blocks | None = None,
    ) -> Blocks: ...
    @staticmethod
    def of_volume(volume: NDArray[np.float32], most: float, threads: int, memory: Blocks | None = None) -> Blocks: ...
    def scale(self, factor: float) -> None: ...
    @property
    def unit(self) -> float: ...
    def write(
        self,
        volume: NDArray[np.float32] | NDArray[np.float16] | NDArray[np.uint8],
        threads: int,
        first_row: int = 0,
        factor: float = 1.0,
    ) -> None: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def count(self) -> int: ...

@final
class Projections:
    """What blocks look like from some views, whose images hold the ratios."""

    def __init__(self, views: Sequence[View], shape: tuple[int, int, int]) -> None: ...
    def smart_pass(self, blocks: Blocks, update: Sequence[bool], project: Sequence[bool], threads: int) -> None: ...
    def sum(self, view: int) -> float: ...
    def correct(
        self,
        view: int,
        unit: float,
        recorded: NDArray[np.int16],
        recorded_unit: float,
        exponent: float,
        ratio_counts: float,
        ratio: NDArray[np.int16],
        threads: int,
    ) -> float: ...

def draw_blobs(
    residuals: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    positions: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    factor: float,
    threads: int,
) -> None: ...
def sweep_blobs(
    residuals: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    positions: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    most: int,
    move: bool,
    scale: float,
    damping: float,
    max_step: float,
    tolerance: float,
) -> int: ...
def weigh_blobs(
    residuals: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    positions: NDArray[np.float64],
    amplitudes: NDArray[np.float64],
    out: NDArray[np.float64],
    threads: int,
) -> None: ...
def draw_discs(
    log_transmissions: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    profiles: NDArray[np.float32],
    reach: float,
    positions: NDArray[np.float64],
    squares: NDArray[np.float64],
    factor: float,
    threads: int,
) -> None: ...
def sweep_discs(
    log_transmissions: Sequence[NDArray[np.float32]],
    images: Sequence[NDArray[np.float32]],
    weights: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    profiles: NDArray[np.float32],
    reach: float,
    positions: NDArray[np.float64],
    squares: NDArray[np.float64],
    information: NDArray[np.float64],
    most: int,
    move: bool,
    damping: float,
    largest: float,
    tolerance: float,
) -> int: ...
def weigh_discs(
    log_transmissions: Sequence[NDArray[np.float32]],
    images: Sequence[NDArray[np.float32]],
    weights: Sequence[NDArray[np.float32]],
    nodes: NDArray[np.float64],
    spacing: int,
    optics: NDArray[np.float64],
    profiles: NDArray[np.float32],
    reach: float,
    positions: NDArray[np.float64],
    squares: NDArray[np.float64],
    out: NDArray[np.float64],
    threads: int,
) -> None: ...
def cover(centres: NDArray[np.float64], radii: NDArray[np.float64], out: NDArray[np.float32]) -> None: ...
def find_peaks(volume: NDArray[np.float32], first_row: int, end_row: int, threshold: float) -> NDArray[np.float64]: ...
def stamp(
    volume: NDArray[np.float32], stamps: NDArray[np.float64], profiles: NDArray[np.float32], sampled_finely: bool
) -> None: ...
def add_block_maxima(slab: NDArray[Any], first_row: int, factor: int, maxima: NDArray[Any], threads: int) -> None: ...
def pack_zero_runs(numbers: NDArray[np.float32], adler: int) -> bytes: ...
def available_isas() -> list[str]: ...
def selected_isa() -> str: ...
