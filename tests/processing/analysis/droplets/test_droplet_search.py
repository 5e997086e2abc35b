"""Where droplets are looked for: what cannot be searched is refused before anything is read."""

import pytest

from processing.analysis.droplets.droplet_search import plan_droplets
from processing.reconstruction.errors import ReconstructionError
from processing.studies.simulated_droplets import study_cameras, study_grid


def test_images_that_are_too_small_are_refused_with_their_view() -> None:
    with pytest.raises(ReconstructionError, match=r"view1: images of 200 x 60 px; .* 64 px"):
        plan_droplets(study_cameras((200, 60)), study_grid((30, 12, 60)), ["view1", "view2", "view3", "view4"])
