"""Exposures A and B of one shot show the same droplets: where one has far fewer, that is told."""

import json
from typing import Any

import numpy as np
import pytest

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.droplets.measured_exposure import ShotVerdict
from processing.analysis.shot_doubts import exposure_doubts
from processing.analysis.spray.spray_doubts import spray_doubts
from processing.analysis.unlike_numbers import unlike_shots
from processing.reconstruction.settings import GridSettings
from processing.runs.droplets.measured_shot import compared
from processing.volume import VoxelGrid
from tests.support.measured_exposures import measured
from tests.support.moving_droplets import exposures

EMPTY = np.arange(0)
FAR = "have 5 times more or fewer droplets than the others"


def shot(
    first: int, second: int, verdict: str = "good", *, hidden: float = 0.0, grid: VoxelGrid | None = None
) -> StoredDroplets:
    told: dict[str, dict[str, Any]] = {"a": {"verdict": "good"}, "b": {"verdict": verdict}}
    if hidden:
        told = {frame: {**one, "hidden": {"volume_share": hidden}} for frame, one in told.items()}
    columns = {"frame": np.repeat(["a", "b"], [first, second]), "amplitude": np.ones(first + second)}
    box = {"grid": GridSettings.of(grid).model_dump_json()} if grid else {}
    return StoredDroplets(columns, {"exposures": json.dumps(told), **box})


@pytest.mark.parametrize("count", [0, 10])
def test_an_exposure_without_most_droplets_makes_both_doubtful(count: int) -> None:
    first, second = exposures(density_per_mm3=2.0)
    pair = measured(first), measured(second.reordered(np.arange(count)))
    told = compared(pair, None)
    assert [one.verdict for one in told] == [ShotVerdict.DOUBTFUL] * 2
    assert f"exposure A has {len(first.labels)} droplets, B {count}" in told[0].reasons[0]


def test_exposures_with_about_as_many_stay_good() -> None:
    for seed in range(20):
        first, second = exposures(seed, 1.0, found=0.95, ghosts=0.1)
        told = compared((measured(first), measured(second)), None)
        assert [one.verdict for one in told] == [ShotVerdict.GOOD] * 2


def test_few_droplets_may_be_in_one_exposure_by_chance() -> None:
    first, second = exposures(density_per_mm3=0.5)
    told = compared((measured(first.reordered(np.arange(6))), measured(second.reordered(EMPTY))), None)
    assert [one.verdict for one in told] == [ShotVerdict.GOOD] * 2


def test_a_refused_exposure_is_not_counted() -> None:
    first, second = exposures(density_per_mm3=2.0)
    refused = measured(second.reordered(EMPTY), verdict=ShotVerdict.REFUSED)
    told = compared((measured(first), refused), None)
    assert [one.verdict for one in told] == [ShotVerdict.GOOD, ShotVerdict.REFUSED]
    assert exposure_doubts([shot(40, 0, "refused")] * 3) == ("3 of 6 exposures are refused, and do not count",)


def test_all_shots_together_tell_a_smaller_difference() -> None:
    assert exposure_doubts([shot(40, 33)] * 3) == ()
    (told,) = exposure_doubts([shot(40, 33)] * 20)
    assert "all shots together: exposure A has 800 droplets, B 660" in told
    assert exposure_doubts([shot(40, 38)] * 100) == ()
    assert exposure_doubts([shot(40, 33)] * 20, "a") == ()


@pytest.mark.parametrize(
    "counts", [(0, 0, 150, 0, 0, 0), (150, 0), (80, 75, 0, 90, 85, 81, 78), (0, 120, 0, 0, 110, 0), (10, 12, 100, 9, 8)]
)
def test_shots_that_have_all_the_droplets_or_none_are_told(counts: tuple[int, ...]) -> None:
    told = "; ".join(spray_doubts([shot(count, count) for count in counts]))
    assert f"of {len(counts)} shots have 5 times more or fewer droplets than the others" in told


def test_gusts_and_few_droplets_are_no_odd_shots() -> None:
    rng = np.random.default_rng(0)
    for gusts in (0.1, 0.4):
        for mean in (2, 10, 50, 300):
            for shots in (2, 3, 6, 12, 40):
                counts = rng.poisson(mean * np.exp(gusts * rng.standard_normal(shots)))
                assert spray_doubts([shot(count, count) for count in counts]) == ()


def test_a_shot_of_which_liquid_hides_much_has_as_many_as_fit_into_the_rest() -> None:
    """80 droplets where nothing is hidden are 8 where a tenth is seen; all that is hidden tells nothing."""
    usual = [shot(80, 78)] * 5
    assert unlike_shots([*usual, shot(8, 9, hidden=0.9), shot(0, 0, hidden=1.0)]) == ""
    assert unlike_shots([shot(8, 9, hidden=0.9)] * 5 + [shot(80, 78)]) == ""
    for odd in (shot(80, 79, hidden=0.9), shot(0, 0, hidden=0.5)):
        assert f"1 of 6 shots {FAR}" in unlike_shots([*usual, odd])


def test_shots_of_a_smaller_box_have_as_many_as_fit_into_it() -> None:
    usual, smaller = VoxelGrid((40, 40, 40), (0, 0, 0), 0.1), VoxelGrid((40, 40, 4), (0, 0, 0), 0.1)
    large = [shot(80, 78, grid=usual)] * 5
    assert unlike_shots([*large, shot(8, 9, grid=smaller)]) == ""
    assert f"1 of 6 shots {FAR}" in unlike_shots([*large, shot(80, 81, grid=smaller)])
    assert f"1 of 7 shots {FAR}" in unlike_shots([*large, shot(80, 81), shot(8, 9, grid=smaller)])


def test_hidden_shares_of_gusty_sprays_make_no_odd_shots() -> None:
    rng = np.random.default_rng(1)
    for mean in (2, 10, 50, 300):
        for shots in (2, 3, 6, 12, 40):
            hidden = rng.uniform(0, 0.95, shots)
            counts = rng.poisson(mean * (1 - hidden) * np.exp(0.3 * rng.standard_normal(shots)))
            several = [shot(count, count, hidden=share) for count, share in zip(counts, hidden, strict=True)]
            assert unlike_shots(several) == ""
