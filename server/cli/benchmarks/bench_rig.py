"""The simulated rig of a clone, with its data elsewhere: what servers and recorders are measured with."""

import shutil
from pathlib import Path

from processing.errors import BadInput

CONFIGS = Path("configs")
RIG = "simulated.toml"


class NoRig(BadInput):
    """There is nothing to measure with; the text says why."""


def rig_in(folder: Path, bits: int = 8, *, still: bool = False) -> Path:
    """Rig file in a folder; its data are below, its cameras have 8 or 16 bit, every shot may show the same."""
    if not (CONFIGS / RIG).is_file():
        raise NoRig(f"{CONFIGS / RIG}: no such file; measure servers and cameras in a clone of tomoshadow")
    shutil.copytree(CONFIGS, folder / "configs")
    for file, before, after in (
        (folder / "configs" / RIG, 'data_dir = "runs"', f'data_dir = "{folder / "runs"}"'),
        (folder / "configs" / RIG, "seed = 1", f"seed = 1\nstill = {str(still).lower()}"),
        (folder / "configs" / "cameras" / RIG, 'pixel_format = "Mono8"', f'pixel_format = "Mono{bits}"'),
    ):
        text = file.read_text()
        if before not in text:
            raise NoRig(f"{file}: has no line {before}")
        file.write_text(text.replace(before, after))
    return folder / "configs" / RIG
