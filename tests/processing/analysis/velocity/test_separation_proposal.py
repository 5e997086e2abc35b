"""The separation that is proposed lets the median droplet move as far as is wanted, within what cameras accept."""

import json
from dataclasses import replace

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.velocity.separation_proposal import propose_separation
from processing.reconstruction.settings import GridSettings
from processing.studies.simulated_droplets import study_grid

PITCH_MM = 1 / 60


def shot(seed: int, v_m_s: float, spread: float = 0.1, droplets: int = 200) -> StoredDroplets:
    """Droplets of A that fly along y; every fifth has no partner, and B has the same velocities."""
    rng = np.random.default_rng(seed)
    speeds_m_s = v_m_s * rng.lognormal(0, spread, droplets)
    speeds_m_s[::5] = np.nan
    columns = {
        "frame": np.repeat(["a", "b"], droplets),
        "u_m_s": np.zeros(2 * droplets),
        "v_m_s": np.tile(speeds_m_s, 2),
        "w_m_s": np.zeros(2 * droplets),
    }
    grid = GridSettings.of(study_grid((20, 20, 20))).model_dump_json()
    return StoredDroplets(columns, {"grid": grid, "velocity": json.dumps({"pairs": 160, "stayed": 200})})


def test_the_median_droplet_will_move_by_five_voxels() -> None:
    found = propose_separation([shot(seed, 20.0) for seed in range(3)])
    wanted_ns = 5 * PITCH_MM / 20.0 * 1e6
    assert found.separation_ns == pytest.approx(wanted_ns, rel=0.03)
    assert found.will_move_voxel == pytest.approx(5, abs=0.02)
    assert found.wanted_ns is not None
    assert found.wanted_ns.low < wanted_ns < found.wanted_ns.high
    assert (found.shots, found.pairs, found.reason) == (3, 480, None)
    twice = propose_separation([shot(seed, 20.0) for seed in range(3)], moved_voxel=10)
    assert twice.separation_ns == pytest.approx(2 * wanted_ns, rel=0.03)


def test_one_shot_has_no_interval() -> None:
    found = propose_separation([shot(0, 20.0)])
    assert found.wanted_ns is None
    assert found.separation_ns is not None


@pytest.mark.parametrize(("window_ns", "proposed_ns"), [((6000, 90_000), 6000), ((200, 2015), 2015)])
def test_cameras_have_the_last_word(window_ns: tuple[int, int], proposed_ns: int) -> None:
    found = propose_separation([shot(0, 20.0), shot(1, 20.0)], window_ns)
    assert found.separation_ns == proposed_ns
    assert f"cameras accept {window_ns[0]} to {window_ns[1]} ns" in (found.reason or "")
    assert found.will_move_voxel == pytest.approx(5 * proposed_ns / 4167, rel=0.03)


def test_fast_droplets_shorten_it() -> None:
    found = propose_separation([shot(0, 20.0, spread=1.5)])
    assert found.fast_will_move_voxel == pytest.approx(20, abs=0.2)
    assert (found.will_move_voxel or 9) < 5
    assert "5 % of the droplets would move by more than 20 voxels" in (found.reason or "")


def test_without_pairs_there_is_no_proposal_and_its_reason_is_told() -> None:
    refused = {"reasons": ["no motion is common to any neighbours"]}
    nothing = StoredDroplets({"frame": np.array(["a", "b"])}, {"velocity": json.dumps(refused)})
    found = propose_separation([nothing])
    assert (found.separation_ns, found.shots) == (None, 0)
    assert "no motion is common to any neighbours" in (found.reason or "")
    assert "a third of the separation" in (found.reason or "")


def test_a_proposal_of_doubtful_velocities_says_so() -> None:
    """Where half of the droplets have no partner, as those that fly too far, the median is that of the slow ones."""
    said = json.dumps({"verdict": "doubtful", "reasons": ["41 % of the droplets have no partner"], "pairs": 200})
    shots = [shot(seed, 20.0) for seed in range(3)]
    doubtful = [replace(one, provenance={**one.provenance, "velocity": said}) for one in shots]
    assert "41 % of the droplets have no partner" in str(propose_separation(doubtful).model_dump())
    assert "no partner" not in str(propose_separation(shots).model_dump())
