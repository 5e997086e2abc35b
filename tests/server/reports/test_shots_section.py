"""The chapter on the shots: what is told of every exposure is in its table and its picture."""

import json
from typing import Any

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from server.reports.shots_section import shots_section


def shot(**exposures: Any) -> StoredDroplets:
    """A hundred droplets in each exposure, one in fifty a ghost."""
    columns: dict[str, Any] = {"frame": np.repeat(list(exposures), 100), "p_real": np.full(100 * len(exposures), 0.98)}
    columns["diameter_um"] = np.full(len(columns["p_real"]), 40.0)
    return StoredDroplets(columns, {"run": "spray", "shot": 3, "exposures": json.dumps(exposures)})


def test_every_exposure_is_in_table_and_picture() -> None:
    good = {"verdict": "good", "residual_over_noise": 1.02, "reasons": [], "hidden": {"volume_share": 0.1}}
    doubtful = {"verdict": "doubtful", "residual_over_noise": 1.3, "reasons": ["too dense"]}
    section = shots_section([shot(a=good, b=doubtful), shot(a=good)])
    assert section.tables[0].rows[1] == ["spray", "3", "B", "1.30", "0.0", "doubtful", "too dense"]
    ratios, ghosts = section.pictures[0].figure.axes
    assert [(line.get_label(), np.asarray(line.get_xdata()).tolist()) for line in ratios.lines[1:]] == [
        ("good", [1, 3]),
        ("doubtful", [2]),
    ]
    told = np.array([np.asarray(line.get_ydata(), float) for line in ghosts.lines[1::2]])
    np.testing.assert_allclose(told, [[2.0]] * 3)


def test_two_points_are_no_picture() -> None:
    good = {"verdict": "good", "residual_over_noise": 1.02, "reasons": []}
    assert not shots_section([shot(a=good, b=good)]).pictures


def test_of_refused_exposures_alone_there_is_no_picture() -> None:
    refused = {"verdict": "refused", "residual_over_noise": None, "reasons": ["covered"]}
    assert not shots_section([shot(a=refused)]).pictures
