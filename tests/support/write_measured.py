"""Write the tables of docs/measured.md anew from what the commands say: ``python -m tests.support.write_measured``.

Without arguments all of them; else those that are named. ``tomoshadow bench --table docs/measured.md`` writes its own.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from processing.synthetic.paper_rig import TABLE_1
from server.reports.digits import digits_of_interval, three_digits
from server.reports.spray_tables import LABELS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "measured.md"
STUDIES = (
    *("density", "ghosts", "average", "residuals", "calibration", "sensitivity"),
    *("droplets", "sizes", "reality", "persistence", "velocity", "tracks", "breakup", "statistics"),
)


@dataclass(frozen=True)
class Part:
    """A table of the page: the command that knows its figures, and how they become a table."""

    command: tuple[str, ...]
    table: Callable[[Mapping[str, Any]], str]


def write_measured(names: Iterable[str]) -> None:
    """Run the commands of these parts, one after the other, and put their tables into the page."""
    for name in names:
        table = PARTS[name].table(_said(PARTS[name].command))
        PAGE.write_text(replaced(PAGE.read_text(), name, table))


def replaced(page: str, name: str, table: str) -> str:
    """The page with another table between the marks of that name."""
    before, begin, rest = page.partition(f"<!-- {name} -->\n")
    _old, end, after = rest.partition(f"<!-- /{name} -->\n")
    if not begin or not end:
        raise ValueError(f"{PAGE}: has no marks for {name}")
    return f"{before}{begin}\n{table}\n{end}{after}"


def _said(command: Sequence[str]) -> dict[str, Any]:
    """What a command prints with ``--json``."""
    with tempfile.TemporaryDirectory() as out:
        arguments = [argument.format(out=out) for argument in command]
        finished = subprocess.run(
            [sys.executable, "-m", "server.cli", *arguments, "--json"], cwd=ROOT, stdout=subprocess.PIPE, check=True
        )
    said: dict[str, Any] = json.loads(finished.stdout.splitlines()[-1])
    return said


def _markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _statements(said: Mapping[str, Any]) -> str:
    rows = [(one["topic"], one["paper"], one["ours"]) for one in said["statements"]]
    return _markdown(("what", "the paper", "here"), rows)


def _qualities(said: Mapping[str, Any]) -> str:
    """Quality factors by method and density, then the statements."""
    densities = sorted({row["density_per_mm3"] for row in said["rows"]})
    methods = dict.fromkeys(row["method"] for row in said["rows"])
    found = {(row["method"], row["density_per_mm3"]): f"{row['quality_factor']:.2f}" for row in said["rows"]}
    head = ("quality factor, droplets/mm³:", *(f"{density:.1f}" for density in densities))
    rows = [(method, *(found[method, density] for density in densities)) for method in methods]
    return f"{_markdown(head, rows)}\n{_statements(said)}"


def _demonstration(said: Mapping[str, Any]) -> str:
    errors = ("mean_error_px", "holdout_error_px", "true_error_px")
    head = ("view", "mean error [px]", "on planes not seen [px]", "true error, largest in the volume [px]", "verdict")
    rows = [(name, *(f"{view[key]:.4f}" for key in errors), view["verdict"]) for name, view in said["views"].items()]
    quality = f"Quality factor of MLOS against the true spray: {said['quality_factor']:.2f}"
    shots = f"{said['shots_valid']} of {said['shots_planned']} shots valid.\n"
    tables = (_measured(said["droplets"]), _flow(said), _spray(said["spray"]))
    return "\n".join([_markdown(head, rows), f"{quality}; {shots}", *tables])


def _measured(said: Mapping[str, Any]) -> str:
    """A table of the droplets of the demonstration."""
    d32 = "{value:.1f} ({low:.1f} to {high:.1f})".format(**said["d32_um"])
    shares = (f"{100 * said[key]:.1f} %" for key in ("found_share", "true_ghost_share", "hidden_share"))
    head = (
        f"found, from {said['counted_from_um']:g} µm on",
        "ghosts",
        "volume hidden",
        "D32 [µm]",
        "true D32 [µm]",
        "verdict",
    )
    return _markdown(head, [(*shares, d32, f"{said['true_d32_um']:.1f}", said["verdict"])])


def _flow(said: Mapping[str, Any]) -> str:
    """A table of the break-up and the velocities of the demonstration."""
    liquid, droplets = said["liquid"], said["droplets"]
    means = (droplets["velocity"]["mean_m_s"], droplets["true_velocity_m_s"])
    told, true = (", ".join(f"{one:.2f}" for one in mean) for mean in means)
    head = (
        f"break-up length of {liquid['shots']} shots [mm]",
        "true [mm]",
        "mean u, v, w [m/s]",
        "true [m/s]",
        "rms error of a component [m/s]",
    )
    rms = f"{droplets['velocity_rms_m_s']:.2f}"
    return _markdown(head, [(_length(liquid), f"{liquid['true_break_up_mm']:.2f}", told, true, rms)])


def _spray(said: Mapping[str, Mapping[str, Any]]) -> str:
    """A table of the spray as a whole."""
    rows = [
        (LABELS[name], _interval(one["measured"]), "" if one["true"] is None else three_digits(one["true"]))
        for name, one in said.items()
    ]
    return _markdown(("of the spray", "measured (95 %)", "true"), rows)


def _interval(told: Mapping[str, float] | None) -> str:
    return "not told" if told is None else "{} ({} to {})".format(*digits_of_interval(**told))


def _length(liquid: Mapping[str, Any]) -> str:
    """The break-up length, whose upper limit may lie beyond the field, or why there is none."""
    if (length := liquid["break_up_mm"]) is None:
        return f"none: {liquid['break_up_reason']}"
    high = "beyond the field" if length["high"] is None else f"{length['high']:.2f}"
    return f"{length['value']:.2f} ({length['low']:.2f} to {high})"


def _airy_disks(said: Mapping[str, Any]) -> str:
    rows = [
        (name, f"{TABLE_1[name].airy_diameter_um:g}", f"{view['airy_diameter_um']:.1f}")
        for name, view in said["views"].items()
    ]
    return _markdown(("view", "Airy disk in Table 1 [µm]", "here [µm]"), rows)


PARTS = {
    "demo": Part(("demo", "--out", "{out}/demo"), _demonstration),
    "optics": Part(("optics", "--config", "configs/spray4view.toml"), _airy_disks),
    **{
        name: Part(("study", name, "--out", "{out}"), _qualities if name == "density" else _statements)
        for name in STUDIES
    },
}
"""Tables by the name of their marks."""

if __name__ == "__main__":
    write_measured(sys.argv[1:] or PARTS)
