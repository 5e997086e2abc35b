"""How much of its background's light an exposure has, by view: with less of it, all of its volume is fainter.

With more of it shadows that are not black are fainter: what is brighter than the background counts as nothing there.
Droplets are measured against the light around them, and do not care. Values of volumes do: MLOS multiplies the views.
"""

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress

from processing.count import counted
from processing.light import light_share
from processing.preprocessing import Polarity
from processing.reconstruction.choices import ReconstructionMethod
from processing.reconstruction.settings import ReconstructionSettings
from processing.runs.results_file import ExposureKey
from processing.runs.seen_views import SeenView
from processing.runs.stored_exposures import StoredExposure

LIGHT_SHARE = "light_share"
"""Of a stored volume: by view, the share of its background's light; a JSON table."""
MOST_FAINTER = 0.1
"""Four views that flicker by 2 % make values of MLOS that differ by 8 %."""
Shares = Mapping[str, float]


def light_shares(seen: Mapping[str, SeenView], polarity: Polarity) -> Shares:
    """By view, as ``light_share`` has it; nothing of bright particles, and of views without a background."""
    shares = {
        view: round(light_share(one.grey, one.background, bits=one.bits, dark=one.dark), 3)
        for view, one in seen.items()
        if polarity == "shadow" and one.background is not None
    }
    return {view: share for view, share in shares.items() if math.isfinite(share)}


def stored_shares(exposures: Iterable[StoredExposure]) -> dict[ExposureKey, Shares]:
    """Those of stored volumes; of older ones, and what nobody can read, nothing."""
    found: dict[ExposureKey, Shares] = {}
    for one in exposures:
        with suppress(ValueError, KeyError):
            found[one.key] = one.table(LIGHT_SHARE)
    return found


def stored_settings(exposure: StoredExposure) -> ReconstructionSettings:
    """How a volume was made; by default, where it does not say."""
    with suppress(ValueError, KeyError):
        return ReconstructionSettings.model_validate_json(str(exposure.provenance["settings"]))
    return ReconstructionSettings()


def fainter(shares: Shares, settings: ReconstructionSettings) -> float:
    """By which share values of a volume are fainter than in full light: in more light, those of half-dark shadows.

    Without a sliding minimum, light that is missing is part of all intensities: what is black is as intense as ever.
    """
    left = [_left(share) if settings.minimum_window_px or share > 1 else 1.0 for share in shares.values()]
    if settings.method is ReconstructionMethod.MINLOS:
        return 1 - min(left, default=1.0)
    return 1 - math.prod(left) ** (1 if settings.method is ReconstructionMethod.MLOS else 1 / max(len(left), 1))


def _left(share: float) -> float:
    """Of the intensity: light that is missing takes its share, light in excess as much of a shadow of a half."""
    return share if share <= 1 else max(2 - share, 0.0)


def light_line(shares: Mapping[ExposureKey, Shares], settings: ReconstructionSettings) -> str:
    """What is told once of volumes that are compared, or averaged; empty where all had light enough."""
    lost = {exposure: fainter(one, settings) for exposure, one in shares.items()}
    faint = [exposure for exposure in lost if lost[exposure] > MOST_FAINTER]
    if not faint:
        return ""
    shot, frame = faintest = max(faint, key=lost.__getitem__)
    views = ", ".join(f"{view} {100 * share:.0f} %" for view, share in shares[faintest].items())
    is_more = max(shares[faintest].values()) - 1 > 1 - min(shares[faintest].values())
    whose = "of half-dark shadows " if is_more else ""
    how_much = f"voxels {whose}by {settings.method.value} are up to {100 * lost[faintest]:.0f} % fainter for that alone"
    return (
        f"light: {len(faint)} of {counted(len(lost), 'exposure')} had less or more than their backgrounds: {how_much} "
        f"(shot {shot}, exposure {frame.upper()}: {views}); compare no values of other light, or record the "
        "background anew"
    )
