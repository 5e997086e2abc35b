# ruff: noqa: T201
"""Damages manifests, tables and images, and imports and calibrates them: what is wrong is told, never a traceback.

    python -m tests.support.fuzz_import [COUNT [SEED]]

Prints every damage that ends with another error than ``BadInput``, and how many were still imported. Exit status 1 if
there is such an error, or if fewer than a fifth were imported: damages that nothing survives test nothing.
"""

import random
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from processing.calibration.calibrate import calibrate
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.errors import BadInput
from processing.runs.manifest.importing import import_manifest

VALID = Path(__file__).parents[1] / "fixtures" / "v0.1.0" / "import"
LEAST_IMPORTED = 0.2
_SHOTS = ("shot_", "background_", "dark_")
"""Files of the run, which say nothing of the calibration."""
VALUES = (
    "-1",
    "0",
    "1e400",
    "nan",
    "inf",
    '""',
    "[]",
    "{}",
    "true",
    '"view1"',
    "[1, 2]",
    "1979-05-27",
    "99999999999",
    "1,5",
)
TEXTS = ("\ufeff", "\t", ";", ",", "#", '"', "[", "\x00", "\u00e9", "nan", "-1 -1", "\r\n")


@dataclass(frozen=True)
class Ended:
    """How the import of damaged files ended: ``error`` is a traceback, empty after ``BadInput`` or nothing."""

    damage: str
    imported: bool
    calibrated: bool
    error: str = ""


def damaged_imports(count: int, seed: int, calibrations: int | None = None) -> Iterator[Ended]:
    """Import so many damaged copies, the same ones for the same seed, and calibrate the first of those that can be."""
    calibrated = 0
    for number in range(count):
        chosen = random.Random(f"{seed} {number}")
        with tempfile.TemporaryDirectory() as folder:
            copy = shutil.copytree(VALID, Path(folder, "given"))
            ended = _ended(
                damage(copy, chosen), copy, Path(folder, "out"), calibrations is None or calibrated < calibrations
            )
            calibrated += ended.calibrated
            yield ended


def damage(folder: Path, chosen: random.Random) -> str:
    """Damage one file of a folder; returns what was done."""
    file = chosen.choice([folder / "manifest.toml", *sorted(folder.glob("*.txt")), *sorted(folder.glob("*.png"))])
    how = chosen.choice(_WAYS[file.suffix])
    how(file, chosen)
    return f"{file.name}: {how.__name__.strip('_').replace('_', ' ')}"


def _ended(what: str, given: Path, out: Path, fit: bool) -> Ended:
    imported, fitted, error = False, False, ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            import_manifest(given / "manifest.toml", out)
            imported = True
            if (out / "calibration").exists() and not what.startswith(_SHOTS):
                detected = load_calibration_set(out)
                if fitted := fit:
                    calibrate(detected)
    except BadInput:
        pass
    except Exception:  # noqa: BLE001 - whatever it is, it is what is looked for
        error = traceback.format_exc()
    return Ended(what, imported, fitted, error)


def _a_line_is_lost(file: Path, chosen: random.Random) -> None:
    lines = _lines(file)
    del lines[chosen.randrange(len(lines))]
    _write(file, lines)


def _a_line_is_there_twice(file: Path, chosen: random.Random) -> None:
    lines = _lines(file)
    at = chosen.randrange(len(lines))
    _write(file, [*lines[:at], lines[at], *lines[at:]])


def _two_lines_are_exchanged(file: Path, chosen: random.Random) -> None:
    lines = _lines(file)
    one, other = chosen.randrange(len(lines)), chosen.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    _write(file, lines)


def _a_value_is_another(file: Path, chosen: random.Random) -> None:
    lines = _lines(file)
    at = chosen.choice([number for number, line in enumerate(lines) if "=" in line])
    lines[at] = f"{lines[at].partition('=')[0]}= {chosen.choice(VALUES)}"
    _write(file, lines)


def _a_number_is_another(file: Path, chosen: random.Random) -> None:
    lines = _lines(file)
    at = chosen.randrange(len(lines))
    fields = lines[at].split(" ")
    fields[chosen.randrange(len(fields))] = chosen.choice(VALUES)
    lines[at] = " ".join(fields)
    _write(file, lines)


