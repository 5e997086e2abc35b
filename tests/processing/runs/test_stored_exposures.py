"""Stored volumes are read once; whoever asks afterwards asks no file."""

from pathlib import Path

import numpy as np

from processing.reconstruction.volume_file import write_volume
from processing.runs.exposure_faults import stored_faults
from processing.runs.results_file import volume_path
from processing.runs.shots.meetings import MEETING, Meeting, stored_meetings
from processing.runs.shots.shot_light import LIGHT_SHARE, stored_shares
from processing.runs.stored_exposures import stored_exposures
from processing.volume import VoxelGrid


def test_what_a_volume_tells_is_known_without_its_file_and_what_nobody_can_read_tells_nothing(tmp_path: Path) -> None:
    files = [volume_path(tmp_path, shot, "b") for shot in range(3)]
    tables = {MEETING: '{"droplets": 7}', LIGHT_SHARE: '{"view1": 0.8}', "dim_views": '["view1"]'}
    grid = VoxelGrid.centred((2, 2, 2), 0.1)
    for shot, told in enumerate((tables, {})):
        write_volume(files[shot], np.ones(grid.shape, np.float32), grid, {"shot": shot, "frame": "b", **told})
    files[2].write_bytes(b"torn")
    first, second = stored_exposures(files)
    for file in files:
        file.unlink()
    assert (first.key, second.key) == ((0, "b"), (1, "b"))
    assert stored_meetings((first, second)) == {(0, "b"): Meeting(droplets=7)}
    assert stored_shares((first, second)) == {(0, "b"): {"view1": 0.8}}
    assert stored_faults(first) == {"shot": 0, "dim_views": ["view1"]}
    assert stored_faults(second, copy_of=first) == {"shot": 1, "copy_of": 0}
