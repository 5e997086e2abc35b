"""``tomoshadow doctor``: what is wrong with computer and rig, and how to mend it."""

from argparse import Namespace
from dataclasses import asdict
from typing import Any

from server.cli.commands import progress
from server.doctor.checkup import Status
from server.doctor.doctor import examine


def doctor(options: Namespace) -> dict[str, Any]:
    """``tomoshadow doctor``; fails where a check does."""
    checks = []
    for check in examine(options.config):
        progress(str(check))
        checks.append(check)
    return {
        "passed": all(check.status is not Status.FAIL for check in checks),
        "checks": [asdict(check) for check in checks],
    }
