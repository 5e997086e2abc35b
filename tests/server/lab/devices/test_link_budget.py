from dataclasses import replace

import pytest

from daq.files.run_directory import ViewFormat
from daq.network import Network
from server.lab.devices.link_budget import LinkBudget, link_budget
from tests.support.memory_rig import TIMING, MemoryRig

FORMATS = {"view1": ViewFormat((1200, 1600), 8), "view2": ViewFormat((1200, 1600), 12)}
FAST = replace(TIMING, exposure_b_ns=1_000_000, readout_ns=0)


def budget(network: Network, timing_ms: float = 1.0) -> LinkBudget:
    timing = replace(TIMING, exposure_b_ns=round(1e6 * timing_ms), readout_ns=0)
    return link_budget(network, MemoryRig(FORMATS, timing=timing).cameras)


def test_a_view_of_more_bits_takes_more_of_its_wire() -> None:
    links = budget(Network()).cameras
    assert (links["view1"].shot_bytes, links["view2"].shot_bytes) == (2 * 1920_000, 4 * 1920_000)
    assert links["view2"].wire_s == pytest.approx(2 * links["view1"].wire_s, rel=1e-3)
    assert links["view1"].wire_s == pytest.approx(8 * 3.84e6 / 1e9 * 1.05, rel=0.02)


@pytest.mark.parametrize("shared_gbit_s", [None, 0.5, 1.0, 10.0])
def test_the_rate_is_the_one_up_to_which_a_run_is_permitted(shared_gbit_s: float | None) -> None:
    network = Network(shared_gbit_s=shared_gbit_s)
    found = budget(network)
    sizes = {view: link.shot_bytes for view, link in found.cameras.items()}
    assert found.most_hz == pytest.approx(1 / max(network.shot_s(sizes), FAST.cycle_ns / 1e9))


@pytest.mark.parametrize(
    ("network", "timing_ms", "words"),
    [
        (Network(), 1.0, "the wire of view2"),
        (Network(shared_gbit_s=1.0), 1.0, "the wire that all cameras share"),
        (Network(camera_gbit_s=10), 200.0, "the cameras"),
    ],
)
def test_it_says_what_permits_no_more(network: Network, timing_ms: float, words: str) -> None:
    assert budget(network, timing_ms).limited_by.startswith(words)
