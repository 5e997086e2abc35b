"""Droplets of a second motion that are on no track are told; a series of one motion has none."""

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.droplet_table import Droplets
from processing.analysis.velocity.track_table import track_droplets
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid
from tests.support.droplet_series import BOX, Series, series

RATE_HZ = 20_000.0
GRID = VoxelGrid((int(BOX[2]), int(BOX[1]), int(BOX[0])), (1.0, -2.0, 0.5), 1 / 60)
TOLD = "of the surely real droplets that stay in the grid are on no track"


def shots(*several: Series) -> list[StoredDroplets]:
    """Shots of a series each, together, as files have them."""
    told = []
    for number in range(len(several[0].frames)):
        seen = [one.frames[number] for one in several]
        ghosts = np.concatenate([one.labels[number] for one in several]) < 0
        places, covariance, log_sizes = (
            np.concatenate([getattr(one, name) for one in seen]) for name in ("places", "covariance", "log_sizes")
        )
        droplets = Droplets(
            points_mm=places * GRID.pitch_mm + GRID.origin_mm,
            covariance_mm2=covariance * GRID.pitch_mm**2,
            amplitudes=np.exp(log_sizes),
            amplitude_sd=np.zeros(len(places)),
            views=np.full(len(places), 4),
            residual=np.ones(len(places)),
            p_real=np.where(ghosts, 0.6, 0.99),
        )
        columns = {**droplets.columns(), "frame": np.full(len(places), "a")}
        provenance: dict[str, str | int | float] = {"run": "spray", "shot": number, "settings": "{}"}
        provenance["grid"] = GridSettings.of(GRID).model_dump_json()
        told.append(StoredDroplets(columns, provenance))
    return told


@pytest.mark.parametrize(("step", "density_per_mm3"), [((-4, 5, 0), 3.0), ((12, 9, 4), 2.0)])
def test_droplets_of_another_motion_that_are_on_no_track_are_told(
    step: tuple[float, float, float], density_per_mm3: float
) -> None:
    both = shots(series(0, 7.0, 8), series(9, density_per_mm3, 8, step=step))
    assert any(TOLD in one for one in track_droplets(both, RATE_HZ).doubts)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    "scene",
    [
        {"density_per_mm3": 8.0},
        {"density_per_mm3": 3.0, "found": 0.93, "ghosts": 0.1},
        {"step": (9, 7, 3), "scatter": 0.3},
    ],
)
def test_series_of_one_motion_are_not_doubted(seed: int, scene: dict[str, float]) -> None:
    one = series(seed, frames=8, **{"density_per_mm3": 5.0, **scene})  # type: ignore[arg-type]
    assert track_droplets(shots(one), RATE_HZ).doubts == ()


@pytest.mark.parametrize(("still", "told"), [(1.5, True), (0.0, False)])
def test_dirt_among_droplets_that_fly_is_told(still: float, told: bool) -> None:
    standing = series(9, still, 10, step=(0, 0, 0), scatter=0.0, turn=0.0, gradient=0.0)
    tracks = track_droplets(shots(series(1, 4.0, 10), standing), RATE_HZ)
    assert any("stand still, as sure as that is known: is it dirt?" in one for one in tracks.doubts) == told
