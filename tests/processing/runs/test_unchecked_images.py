"""What nothing tells of droplets is said where there is something to say."""

from processing.runs.unchecked_images import unlike_motions


def test_droplets_without_a_partner_may_fly_otherwise() -> None:
    (told,) = unlike_motions([0.4, 0.2])
    assert "how the 30 % of the droplets fly that should be in both exposures and have no partner" in told.what


def test_of_nearly_all_that_have_one_and_of_none_that_were_asked_nothing_is_said() -> None:
    assert unlike_motions([0.03, 0.04]) == []
    assert unlike_motions([]) == []
