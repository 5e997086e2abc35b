"""``tomoshadow doctor``: what is wrong with computer and rig, and how to mend it."""

from argparse import Namespace
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome, progress


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "doctor", doctor, "what is wrong with this computer and the rig, and how to mend it")
    parser.add_argument("--config", type=Path, help="rig configuration; without it only the computer is looked at")


def doctor(options: Namespace) -> Outcome:
    """Look at everything; fails where a check does."""
    from server.doctor.checkup import Status
    from server.doctor.doctor import examine

    checks = []
    for check in examine(options.config):
        progress(str(check))
        checks.append(check)
    found = Counter(check.status for check in checks)
    result = {"passed": not found[Status.FAIL], "checks": [asdict(check) for check in checks]}
    return Outcome(result, ", ".join(f"{found[status]} {status}" for status in Status))
