"""``tomoshadow verify``: is a run whole, file by file and frame by frame."""

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from daq.counted import counted
from server.cli.options import Verbs, add_verb, run_directory
from server.cli.output import Bar, Outcome

if TYPE_CHECKING:
    from daq.files.verification import Verification


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "verify", verify, "is a run whole: CRC of every frame, missing, torn and foreign files")
    parser.add_argument(
        "runs", nargs="+", type=run_directory, metavar="RUN", help="run directory, or that of an import"
    )


def verify(options: Namespace) -> Outcome:
    """Look at every file of every run; what is no run at all is bad input, and nothing is looked at."""
    for run_dir in options.runs:
        require_run(run_dir)
    found = [(run_dir, _looked_at(run_dir)) for run_dir in options.runs]
    told = [{"run": str(run_dir), **told_of(one)} for run_dir, one in found]
    text = "\n".join(f"{run_dir}: {text_of(one)}" for run_dir, one in found)
    return Outcome({"passed": all(one.sound for _, one in found), "runs": told}, text)


def require_run(run_dir: Path) -> None:
    """Refuse what has neither a run file nor shots."""
    from daq.errors import ShotFileError

    if not any((run_dir / name).exists() for name in ("run.h5", "shots")):
        raise ShotFileError(f"{run_dir}: no run, it has neither run.h5 nor shots")


def told_of(found: "Verification") -> dict[str, Any]:
    """What was found, for programs."""
    return {"sound": found.sound, **asdict(found), "flaws": [asdict(flaw) for flaw in found.flaws]}


def text_of(found: "Verification") -> str:
    """What was found, for people."""
    sound = f"{found.sound_shots} of {counted(found.shots, 'shot')} sound"
    counts = f"{sound}, {counted(found.frames, 'frame')}, {found.outcome or 'open'}"
    return "\n  ".join([counts, *(f"{flaw.kind.replace('_', ' ')}: {flaw.text}" for flaw in found.flaws)])


def _looked_at(run_dir: Path) -> "Verification":
    from daq.files.verification import verify

    with Bar() as bar:
        return verify(run_dir, lambda done, total: bar.step(done, total))
