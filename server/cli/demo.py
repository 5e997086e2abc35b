"""``tomoshadow demo``: the whole chain on the simulated bench."""

from argparse import Namespace
from pathlib import Path

from server.cli.options import Verbs, add_verb
from server.cli.output import Outcome, progress


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "demo", demo, "run the whole chain on the simulated bench")
    parser.add_argument("--out", type=Path, default=Path("demo-out"), help="where runs, results and report.html go")
    parser.add_argument("--shots", type=int, default=8, help="double exposures to record")
    parser.add_argument("--config", type=Path, default=Path("configs/simulated.toml"), help="a simulated rig")
    parser.add_argument("--firmware", choices=("host", "emulated"), help="instead of the configuration's")


def demo(options: Namespace) -> Outcome:
    """Record, calibrate, reconstruct, and judge all that by the truth."""
    from server.demo.demo import demonstrate
    from server.demo.demo_report import write_demo_report
    from server.demo.demo_summary import readable_summary, summary

    options.out.mkdir(parents=True, exist_ok=True)
    demonstration = demonstrate(options.config, options.out, options.shots, progress, options.firmware)
    report = options.out / "report.html"
    write_demo_report(demonstration, report)
    result = summary(demonstration, report)
    return Outcome(result, readable_summary(result))
