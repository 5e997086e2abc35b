"""Ghosts by droplets without a partner, where it is known which are ghosts."""

import json
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.estimates import Estimate
from processing.analysis.two_exposures.watched_droplets import Watched, watched
from processing.analysis.velocity.unpaired_ghosts import unpaired_ghost_share
from processing.analysis.velocity.velocity_statistics import velocity_statistics
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid

GRID = VoxelGrid.centred((40, 40, 40), 0.1)
MOVED_MM = 1.0


def drawn(rng: np.random.Generator, n: int, ghosts: float) -> tuple[Watched, float]:
    """Droplets of which small ones are often missed in the other exposure, and ghosts, which are small; their share."""
    real = rng.random(n) >= ghosts
    sizes_um = rng.lognormal(np.log(np.where(real, 40, 20)), 0.4)
    found_again = rng.random(n) < 1 / (1 + (10 / sizes_um) ** 3)
    p_real = np.where(real, np.where(rng.random(n) < 0.8, 0.99, 0.7), 0.4)
    return Watched(np.arange(n), sizes_um, p_real, real & found_again), float(np.mean(~real))


def told(shots: list[Watched]) -> Estimate:
    share = unpaired_ghost_share(shots)
    assert isinstance(share, Estimate)
    return share


@pytest.mark.parametrize("ghosts", [0.0, 0.02, 0.1])
def test_ghosts_are_told_although_real_droplets_are_missed(ghosts: float) -> None:
    rng = np.random.default_rng(1)
    seen, true = drawn(rng, 20_000, ghosts)
    share = told([seen])
    assert np.mean(~seen.paired) > ghosts + 0.02
    assert share.value == pytest.approx(true, abs=0.004)
    assert share.low <= true <= share.high


def test_shots_are_pooled() -> None:
    rng = np.random.default_rng(2)
    shots = [drawn(rng, 500, 0.05) for _ in range(10)]
    share = told([seen for seen, _ in shots])
    assert share.low < np.mean([true for _, true in shots]) < share.high
    assert share.high - share.low < 0.6 * (told([shots[0][0]]).high - told([shots[0][0]]).low) + 0.02


def test_without_surely_real_droplets_nothing_is_told() -> None:
    seen, _ = drawn(np.random.default_rng(3), 400, 0.05)
    unsure = Watched(seen.rows, seen.sizes, np.full(len(seen), np.nan), seen.paired)
    assert "0 of 400 droplets that should be in both exposures are surely real" in str(unpaired_ghost_share([unsure]))


def table(rng: np.random.Generator, n: int = 400) -> dict[str, Any]:
    """Droplets that all fly a millimetre along x, of A those that leave the grid, too; every tenth is missed in B."""
    first = rng.uniform(-2, 2, (n, 3))
    second = first + [MOVED_MM, 0, 0]
    kept = np.flatnonzero((second[:, 0] < 2) & (np.arange(n) % 10 > 0))
    partner = np.full(n, -1)
    partner[kept] = n + np.arange(len(kept))
    x, y, z = np.concatenate([first, second[kept]]).T
    columns: dict[str, Any] = {"frame": np.repeat(["a", "b"], [n, len(kept)]), "x_mm": x, "y_mm": y, "z_mm": z}
    columns |= {"partner": np.concatenate([partner, kept]), "amplitude": rng.lognormal(0, 0.5, len(x))}
    return columns | {"p_real": np.full(len(x), 0.99), **dict.fromkeys(("u_m_s", "v_m_s", "w_m_s"), np.ones(len(x)))}


def test_droplets_that_leave_the_grid_are_not_asked() -> None:
    columns = table(np.random.default_rng(4))
    seen = watched(columns, GRID)
    first = columns["frame"] == "a"
    assert len(seen) == np.count_nonzero(columns["x_mm"][first] < 1) + np.count_nonzero(columns["x_mm"][~first] > -1)
    asked = seen.rows[seen.rows < 400]
    assert seen.paired[: len(asked)].tolist() == (asked % 10 > 0).tolist()
    assert not len(watched({**columns, "partner": np.full(len(first), -1)}, GRID))


def test_files_tell_it_with_their_velocities() -> None:
    provenance: dict[str, Any] = {
        "velocity": json.dumps({"verdict": "good", "reasons": [], "pairs": 270, "stayed": 300}),
        "grid": GridSettings.of(GRID).model_dump_json(),
        "settings": "{}",
    }
    columns = table(np.random.default_rng(5))
    statistics = velocity_statistics([StoredDroplets(columns, provenance)])
    assert statistics.unpaired_ghost_share is not None
    assert statistics.unpaired_ghost_share.low == 0
    old = {name: column for name, column in columns.items() if name != "p_real"}
    reason = velocity_statistics([StoredDroplets(old, provenance)]).unpaired_ghost_reason
    assert reason is not None
    assert "do not say how probably droplets are real" in reason
