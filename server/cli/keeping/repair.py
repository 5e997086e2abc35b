"""``tomoshadow repair``: set aside what does not belong to a run, write what is lost; no shot is changed."""

from argparse import Namespace

from daq.counted import counted
from server.cli.keeping.verify import require_run, text_of, told_of
from server.cli.options import Verbs, add_verb, run_directory
from server.cli.output import Outcome, progress


def add(verbs: Verbs) -> None:
    """Add the command."""
    summary = "after a crash: set aside what is no shot, write a missing outcome or run.h5; no shot is changed"
    parser = add_verb(verbs, "repair", repair, summary)
    parser.add_argument("run", type=run_directory, metavar="RUN", help="run directory, or that of an import")


def repair(options: Namespace) -> Outcome:
    """Mend, and say what is still wrong."""
    from daq.files import repair as mending
    from daq.files.verification import verify

    require_run(options.run)
    done = []
    for step in mending.repair(options.run):
        progress(step)
        done.append(step)
    left = verify(options.run)
    result = {"passed": left.sound, "run": str(options.run), "done": done, **told_of(left)}
    return Outcome(result, f"{options.run}: {counted(len(done), 'thing')} done; {text_of(left)}")
