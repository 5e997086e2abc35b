"""The droplet study, reduced: the same lines of sight as the paper's, less along y."""

from dataclasses import replace

import numpy as np
import pytest

from processing.studies.droplets import (
    ASKED_FOR,
    DropletCase,
    DropletRow,
    DropletStudy,
    all_reached,
    droplet_figure,
    droplet_line,
    droplet_statements,
    droplet_study,
)
from processing.synthetic.bright_particles import spots_image
from tests.support.bright_scenes import scene

SMALL = DropletStudy(
    cases=(
        DropletCase(28, least_found=0.99, most_ghosts=0.005),
        DropletCase(28, 1.5, least_found=0.98, most_ghosts=0.01),
        DropletCase(56, calibration_error_px=0.1, least_found=0.97, most_ghosts=0.01),
    ),
    seeds=(1,),
    shape=(160, 30, 240),
    image_size_px=(340, 80),
    margin_voxel=10,
)


@pytest.fixture(scope="module")
def rows() -> list[DropletRow]:
    return list(droplet_study(SMALL))


def test_what_is_asked_for_is_reached(rows: list[DropletRow]) -> None:
    assert all_reached(rows), [droplet_line(row) for row in rows]
    assert all(row.verdict == "good" for row in rows)
    assert all(0.85 < row.z_sd < 1.3 for row in rows)


def test_shots_of_a_study_come_again(rows: list[DropletRow]) -> None:
    again = next(droplet_study(replace(SMALL, cases=SMALL.cases[:1])))
    assert replace(again, cpu_ms_per_droplet=0) == replace(rows[0], cpu_ms_per_droplet=0)


def test_a_mean_below_what_is_asked_for_fails(rows: list[DropletRow]) -> None:
    assert all_reached([replace(rows[0], found=0.9), *rows[1:]]) is False
    assert all_reached([replace(rows[0], ghosts=0.1), *rows[1:]]) is False
    assert all_reached([replace(row, least_found=None, most_ghosts=None) for row in rows]) is None


def test_statements_and_figure_name_every_case(rows: list[DropletRow]) -> None:
    statements = droplet_statements(rows)
    assert [statement.topic.partition(":")[0] for statement in statements] == [case.name for case in SMALL.cases]
    assert "asked for 99.0/0.5" in statements[0].paper
    assert len(droplet_figure(rows).axes) == 2


def test_cases_asked_for_have_names_of_their_own() -> None:
    assert len({case.name for case in ASKED_FOR}) == len(ASKED_FOR)


def test_light_of_a_spot_is_that_of_a_gaussian() -> None:
    camera = scene().believed[0]
    image = spots_image(camera, np.zeros((1, 3)), np.array([2.0]), 1.3)
    assert image.sum() == pytest.approx(2 * 2 * np.pi * 1.3**2, rel=1e-6)
