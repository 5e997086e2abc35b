"""The study of velocities, reduced: the same lines of sight as the paper's, less along x and y."""

from dataclasses import replace

import pytest

from processing.studies.velocity.velocities import (
    ASKED_FOR,
    VelocityCase,
    VelocityRow,
    VelocityStudy,
    all_reached,
    velocity_figure,
    velocity_line,
    velocity_statements,
    velocity_study,
)

CASES = (
    VelocityCase("bright", 40, least_paired=0.96, least_right=0.99, most_rms_voxel=0.06),
    VelocityCase("opaque", 20, least_paired=0.93, least_right=0.99, most_rms_voxel=0.06),
)
SMALL = VelocityStudy(cases=CASES, seeds=(1,), shape=(160, 40, 160), image_size_px=(260, 100), margin_voxel=18)


@pytest.fixture(scope="module")
def rows() -> list[VelocityRow]:
    return list(velocity_study(SMALL))


def test_what_is_asked_for_is_reached(rows: list[VelocityRow]) -> None:
    assert all_reached(rows, CASES), [velocity_line(row) for row in rows]
    assert all(row.verdict != "refused" and row.told_wrong < 0.01 for row in rows)
    assert all(7 < row.least_voxel < row.most_voxel < 17 for row in rows)


def test_a_case_that_misses_one_of_its_limits_fails(rows: list[VelocityRow]) -> None:
    worse = [
        replace(rows[0], paired=0.9),
        replace(rows[0], right=0.98),
        replace(rows[0], rms_w_voxel=0.2),
        replace(rows[0], z_sd=1.3),
        replace(rows[0], z_sd=0.8),
    ]
    assert [all_reached([one], CASES) for one in worse] == [False] * 5
    assert all_reached(rows[:1], [VelocityCase("bright", 40)]) is None


def test_statements_and_figure_name_every_case(rows: list[VelocityRow]) -> None:
    statements = velocity_statements(rows, CASES)
    assert [one.topic.partition(":")[0] for one in statements] == [case.name for case in CASES]
    assert "asked for 96/99.0; 0.06 voxel" in statements[0].paper
    labels = [label.get_text() for label in velocity_figure(rows, CASES).axes[0].get_yticklabels()]
    assert labels == [case.name for case in CASES]


def test_cases_asked_for_have_names_of_their_own() -> None:
    assert len({case.name for case in ASKED_FOR}) == len(ASKED_FOR)
