"""What is wrong with the images of an exposure, so that its volume may look fine and be none: told with the volume."""

import hashlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from daq.files.run_directory import Shot
from processing.light import DIM_LIGHT, hollowed, odd_light
from processing.preprocessing import Intensity, Polarity, is_dim
from processing.runs.results_file import FrameName
from processing.runs.seen_views import SeenView, grey_values, other_backgrounds
from processing.runs.stored_exposures import StoredExposure

Faults = Mapping[str, tuple[str, ...] | Mapping[str, str]]
COPIED_ROWS = 16
"""Every so many rows are asked whether an exposure is a copy: noise never repeats."""
FAULTS = ("blind_views", "dim_views", "odd_light")
MOST_LOST = 0.01
"""Of the sum of all intensities, in voxels that were too faint for bytes."""


def exposure_faults(seen: Mapping[str, SeenView], polarity: Polarity, images: Sequence[Intensity]) -> Faults:
    """Views that see nothing, that are dim, and whose light is odd; as ``VolumeRecord`` keeps them."""
    return {
        "blind_views": tuple(view for view, image in zip(seen, images, strict=True) if not image.any()),
        "dim_views": tuple(view for view, one in seen.items() if is_dim(one.grey, one.bits)),
        "odd_light": odd_lights(seen, polarity, images),
    }


def copied(shot: Shot, frame: FrameName, images: Sequence[Intensity], before: dict[bytes, int]) -> Mapping[str, int]:
    """Which shot has the very pixels of this one in all views, of those ``before``, which it joins.

    Nothing of images that are empty, or without any contrast.
    """
    known_by = images_print(shot, [frame]) if any(image.any() for image in images) else b""
    if not known_by:
        return {}
    first = before.setdefault(known_by, shot.index)
    return {} if first == shot.index else {"copy_of": first}


def images_print(shot: Shot, frames: Sequence[FrameName]) -> bytes:
    """A hash of some rows of all exposures of a shot; empty where all pixels are alike."""
    rows = [grey_values(shot, view, frame)[::COPIED_ROWS] for frame in frames for view in shot.views]
    if not any(np.ptp(one) for one in rows):
        return b""
    return hashlib.blake2b(b"".join(one.tobytes() for one in rows), digest_size=16).digest()


def stored_faults(exposure: StoredExposure, copy_of: StoredExposure | None = None) -> Mapping[str, Any]:
    """Shot and faults of a stored volume, and the shot of another one that has its voxels; empty if it tells none."""
    told = {name: exposure.table(name) for name in FAULTS if name in exposure.provenance}
    if exposure.lost_share > MOST_LOST:
        told["lost_share"] = exposure.lost_share
    if copy_of:
        told["copy_of"] = copy_of.shot
    return {"shot": exposure.shot, **told} if told else {}


def fault_lines(faults: Mapping[str, Any]) -> list[str]:
    """A sentence per fault of an exposure, for people: its volume looks fine."""
    lines = [
        f"{name} sees nothing; is the shot empty, or a lens covered, a light off?"
        for name in faults.get("blind_views", ())
    ]
    lines += [f"{name} {DIM_LIGHT}" for name in faults.get("dim_views", ())]
    lines += [f"{name} {what}" for name, what in faults.get("odd_light", {}).items()]
    if (lost := faults.get("lost_share", 0.0)) > MOST_LOST:
        lines.append(f"{100 * lost:.2g} % of the intensity is in voxels too faint for uint8; take float16")
    if (other := faults.get("copy_of")) is not None:
        lines.append(f"has the very images of shot {other}: one is a copy, and it counts twice")
    if faults.get("empty"):
        lines.append("the volume is empty, no voxel is above 0")
    return lines


def odd_lights(
    seen: Mapping[str, SeenView], polarity: Polarity, images: Sequence[Intensity] | None = None
) -> dict[str, str]:
    """What is odd with the light of an exposure, by view; see ``odd_light``, and with its images ``hollowed``.

    And which views lack a reference that others have: it was removed.
    """
    said = {}
    for number, (view, one) in enumerate(seen.items()):
        bits, dark, background, others = one.bits, one.dark, one.background, other_backgrounds(seen, view)
        said[view] = _lacking(one, seen.values()) or odd_light(
            one.grey, polarity, bits=bits, dark=dark, background=background, others=others
        )
        if images is not None and not said[view]:
            said[view] = hollowed(one.grey, images[number], polarity, bits=bits, dark=dark, background=background)
    return {view: what for view, what in said.items() if what}


def _lacking(one: SeenView, seen: Collection[SeenView]) -> str:
    """Which references a view lacks that others have."""
    lacks = {
        "dark image": one.dark is None and any(other.dark is not None for other in seen),
        "background": one.background is None and any(other.background is not None for other in seen),
    }
    if not any(lacks.values()):
        return ""
    names = " and no ".join(name for name, is_lacking in lacks.items() if is_lacking)
    return f"has no {names}, and other views have: was that removed? Its shadows are not as pale or dark as theirs"
