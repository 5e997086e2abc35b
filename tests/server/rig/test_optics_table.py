"""The table of ``tomoshadow optics`` for the example rigs, against the paper."""

import json
from pathlib import Path

import pytest

from daq.errors import PlanError
from processing.synthetic.paper_rig import TABLE_1
from server.rig.config import load_config
from server.rig.optics_table import Motion, optics_table


@pytest.mark.parametrize("name", ["simulated.toml", "spray4view.toml"])
def test_both_examples_have_the_airy_disks_of_table_1(name: str) -> None:
    table = optics_table(load_config(Path("configs") / name))
    diameters_um = {view: round(values["airy_diameter_um"]) for view, values in table["views"].items()}
    assert diameters_um == {view: row.airy_diameter_um for view, row in TABLE_1.items()}


def test_the_rig_of_the_paper_permits_its_pulses_and_blurs_less_than_it_resolves() -> None:
    table = optics_table(load_config(Path("configs/simulated.toml")))
    shortest_ns, longest_ns = table["straddling_window_ns"]
    assert shortest_ns == 1900 <= 6400 <= longest_ns
    assert table["motion"]["displacement_um"] == pytest.approx(34.6 * 6.4, abs=0.1)
    for values in table["views"].values():
        assert values["image_scale_px_per_mm"] == pytest.approx(60, abs=2)
        assert table["motion"]["blur_um"] < values["resolved_diameter_um"]
    json.dumps(table)


def test_pulses_that_fit_no_exposure_are_refused() -> None:
    with pytest.raises(PlanError, match=r"view1: width_ns: 9000 ns .*cameras/simulated.toml$"):
        optics_table(load_config(Path("configs/simulated.toml")), Motion(width_ns=9000))