def _something_is_inserted(file: Path, chosen: random.Random) -> None:
    text = file.read_text(encoding="utf-8")
    at = chosen.randrange(len(text) + 1)
    file.write_text(text[:at] + chosen.choice(TEXTS) + text[at:], encoding="utf-8")


def _the_end_is_lost(file: Path, chosen: random.Random) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: chosen.randrange(len(content))])


def _bytes_are_others(file: Path, chosen: random.Random) -> None:
    content = bytearray(file.read_bytes())
    for _ in range(chosen.choice((1, 3, 30))):
        content[chosen.randrange(len(content))] = chosen.randrange(256)
    file.write_bytes(content)


def _it_is_another_image(file: Path, chosen: random.Random) -> None:
    file.write_bytes(chosen.choice(sorted(file.parent.glob("*.png"))).read_bytes())


def _a_part_of_it_is_blurred(file: Path, chosen: random.Random) -> None:
    pixels = _pixels(file)
    half = slice(chosen.randrange(pixels.shape[1]), None)
    pixels[:, half] = cv2.GaussianBlur(pixels, (0, 0), chosen.choice((0.7, 2, 8)))[:, half]
    cv2.imwrite(str(file), pixels)


def _it_is_noisy(file: Path, chosen: random.Random) -> None:
    pixels = _pixels(file)
    noise = np.random.default_rng(chosen.randrange(1000)).normal(0, chosen.choice((2, 10, 60)), pixels.shape)
    cv2.imwrite(str(file), np.clip(pixels + noise, 0, 255).astype(np.uint8))


def _it_is_inverted(file: Path, _chosen: random.Random) -> None:
    cv2.imwrite(str(file), 255 - _pixels(file))


def _it_is_upside_down(file: Path, _chosen: random.Random) -> None:
    cv2.imwrite(str(file), _pixels(file)[::-1])


def _it_has_16_bit(file: Path, _chosen: random.Random) -> None:
    cv2.imwrite(str(file), _pixels(file).astype(np.uint16) << 8)


def _it_is_black(file: Path, _chosen: random.Random) -> None:
    cv2.imwrite(str(file), np.zeros_like(_pixels(file)))


def _pixels(file: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE), np.uint8)


def _it_is_missing(file: Path, _chosen: random.Random) -> None:
    file.unlink()


def _it_is_a_folder(file: Path, _chosen: random.Random) -> None:
    file.unlink()
    file.mkdir()


def _lines(file: Path) -> list[str]:
    return file.read_text(encoding="utf-8").splitlines()


def _write(file: Path, lines: list[str]) -> None:
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


_LINES = (_a_line_is_lost, _a_line_is_there_twice, _two_lines_are_exchanged, _something_is_inserted, _the_end_is_lost)
_FILES = (_bytes_are_others, _it_is_missing, _it_is_a_folder)
_IMAGES = (
    *(_a_part_of_it_is_blurred, _it_is_noisy, _it_is_inverted, _it_is_upside_down, _it_has_16_bit, _it_is_black),
    *(_the_end_is_lost, _it_is_another_image),
)
_WAYS = {
    ".toml": (*_LINES, _a_value_is_another, _bytes_are_others),
    ".txt": (*_LINES, *_FILES, _a_number_is_another),
    ".png": (*_FILES, *_IMAGES),
}


def main(arguments: list[str]) -> int:
    """Damage, import, tell; the exit status."""
    count, seed = (int(word) for word in (*arguments, *("2000", "1")[len(arguments) :]))
    ends = []
    for ended in damaged_imports(count, seed):
        ends.append(ended)
        if ended.error:
            print(f"{ended.damage}\n{ended.error}", flush=True)
    imported, failed = sum(ended.imported for ended in ends), sum(bool(ended.error) for ended in ends)
    print(f"{count} damaged imports, seed {seed}: {imported} imported, {failed} ended with a traceback")
    return int(failed > 0 or imported < LEAST_IMPORTED * count)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
