"""The study of ghosts by droplets without a partner, reduced."""

import numpy as np
import pytest

from processing.studies.real_droplets.persistence import (
    PersistenceRow,
    persistence_figure,
    persistence_line,
    persistence_shares,
    persistence_statements,
    persistence_study,
)
from processing.studies.real_droplets.reality import RealityStudy
from processing.studies.shadows.sizes import SizeCase

CASE = SizeCase(62, 35, noise_percent=5)


@pytest.fixture(scope="module")
def row() -> PersistenceRow:
    (row,) = persistence_study(RealityStudy(cases=(CASE,), seeds=(401,), shape=(250, 30, 250)))
    return row


def test_real_droplets_persist_and_ghosts_do_not(row: PersistenceRow) -> None:
    assert row.ghosts > 10
    assert row.paired_ghosts < 0.4 * row.ghosts
    real_unpaired = row.unpaired - (row.ghosts - row.paired_ghosts)
    assert real_unpaired < 0.2 * (row.droplets - row.ghosts)


def test_ghosts_are_told_by_partners(row: PersistenceRow) -> None:
    true = row.ghosts / row.droplets
    assert row.told == pytest.approx(true, rel=0.6)
    assert row.low <= true <= row.high
    assert row.unpaired / row.droplets > 1.5 * true


def test_statements_line_and_figure_name_what_is_told_and_what_is_true(row: PersistenceRow) -> None:
    first, kind, case = persistence_statements([row])
    assert f"{row.paired_ghosts} of {row.ghosts} ghosts" in first.ours
    assert kind.topic == "shadows: share of ghosts told"
    assert "true" in case.ours
    assert f"{row.ghosts} ghosts have a partner" in persistence_line(row)
    (axes,) = persistence_figure([row]).axes
    assert len(axes.lines) == 3


def test_what_is_not_told_has_a_reason() -> None:
    row = PersistenceRow("bright", "case", 1, 1.0, 100, 5, 8, 1, *(float("nan"),) * 3, 0.05, "too few")
    assert not persistence_shares([row])[0].told
    assert np.isnan(row.told)
