"""What is shown of a run under way until it ends, or until nobody wants to see more."""

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from server.cli.clients.server_option import named
from server.cli.output import Bar, Outcome, progress
from tomoshadow.client.values import read

if TYPE_CHECKING:
    from tomoshadow.client import Event, RigClient, Run

LONGEST_S = 24 * 3600.0
"""A run that lasts longer is watched anew."""


def watched(client: "RigClient", run_id: str, options: Namespace) -> Outcome:
    """Show a run until its end; Ctrl-C ends the watching, and not the run."""
    progress(f"run {run_id}; Ctrl-C ends the watching, and not the run")
    try:
        planned = client.run(run_id).shots_planned or 0
        with Bar() as bar:
            for event in client.follow(run_id, LONGEST_S):
                _show(bar, event, planned, client.url)
        return _told(client.run(run_id))
    except KeyboardInterrupt:
        server = named(options)
        text = (
            f"run {run_id} goes on. See it again: tomoshadow watch {run_id}{server}. "
            f"End it now: tomoshadow abort{server}; after its shot: tomoshadow stop{server}"
        )
        return Outcome({"passed": False, "run_id": run_id, "outcome": "active"}, text)


def _show(bar: Bar, event: "Event", planned: int, url: str) -> None:
    if event.name == "shot_recorded":
        number, valid = read(_shot, event.data, url)
        bar.step(number, planned, f"shot {number} of {planned}{'' if valid else ': INVALID'}")
    elif text := event.data.get("message") or event.data.get("text"):
        progress(text)


def _shot(told: Mapping[str, Any]) -> tuple[int, bool]:
    """Number of a shot, from 1, and whether it is valid."""
    return told["index"] + 1, told["valid"]


def _told(run: "Run") -> Outcome:
    planned = run.shots_recorded if run.shots_planned is None else run.shots_planned
    counts = f"{run.shots_recorded} of {counted(planned, 'shot')} recorded, {run.shots_valid} valid"
    text = f"run {run.run_id}: {run.outcome}, {counts}{f'; {run.cause}' if run.cause else ''}"
    return Outcome({"passed": run.outcome == "completed", **asdict(run)}, text)
