"""``tomoshadow simulate``: the far ends of a simulated rig, in a process of their own."""

import os
import threading
from argparse import Namespace
from contextlib import suppress

from server.cli.options import Verbs, add_rig, add_verb
from server.cli.output import Outcome, heed, progress

_LOOK_S = 0.5


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "simulate", simulate, "run the far ends of a simulated rig, which then outlive a server")
    add_rig(parser)


def simulate(options: Namespace) -> Outcome:
    """Run until interrupted; what dies meanwhile is named, and started again."""
    from server.rig.config import ConfigError, load_config
    from server.rig.far_end_host import host_far_ends

    config = load_config(options.config)
    if config.simulation is None:
        raise ConfigError(f"{options.config}: has no [simulation]: a real rig has its own far ends")
    progress(f"{config.name}: starting cameras, pulse generator and stage")
    with host_far_ends(config) as host, suppress(KeyboardInterrupt):
        progress(f"{config.name}: its far ends run in process {os.getpid()}; Ctrl-C ends them")
        for_ever = threading.Event()
        while not for_ever.wait(_LOOK_S):
            heed()
            if revived := host.revive():
                progress(revived)
    return Outcome({"rig": config.name})
