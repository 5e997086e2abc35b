"""``tomoshadow separation``: how long after A to take B, by the velocities of a few shots."""

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from daq.counted import counted
from server.cli.options import Verbs, add_verb, positive
from server.cli.output import Outcome

if TYPE_CHECKING:
    from processing.analysis.estimates import Estimate
    from processing.analysis.velocity.separation_proposal import SeparationProposal


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "separation", separation, "propose the time from A to B by the velocities of a few shots")
    parser.add_argument("results", type=Path, help="directory of what measure wrote of one run; three shots will do")
    parser.add_argument("--config", type=Path, help="rig configuration: what its cameras accept")
    parser.add_argument(
        "--voxels", type=positive, metavar="N", help="the median droplet should move by; default 5, a voxel is a pixel"
    )


def separation(options: Namespace) -> Outcome:
    """Read, propose."""
    from processing.analysis.droplets.droplet_file import DropletFileError
    from processing.analysis.velocity.separation_proposal import MOVED_VOXEL, propose_separation
    from processing.runs.droplets_in_place import read_in_place
    from processing.runs.sprays.measured_spray import measured_in
    from server.rig.config import load_config
    from server.rig.optics_table import optics_table

    files = sorted(measured_in(options.results).glob("shot_*_droplets.h5"))
    if not files:
        raise DropletFileError(f"{options.results}: has no droplets of shots; measure them first (tomoshadow measure)")
    window_ns = None
    if options.config:
        shortest_ns, longest_ns = optics_table(load_config(options.config))["straddling_window_ns"]
        window_ns = (shortest_ns, longest_ns)
    found = propose_separation([read_in_place(file) for file in files], window_ns, options.voxels or MOVED_VOXEL)
    result = {**found.model_dump(mode="json"), "window_ns": window_ns, "passed": found.separation_ns is not None}
    return Outcome(result, _summary(found))


def _summary(found: "SeparationProposal") -> str:
    if found.separation_ns is None:
        return f"no separation is proposed: {found.reason}"
    by = f"by {counted(found.pairs, 'pair')} of {counted(found.shots, 'shot')}"
    wanted = "" if found.wanted_ns is None else f" ({_before(found.wanted_ns)})"
    moves = f"the median droplet moves by {found.will_move_voxel:.1f} voxels, 95 % by less than {_fast(found)}"
    return "\n".join([f"{found.separation_ns} ns{wanted}, {by}: {moves}", *filter(None, [found.reason]), *found.doubts])


def _before(wanted_ns: "Estimate") -> str:
    return (
        f"before rounding and limits {wanted_ns.value:.0f}, over shots {wanted_ns.low:.0f} to {wanted_ns.high:.0f} ns"
    )


def _fast(found: "SeparationProposal") -> str:
    return f"{found.fast_will_move_voxel:.1f}"
