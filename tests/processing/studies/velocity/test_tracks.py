"""The study of tracks, reduced: few shots of a small volume, from images."""

from dataclasses import replace

import numpy as np
import pytest

from processing.studies.velocity.track_truth import whole_and_right
from processing.studies.velocity.tracks import (
    ASKED_FOR,
    TrackCase,
    TrackRow,
    TrackStudy,
    all_reached,
    track_figure,
    track_line,
    track_statements,
    track_study,
)

CASES = (
    TrackCase("bright", 28, least_whole=0.93, least_right=0.99),
    TrackCase("opaque", 20, least_whole=0.9, least_right=0.99),
)
SMALL = TrackStudy(cases=CASES, seeds=(1,), shots=6, shape=(120, 40, 120), image_size_px=(220, 100), margin_voxel=15)


@pytest.fixture(scope="module")
def rows() -> list[TrackRow]:
    return list(track_study(SMALL))


def test_what_is_asked_for_is_reached(rows: list[TrackRow]) -> None:
    assert all_reached(rows, CASES), [track_line(row) for row in rows]
    assert all(row.tracks > 50 and row.rms_velocity_voxel < 0.06 for row in rows)
    assert all(0.8 < score < 1.3 for row in rows for score in (row.z_velocity, row.z_acceleration))


def test_a_case_that_misses_one_of_its_limits_fails(rows: list[TrackRow]) -> None:
    worse = [replace(rows[0], whole=0.9), replace(rows[0], right=0.98)]
    assert [all_reached([one], CASES) for one in worse] == [False, False]
    assert all_reached(rows[:1], [TrackCase("bright", 28)]) is None


def test_statements_and_figure_name_every_case(rows: list[TrackRow]) -> None:
    statements = track_statements(rows, CASES)
    assert [one.topic.partition(",")[0] for one in statements] == ["bright", "opaque"]
    assert "asked for 93/99" in statements[0].paper
    labels = [label.get_text() for label in track_figure(rows, CASES).axes[0].get_yticklabels()]
    assert labels == [case.name for case in CASES]


def test_cases_asked_for_have_names_of_their_own() -> None:
    assert len({case.name for case in ASKED_FOR}) == len(ASKED_FOR)


def test_a_track_that_is_broken_or_mixed_is_not_whole() -> None:
    labels = [np.array(one, np.intp) for one in ([0, 1, 2], [0, 1, 2], [0, 1, -1], [0, 1])]
    whole = [np.array(one, np.intp) for one in ([5, 7, 8], [5, 7, 8], [5, 7, 8], [5, 7])]
    assert whole_and_right(whole, labels) == (1.0, 7 / 8)
    broken = [*whole[:2], *(np.where(one == 5, 9, one) for one in whole[2:])]
    assert whole_and_right(broken, labels) == (0.5, 6 / 7)
    assert whole_and_right([np.full(len(one), -1) for one in labels], labels) == (0.0, 0.0)
