"""The study of sizes, reduced: the same lines of sight as the paper's, less along y."""

from dataclasses import replace

import pytest

from processing.studies.shadows.sizes import (
    ASKED_FOR,
    SizeCase,
    SizeRow,
    SizeStudy,
    all_reached,
    size_figure,
    size_line,
    size_statements,
    size_study,
)

CASE = SizeCase(20, least_found=0.97, most_ghosts=0.02, most_d32_error=0.02, most_sd_um=0.6)
SMALL = SizeStudy(cases=(CASE,), seeds=(1,), shape=(160, 24, 200), image_size_px=(300, 80), margin_voxel=12)


@pytest.fixture(scope="module")
def rows() -> list[SizeRow]:
    return list(size_study(SMALL))


def test_what_is_asked_for_is_reached(rows: list[SizeRow]) -> None:
    assert all_reached(rows, SMALL.cases), [size_line(row) for row in rows]
    assert all(0.9 < row.z_sd < 1.2 and 0.6 < row.z_size < 1.2 for row in rows)
    assert all(row.held > 0.9 and row.size_held > 0.87 for row in rows)


def test_a_case_that_misses_one_of_its_limits_fails(rows: list[SizeRow]) -> None:
    (row,) = rows
    worse = [
        replace(row, found=0.9),
        replace(row, ghosts=0.1),
        replace(row, d32_error=-0.05),
        replace(row, sd_um=1.0),
    ]
    assert [all_reached([one], SMALL.cases) for one in worse] == [False] * 4
    assert all_reached(rows, [SizeCase(20)]) is None


def test_statements_and_figure_name_every_case(rows: list[SizeRow]) -> None:
    (statement,) = size_statements(rows, SMALL.cases)
    assert statement.topic.startswith(CASE.name)
    assert "asked for 97.0/2.0" in statement.paper
    assert len(size_figure(rows, SMALL.cases).axes) == 2


def test_cases_asked_for_have_names_of_their_own() -> None:
    assert len({case.name for case in ASKED_FOR}) == len(ASKED_FOR)
