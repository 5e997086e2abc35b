"""What nothing tells of droplets is said where there is something to say."""

import pytest

from daq.files.run_directory import RunHeader, ViewFormat
from processing.runs import unchecked_images
from processing.runs.unchecked_images import unlike_motions


def test_droplets_without_a_partner_may_fly_otherwise() -> None:
    (told,) = unlike_motions([0.4, 0.2])
    assert "how the 30 % of the droplets fly that should be in both exposures and have no partner" in told.what


def test_of_nearly_all_that_have_one_and_of_none_that_were_asked_nothing_is_said() -> None:
    assert unlike_motions([0.03, 0.04]) == []
    assert unlike_motions([]) == []


@pytest.mark.parametrize(
    ("configuration", "why"), [({}, "a frame with all cameras that sank"), ({"import": {}}, "cut")]
)
def test_nothing_tells_how_high_all_views_look_of_a_rig_or_of_images_from_elsewhere(
    configuration: dict[str, dict[str, str]], why: str
) -> None:
    """All views that are shifted alike move all droplets alike: no line of sight leaves the others."""
    header = RunHeader(
        run_id="one",
        created_utc="2026-01-01T00:00:00Z",
        views={"view1": ViewFormat((8, 8), 12)},
        configuration=configuration,
    )
    told = unchecked_images.unknown_height(header)
    assert why in told.what
    assert "moves all droplets along y" in told.what
    assert "where all images of the shots, not of the target, are upside down: y, and velocities along it" in told.what
