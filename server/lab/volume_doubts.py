"""What speaks against a volume, as its preview keeps it: images that may be wrong, a calibration of other images."""

import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from processing.calibration.verdict import BELONGING, Verdict
from processing.runs.exposure_faults import fault_lines, stored_faults
from processing.runs.stored_exposures import StoredExposure
from server.pictures.previews import load_provenance, preview_path

TRUSTED = (Verdict.GOOD, Verdict.USABLE)
NOT_ASKED = "not checked yet whether run and calibration belong together"


def volume_doubts(volume: Path) -> tuple[str, ...]:
    """A sentence each; of volumes of older programs, and of previews that nobody can read, nothing."""
    with suppress(OSError, ValueError, KeyError, zipfile.BadZipFile):
        stored = StoredExposure(volume, load_provenance(preview_path(volume)), 0.0)
        return tuple(filter(None, _told(stored)))
    return ()


def _told(stored: StoredExposure) -> Iterator[str]:
    yield from fault_lines(stored_faults(stored))
    if BELONGING in stored.provenance:
        yield belonging_told(stored.table(BELONGING))


def belonging_told(asked: Mapping[str, Any] | None) -> str:
    """What droplets say against run and calibration, or that they say nothing; nothing where they agree."""
    if asked is None or asked["verdict"] in TRUSTED:
        return ""
    shots = ", ".join(str(check["shot"]) for check in asked["shots"])
    if not asked["shots"]:
        return NOT_ASKED
    if asked["verdict"] is None:
        return f"not checked whether run and calibration belong together (asked: shot {shots})"
    return f"droplets speak against run and calibration: {asked['verdict']} (shot {asked['shots'][0]['shot']})"
