"""How much of its background's light an exposure has, by view: with less of it, all of its volume is fainter.

Droplets are measured against the light around them, and do not care. Values of volumes do: MLOS multiplies the views.
"""

import json
import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from daq.files.run_directory import RunReader, Shot
from processing.light import light_share
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import ReconstructionSettings
from processing.reconstruction.volume_file import VolumeFileError, open_volume
from processing.runs.exposure_faults import grey_values
from processing.runs.results_file import FrameName
from processing.runs.shots.meetings import ExposureKey
from processing.runs.workbench import References

LIGHT_SHARE = "light_share"
"""Of a stored volume: by view, the share of its background's light; a JSON table."""
MOST_FAINTER = 0.1
"""Four views that flicker by 2 % make values of MLOS that differ by 8 %."""
Shares = Mapping[str, float]


def light_shares(run: RunReader, shot: Shot, frame: FrameName, references: References) -> Shares:
    """By view, as ``light_share`` has it; nothing of bright particles, and of views without a background."""
    shares = {}
    for view in shot.views if run.header.polarity == "shadow" else ():
        dark, background = (None if one is None else one["ab".index(frame)] for one in references[view])
        if background is not None:
            grey, bits = grey_values(shot, view, frame), run.header.views[view].bits
            shares[view] = round(light_share(grey, background, bits=bits, dark=dark), 3)
    return {view: share for view, share in shares.items() if math.isfinite(share)}


def stored_shares(volume_files: Iterable[Path]) -> dict[ExposureKey, Shares]:
    """Those of stored volumes; of older ones, and what nobody can read, nothing."""
    found: dict[ExposureKey, Shares] = {}
    for file in volume_files:
        with suppress(VolumeFileError, ValueError, KeyError), open_volume(file) as volume:
            told = volume.provenance
            frame: FrameName = "b" if told["frame"] == "b" else "a"
            found[int(told["shot"]), frame] = json.loads(str(told[LIGHT_SHARE]))
    return found


def stored_settings(volume_file: Path) -> ReconstructionSettings:
    """How a volume was made; by default, where it does not say."""
    with suppress(VolumeFileError, ValueError, KeyError), open_volume(volume_file) as volume:
        return ReconstructionSettings.model_validate_json(str(volume.provenance["settings"]))
    return ReconstructionSettings()


def fainter(shares: Shares, settings: ReconstructionSettings) -> float:
    """By which share values of a volume are fainter than in full light; brighter light is another fault.

    Without a sliding minimum, light that is missing is part of all intensities: what is black is as intense as ever.
    """
    left = [min(share, 1.0) for share in shares.values() if settings.minimum_window_px]
    if settings.method is ReconstructionMethod.MINLOS:
        return 1 - min(left, default=1.0)
    return 1 - math.prod(left) ** (1 if settings.method is ReconstructionMethod.MLOS else 1 / max(len(left), 1))


def light_line(shares: Mapping[ExposureKey, Shares], settings: ReconstructionSettings) -> str:
    """What is told once of volumes that are compared, or averaged; empty where all had light enough."""
    lost = {exposure: fainter(one, settings) for exposure, one in shares.items()}
    faint = [exposure for exposure in lost if lost[exposure] > MOST_FAINTER]
    if not faint:
        return ""
    shot, frame = faintest = max(faint, key=lost.__getitem__)
    views = ", ".join(f"{view} {100 * share:.0f} %" for view, share in shares[faintest].items())
    how_much = f"voxels by {settings.method.value} are up to {100 * lost[faintest]:.0f} % fainter for that alone"
    return (
        f"light: {len(faint)} of {len(lost)} exposures had less than their backgrounds: {how_much} (shot {shot}, "
        f"exposure {frame.upper()}: {views}); compare no values of other light, or record the background anew"
    )
