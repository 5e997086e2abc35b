"""What the product says of a world: its commands ``measure`` and ``statistics``, as people and programs get it."""

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import tomoshadow
from server.cli.main import main
from tests.hunt.recording import write_world
from tests.hunt.rig import Array
from tests.hunt.world import HALF_MM, Pictures, World

BOX = ",".join(f"{-half:g}:{half:g}" for half in HALF_MM)


@dataclass(frozen=True, eq=False)
class Told:
    """Droplets of one shot and exposure, as the file has them."""

    places_mm: Array
    diameters_um: Array
    deviations_um: Array
    velocities_m_s: Array


@dataclass(frozen=True, eq=False)
class Answer:
    """All that is said.

    Parameters
    ----------
    error : str
        Why nothing was measured; empty where it was.
    said : dict
        What ``measure --json`` prints.
    spray : dict
        What ``statistics --json`` prints.
    told : dict of (shot, exposure) to Told
        Droplets.
    words : str
        All that was printed for people.
    """

    error: str
    said: dict[str, Any]
    spray: dict[str, Any]
    told: dict[tuple[int, int], Told]
    words: str


def asked(folder: Path, world: World, pictures: Pictures) -> Answer:
    """Write the run, measure it, and ask for its statistics."""
    run, calibration = write_world(folder, world, pictures)
    out = folder / "droplets"
    light = ["--light", world.stated_light] if world.stated_light else []
    arguments = ["measure", run, "--calibration", calibration, "-o", out, f"--grid={BOX}", *light]
    status, said, words = _command(*arguments)
    if status == 2:
        return Answer(str(said.get("error", words)), said, {}, {}, words)
    _, spray, more = _command("statistics", out)
    files = sorted(out.glob("*_droplets.h5"))
    told = {(shot, exposure): one for shot, file in enumerate(files) for exposure, one in _read(file).items()}
    return Answer("", said, spray, told, words + more)


def _command(*arguments: object) -> tuple[int, dict[str, Any], str]:
    out, words = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(words):
        status = main([*map(str, arguments), "--json"])
    lines = out.getvalue().splitlines()
    said = json.loads(lines[-1]) if lines else {}
    if said.get("error") == "interrupted":
        raise KeyboardInterrupt
    return status, said, words.getvalue()


def _read(file: Path) -> dict[int, Told]:
    columns = tomoshadow.read_droplets(file).columns
    frames = np.asarray(columns["frame"]).astype(str)
    return {number: _of(columns, frames == frame) for number, frame in enumerate("ab") if np.any(frames == frame)}


def _of(columns: Any, chosen: Any) -> Told:
    def column(name: str) -> Array:
        values = columns[name] if name in columns else np.full(len(chosen), np.nan)
        return np.array(np.asarray(values, float)[chosen])

    return Told(
        np.column_stack([column(f"{axis}_mm") for axis in "xyz"]),
        column("diameter_um"),
        column("diameter_sd_um"),
        np.column_stack([column(f"{axis}_m_s") for axis in "uvw"]),
    )
