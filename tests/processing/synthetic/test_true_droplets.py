"""What should have been found: droplets alone, at the times of both exposures, and which of them stand free."""

from pathlib import Path

import numpy as np

from processing.synthetic.liquid.nozzles import hollow_cone_spray
from processing.synthetic.spray import LiquidKind, Spray
from processing.synthetic.true_droplets import true_droplets
from processing.synthetic.truth_file import FiredSpray, read_true_spray, write_true_spray


def test_rows_are_the_same_droplets_in_both_exposures() -> None:
    spray = hollow_cone_spray(3)
    fired = FiredSpray(5_500, spray)
    first, second = true_droplets(fired, 5_500), true_droplets(fired, 5_500 + 6_400)
    droplets = spray.kinds == LiquidKind.DROPLET
    np.testing.assert_array_equal(first.positions_mm, spray.positions_mm[droplets])
    np.testing.assert_array_equal(second.diameters_mm, spray.diameters_mm[droplets])
    path_mm = second.positions_mm - first.positions_mm
    np.testing.assert_allclose(path_mm, spray.velocities_mm_per_s[droplets] * 6.4e-6, atol=1e-12)
    assert 0.1 < np.median(np.linalg.norm(path_mm, axis=1)) < 0.2


def test_droplets_that_touch_other_liquid_are_told() -> None:
    droplets = Spray.of_droplets(
        np.array([[0, 0, 0], [0.09, 0, 0], [1, 0, 0], [2, 0, 0], [3.0, 0, 0]]), np.array([0.1, 0.1, 0.1, 0.1, 0.1])
    )
    other = Spray(
        np.array([[1.0, 0.12, 0], [2.0, 0.16, 0]]), np.array([0.2, 0.2]), np.zeros((2, 3)),
        np.array([LiquidKind.LIGAMENT, LiquidKind.SHEET], np.uint8), np.array([1, 0.1]),
    )  # fmt: skip
    at_trigger = true_droplets(FiredSpray(0, Spray.joined([other, droplets])), 0)
    np.testing.assert_array_equal(at_trigger.free, [False, False, False, True, True])


def test_droplets_part_as_they_fly() -> None:
    both = Spray.of_droplets(np.zeros((2, 3)), np.full(2, 0.05), np.array([[0, 10_000.0, 0], [0, 0, 0]]))
    fired = FiredSpray(1_000, both)
    assert not true_droplets(fired, 1_000).free.any()
    assert true_droplets(fired, 7_000).free.all()


def test_a_spray_without_droplets_has_none() -> None:
    nothing = hollow_cone_spray(0).of_kind(LiquidKind.SHEET)
    assert true_droplets(FiredSpray(0, nothing), 0).positions_mm.shape == (0, 3)


def test_the_file_of_a_run_tells_all_that_measuring_is_judged_by(tmp_path: Path) -> None:
    spray = hollow_cone_spray(1)
    write_true_spray(tmp_path / "truth.h5", 4, FiredSpray(5_000, spray))
    found = true_droplets(read_true_spray(tmp_path / "truth.h5", 4), 11_400)
    expected = true_droplets(FiredSpray(5_000, spray), 11_400)
    for name in ("positions_mm", "diameters_mm"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-6, err_msg=name)
    np.testing.assert_allclose(found.velocities_mm_per_s, expected.velocities_mm_per_s, rtol=1e-6, atol=1e-2)
    np.testing.assert_array_equal(found.free, expected.free)
    assert 0.5 < np.mean(found.free) < 1
