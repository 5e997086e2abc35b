"""What may be wrong with images without showing in them: told with what is measured, and what to state."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from statistics import fmean

from daq.files.run_directory import RunHeader
from processing.analysis.two_exposures.alone_droplets import MOST_ALONE, REMEDY
from processing.analysis.velocity.track_doubts import MOST_OFF
from processing.calibration.verdict import Unchecked
from processing.preprocessing import Polarity

PROPORTION = {
    "bright": Unchecked(
        "whether grey values are in proportion to light: any gamma fits bright particles, and makes their amplitudes "
        "nearer to each other, or farther from each other, than they are",
        "gamma 1 in the settings of the cameras",
    ),
    "shadow": Unchecked(
        "whether grey values are in proportion to light: a gamma near to 1 fits shadows that are a little smaller or "
        "larger; one that is far from 1, as sRGB has, is told where ten droplets or more are dark in three views, or "
        "look veiled. Nor whether black is where the dark image says so to better than some percent of the light: "
        "stray light of 3 % makes droplets 1 % too small, a dark image that is too bright by 6 % makes them 3 % too "
        "large; and where all are hardly larger than their blur, they are 4 % too small where 8 % of the light is "
        "left, and look alike",
        "gamma 1 in the settings of the cameras, and a dark image; or --sizes: dots of known diameters, seen by the "
        "same cameras",
    ),
}
_FILTERED = (
    "Nor whether images were filtered: a median of 9 px makes such discs 8 % too small, a minimum or maximum of 3 px "
    "makes them 17 % smaller or larger"
)
_AS_IT_HAS_THEM = (
    "gamma 1 in the settings of the camera, and images as it has them; or dots of known diameters, seen by the same "
    "camera"
)
SINGLE_PROPORTION: dict[Polarity, Unchecked] = {
    "bright": Unchecked(
        "whether grey values are in proportion to light: of one view nothing tells a gamma, and one of 0.5 makes discs "
        "of 14 px 6 % too large, 14 % where they are blurred by 2 px, one of 2 as much too small. Nor whether black "
        "was cut off: where a third of the light is, they are 6 to 13 % too small; nor whether a background was taken "
        "off images that were at full scale, which makes them 5 to 10 % too large at 1.5 times full scale. "
        + _FILTERED,
        _AS_IT_HAS_THEM,
    ),
    "shadow": Unchecked(
        "whether grey values are in proportion to light: of one view nothing tells a gamma, and one of 0.5 makes discs "
        "of 14 px 5 % too small, one of 2 as much too large. Nor whether contrast was stretched, or a threshold set "
        "before images were made smaller: where a third of the light became black, such discs are 7 % too large. "
        + _FILTERED,
        _AS_IT_HAS_THEM,
    ),
}
"""In a single view."""
LAMPS = Unchecked(
    "whether all views are in the same light: one is taken for all, and views of their own lamps, of 1 and of 1.5 "
    "apertures of the lens, make diameters up to a sixth too large",
    "lamps and apertures alike for all views; or --sizes: dots of known diameters, seen by the same cameras",
)
"""Of shadows in several views."""
OPAQUE = Unchecked(
    "whether droplets are opaque alike: beside opaque ones, such as let light pass are told too small, those that take "
    "half of it by a quarter of their diameter, bubbles by a fifth",
    "nothing where all are of one liquid, free of bubbles; else measure one view (without --calibration), in which "
    "each is sized at half of its own depth",
)
"""Likewise; where none is opaque the black level tells it."""
SCALE = Unchecked(
    "whether the image is whole, and as wide as it is high for equal lengths: of one view nothing tells one that was "
    "squeezed, or half covered",
    "its size as the camera has it, and um_per_px along rows and columns by a reticle",
)
"""Of a single view, whose lines of sight meet no others."""
DEPTH_OF_FIELD = Unchecked(
    "from how much depth droplets of each size are: large ones stay sharp and dark enough to be measured farther out "
    "of focus than small ones, so that means are of what is seen in the image, and too large for the spray",
    "nothing where all droplets are within the depth of field of the smallest ones (tomoshadow optics); else several "
    "views with --calibration, which tell where each droplet is",
)
"""Of a single view, which does not know how deep droplets lie."""
ORDER = Unchecked(
    "whether A is the earlier exposure: were they exchanged, all droplets would fly the other way, and pair as well",
    "[spray] nozzle and direction in the run: statistics and report doubt those against which droplets fly",
)
"""Of double exposures in a run that does not say where its spray comes from."""
LENGTHS = Unchecked(
    "whether calibration and shots were seen by the same lenses at the same focus: a factor of all lengths moves no "
    "view, and no droplet tells it",
    "magnification and pixels, which runs of a rig have; --sizes corrects diameters alone: where all its dots are seen "
    "larger, or smaller, by one factor, places and velocities are, too",
)
"""Of runs from elsewhere."""
RETICLE = Unchecked(
    "whether the reticle of --sizes was seen as these shots are: by the same lenses, focus and light, and with grey "
    "values as much in proportion to light. A gamma of 0.85 in its images alone makes droplets 5 % too large, and "
    "leaves everything as well explained; so do dots of 2 to 5 px that let a tenth of the light pass, 3 to 5 %",
    "nothing where settings of cameras and program were the same for both; else the reticle once more",
)
"""Of shadows whose diameters are corrected by dots."""
DEPTH = Unchecked(
    "whether all images are mirrored left to right or turned by 180 degrees, or views exchanged in pairs: sights "
    "hardly diverge in this volume, and near and far would be exchanged",
    "a larger volume, in which perspective tells (tomoshadow check asks all of it); or nothing, where settings of "
    "cameras and programs are those of the target",
)
"""Of a volume that is small against its distance."""
SPARSE = Unchecked(
    "whether all images are mirrored left to right or turned by 180 degrees, or views exchanged in pairs: droplets are "
    "too few to tell it, and near and far would be exchanged",
    "more shots, or more droplets in them; or nothing, where settings of cameras and programs are those of the target",
)
"""Of shots with few droplets."""
CROPPED = Unchecked(
    "whether images of target and shots were cut alike: that rows were cut elsewhere in all views moves all droplets "
    "along y, and everything agrees. So it does where all images of the shots, not of the target, are upside down: y, "
    "and velocities along it, have the wrong sign then",
    "nothing where OffsetY, Height and ReverseY were the same for both; else images of the target that are cut and "
    "turned as the shots are; [spray] nozzle and direction tell droplets that fly against them",
)
"""Of images from elsewhere; a rig reads whole images, of target and shots alike."""
MOVED = Unchecked(
    "whether all views still look where they did at the target: a frame with all cameras that sank, or a target that "
    "stood elsewhere than was stated, moves all droplets along y, and everything agrees. So it does where all images "
    "of the shots, not of the target, are upside down: y, and velocities along it, have the wrong sign then",
    "nothing where only the differences of places count, and settings of the cameras are those of the target; else "
    "images of the target, or of the nozzle, of the same day; [spray] nozzle and direction tell droplets that fly "
    "against them",
)
"""Of runs of a rig: what moves all views alike along y moves no line of sight away from the others."""
VALUES: dict[Polarity, Unchecked] = {
    "bright": PROPORTION["bright"],
    "shadow": Unchecked(
        "whether grey values are in proportion to light, and black where the dark image says so: where shadows are "
        "not black, a gamma of 0.7 makes voxels of MLOS by four views 0.4 times what they are, one of 2.2 five times, "
        "and a dark image that is brighter than black by a twelfth of the light 1.5 times",
        "gamma 1 in the settings of the cameras, and a dark image; droplets tell some of it (tomoshadow measure)",
    ),
}
"""Of values of volumes; without a dark image, black counts as grey value 0."""


def unknown_height(header: RunHeader) -> Unchecked:
    """What nothing tells of how high all views look, and which side is up: images may be cut, cameras may sink."""
    return CROPPED if "import" in header.configuration else MOVED


def stated_scale(um_per_px: float) -> Unchecked:
    """Of images whose magnification nobody recorded."""
    return Unchecked(
        f"whether a pixel is {um_per_px:g} um wide in the spray, as was stated: all lengths are in proportion",
        "um_per_px by a reticle in the plane of the spray; runs of a rig have its magnification",
    )


def _stated_separation(separation_ns: float) -> Unchecked:
    """Of double exposures whose pulses nobody recorded."""
    return Unchecked(
        f"whether exposure B comes {separation_ns:g} ns after A, as the run states: all velocities are in proportion, "
        "and any separation pairs as well",
        "separation_ns as an oscilloscope shows it at the light; runs of a rig keep the pulses as they were fired",
    )


def stated_rate(rate_hz: float) -> Unchecked:
    """Of a series of shots."""
    return Unchecked(
        f"whether there are {rate_hz:g} shots per second, as was stated, and at even times: velocities along tracks "
        "are in proportion, and accelerations by its square; only velocities from A to B would contradict it",
        "rate_hz as the trigger has it, by a counter; double exposures with a separation tell velocities of their own",
    )


def below(polarity: Polarity, found_from: Sequence[float]) -> list[Unchecked]:
    """Of bright particles too faint to be seen; of each shot the amplitude from which on they are found, 0: unknown."""
    known = [limit for limit in found_from if limit > 0]
    if polarity != "bright" or not known:
        return []
    return [
        Unchecked(
            f"whether there are droplets fainter than {fmean(known):.2g} of full scale: from there on nearly all are "
            "found, and none below a half of it. Where they are a class of their own, which noise hides, number "
            "density lacks them",
            "nothing where droplets are alike; else more light, or less noise: fewer are missing then",
        )
    ]


def unlike_motions(shares_alone: Sequence[float]) -> list[Unchecked]:
    """Of double exposures that are good, in which so many droplets of each lack the partner that they should have."""
    if not shares_alone or (alone := sum(shares_alone) / len(shares_alone)) <= MOST_ALONE:
        return []
    return [
        Unchecked(
            f"how the {100 * alone:.0f} % of the droplets fly that should be in both exposures and have no partner: as "
            "ghosts they do not; in another motion, beyond reach or of hardly any, mean velocity and flux are not "
            "those of all",
            REMEDY,
        )
    ]


def off_tracks(share_alone: float | None) -> list[Unchecked]:
    """Of a series, in which so many of the droplets that would stay in the grid are on no track; None: nobody asked."""
    if not share_alone or share_alone <= MOST_OFF:
        return []
    return [
        Unchecked(
            f"how the {100 * share_alone:.1f} % of the droplets fly that would stay in the grid for five shots and are "
            "on no track: in series of one motion there are hardly any. Where a part of the spray flies otherwise, "
            "most of it leaves the grid earlier, and mean velocities of tracks are not those of all",
            "a higher rate, so that all move by less than their neighbours are away; or measure each stream alone",
        )
    ]


def even_rows(spacing_mm: float | None) -> list[Unchecked]:
    """Of droplets that move, and stand so far apart in rows; None: in none."""
    if spacing_mm is None:
        return []
    return [
        Unchecked(
            f"whether droplets fly {spacing_mm:.2g} mm more or less: so far apart they stand in even rows, and were "
            "all of them one spacing farther on, everything would look the same",
            "nothing where they fly by less than half of that in between; else a shorter time, which must tell the "
            "same velocities",
        )
    ]


def unchecked_images(
    polarity: Polarity,
    *,
    sizes_known: bool = False,
    single: bool = False,
    um_per_px: float | None = None,
    undirected: bool = False,
    stated_ns: Iterable[float] = (),
    unscaled: bool = False,
    shallow: bool = False,
    sparse: bool = False,
) -> Iterator[Unchecked]:
    """What nothing tells of the images that droplets were measured in.

    Parameters
    ----------
    polarity : {"shadow", "bright"}
        Of the images.
    sizes_known : bool
        Diameters were compared with those of dots.
    single : bool
        There is one view.
    um_per_px : float, optional
        Width of a pixel of it, where that was stated and no magnification tells it.
    undirected : bool
        They are double exposures, and nobody said where the liquid comes from.
    stated_ns : iterable of float
        Separations of double exposures that were stated, and no pulse tells them.
    unscaled : bool
        Nobody recorded their magnification.
    shallow : bool
        Perspective is too weak to tell near from far.
    sparse : bool
        Droplets are too few for that.
    """
    if polarity == "bright" or not sizes_known:
        yield (SINGLE_PROPORTION if single else PROPORTION)[polarity]
    if polarity == "shadow" and not single:
        yield from (RETICLE, OPAQUE) if sizes_known else (LAMPS, OPAQUE)
    if single:
        yield SCALE
        yield DEPTH_OF_FIELD
    if um_per_px is not None:
        yield stated_scale(um_per_px)
    if undirected:
        yield ORDER
    yield from map(_stated_separation, stated_ns)
    if unscaled:
        yield LENGTHS
    if shallow:
        yield DEPTH
    elif sparse:
        yield SPARSE


def told_unchecked(unchecked: Iterable[Unchecked], tell: Callable[[str], None]) -> list[dict[str, str]]:
    """Tell people each of them in a line; what programs get."""
    found = list(unchecked)
    for one in found:
        tell(one.text)
    return [asdict(one) for one in found]
