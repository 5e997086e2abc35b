"""What the droplets of some shots say of a spray, as their files have them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from processing.analysis.droplets.droplet_file import DropletFileError, StoredDroplets
from processing.analysis.droplets.ghost_share import BESIDE_LIQUID, MANY_OBJECTS, told_share
from processing.analysis.droplets.size_statistics import SizeStatistics, mean_diameters, shots_density
from processing.analysis.droplets.sizes_in_light import in_its_light
from processing.analysis.estimates import Estimate
from processing.analysis.stored_json import stored_json
from processing.reconstruction.settings import GridSettings
from processing.volume import VoxelGrid

DIAMETER, GOOD, REFUSED = "diameter_um", "good", "refused"
NO_DIAMETERS = "bright particles have no diameter: only shadows tell how large a droplet is"
IN_PIXELS, NO_SCALE = "diameter_px", "diameters are in pixels: measure with --um-per-px"
P_REAL, NO_P_REAL = (
    "p_real",
    "a single view, and files from before it was told, do not say how probably droplets are real",
)
NOTHING_COUNTED = "no exposure could be measured"
_SAME_DROPLETS = ("grid", "margin_voxel", "twins", "seed", "nozzle")
"""Settings that say where droplets are looked for, how ghosts are counted, and where the nozzle is."""
ALL_HIDDEN = "liquid hides the whole volume, so that no droplet could be seen: measure farther from the nozzle"
NO_VOLUME = "a file does not say in which volume its droplets were measured"


class DropletStatistics(SizeStatistics):
    """Droplets of all exposures that are not refused."""

    exposures: Annotated[int, Field(description="that were measured and not refused")]
    number_density_per_mm3: Annotated[
        Estimate | None,
        Field(description="per volume that could be measured; its interval over shots, of one by counting"),
    ] = None
    number_density_reason: Annotated[str | None, Field(description="why it is null")] = None
    hidden_share: Annotated[
        float, Field(description="of the volume: behind, before or in liquid that is no droplet, not measured")
    ] = 0.0
    ghost_share: Annotated[
        Estimate | None, Field(description="of the droplets: mean of 1 - p_real, and where the true share lies")
    ] = None
    ghost_reason: Annotated[str | None, Field(description="why it is null")] = None


def droplet_statistics(shots: Iterable[StoredDroplets]) -> DropletStatistics:
    """Number, density, sizes and share of ghosts.

    Parameters
    ----------
    shots : iterable of StoredDroplets
        A shot each, as ``read_droplets`` gives it; of one run or several.

    Raises
    ------
    DropletFileError
        A file does not say what became of its exposures, or two are of the same shot, or of two recipes.
    """
    shots = tuple(shots)
    require_poolable(shots)
    told = [told_exposures(shot) for shot in shots]
    counted = [(shot, exposures) for shot, exposures in zip(shots, told, strict=True) if exposures]
    hidden = [hidden_share(exposure) for _, exposures in counted for exposure in exposures]
    per_shot = len(hidden) / max(len(counted), 1)
    sizes = _sizes([shot for shot, _ in counted], per_shot)
    density, reason = _density(counted, per_shot)
    ghosts = _ghost_share([shot for shot, _ in counted], per_shot)
    return DropletStatistics(
        **dict(sizes),
        exposures=len(hidden),
        number_density_per_mm3=density,
        number_density_reason=reason,
        hidden_share=float(np.mean(hidden)) if hidden else 0.0,
        ghost_share=None if isinstance(ghosts, str) else ghosts,
        ghost_reason=ghosts if isinstance(ghosts, str) else None,
    )


def require_poolable(shots: Sequence[StoredDroplets]) -> None:
    """Refuse shots whose droplets have no common mean: one that is there twice, or two recipes.

    Raises
    ------
    DropletFileError
        The text names both, and what differs.
    """
    _require_once(shots)
    _require_alike(shots)


def _require_once(shots: Sequence[StoredDroplets]) -> None:
    """A shot that is there twice would count twice, measured by two recipes or two calibrations too."""
    places = Counter(place for shot in shots if (place := _place(shot)))
    for place, times in places.items():
        if times > 1:
            raise DropletFileError(f"{place}: its droplets are there {times} times, and would count as often")


def _require_alike(shots: Sequence[StoredDroplets]) -> None:
    """Numbers of two methods, or of settings that change what a droplet is, have no common mean."""
    made_by = [(shot, _made_by(shot)) for shot in shots]
    for shot, its in made_by[1:]:
        first, others = made_by[0]
        for name in {**its, **others}:
            if its.get(name) != others.get(name):
                raise DropletFileError(
                    f"{shot.name}: measured with {name} {its.get(name)}, {first.name} with {others.get(name)}: "
                    "numbers of two recipes are not comparable; take those of one"
                )


def _made_by(shot: StoredDroplets) -> dict[str, object]:
    """Version, calibration and settings of a measurement, less those that leave a droplet what it is."""
    settings = stored_json(shot.provenance, "settings")
    version, calibration = shot.provenance.get("method_version", 1), shot.provenance.get("calibration")
    made_by = {"method_version": version, "calibration": calibration}
    return {**made_by, **{name: one for name, one in settings.items() if name not in _SAME_DROPLETS}}


def _place(shot: StoredDroplets) -> str:
    """Of what a file is; empty where it does not say."""
    if not {"shot", "image"} & shot.provenance.keys():
        return ""
    names = ("run", "view", "images", "shot", "image")
    return ", ".join(f"{name} {shot.provenance[name]}" for name in names if name in shot.provenance)


def told_exposures(shot: StoredDroplets) -> list[Mapping[str, Any]]:
    """What was told of the exposures that are not refused."""
    if "exposures" not in shot.provenance:
        raise DropletFileError(f"{shot.name}: its file does not say what became of its exposures")
    exposures = shot.exposures.values()
    return [exposure for exposure in exposures if exposure["verdict"] != REFUSED]


def hidden_share(exposure: Mapping[str, Any]) -> float:
    """Share of the volume that could not be measured; older files do not know of any."""
    return float(exposure.get("hidden", {}).get("volume_share", 0.0))


def _sizes(shots: Sequence[StoredDroplets], per_shot: float) -> SizeStatistics:
    n = sum(len(shot.columns["frame"]) for shot in shots)
    if not shots:
        return SizeStatistics(n=0, shots=0, reason=NOTHING_COUNTED)
    if any(IN_PIXELS in shot.columns for shot in shots):
        return SizeStatistics(n=n, shots=len(shots), reason=NO_SCALE)
    if any(DIAMETER not in shot.columns for shot in shots):
        return SizeStatistics(n=n, shots=len(shots), reason=NO_DIAMETERS)
    diameters_um = [np.asarray(shot.columns[DIAMETER], np.float64) for shot in shots]
    for shot, its_um in zip(shots, diameters_um, strict=True):
        if not (np.isfinite(its_um) & (its_um > 0)).all():
            raise DropletFileError(f"{shot.name}: was changed: a diameter is not finite, or not above 0")
    return in_its_light(mean_diameters(diameters_um, per_shot), _light_sd_um(shots))


def _light_sd_um(shots: Sequence[StoredDroplets]) -> float:
    """What all diameters share because the light is not known better: no mean takes it out."""
    views = (list(one.get("views", {}).values()) for shot in shots for one in told_exposures(shot))
    return float(np.mean([max((view.get("light_sd_um", 0.0) for view in seen), default=0.0) for seen in views]))


def _density(
    counted: Sequence[tuple[StoredDroplets, Sequence[Mapping[str, Any]]]], per_shot: float
) -> tuple[Estimate | None, str | None]:
    if not counted:
        return None, NOTHING_COUNTED
    volumes_mm3 = [measured_mm3(shot, exposures) for shot, exposures in counted]
    if None in volumes_mm3:
        return None, NO_VOLUME
    if not any(volumes_mm3):
        return None, ALL_HIDDEN
    counts = [len(shot.columns["frame"]) for shot, _ in counted]
    return shots_density(counts, np.array(volumes_mm3, np.float64), per_shot), None


def measured_mm3(shot: StoredDroplets, exposures: Sequence[Mapping[str, Any]]) -> float | None:
    """Volume that could be measured, of all these exposures together; None where the file does not say."""
    grid = measured_grid(shot)
    return None if grid is None else grid.volume_mm3 * sum(1 - hidden_share(exposure) for exposure in exposures)


def measured_grid(shot: StoredDroplets) -> VoxelGrid | None:
    """Where droplets are told; files that do not state it have it in their settings, if the user named a grid."""
    grid = stored_json(shot.provenance, "grid") or stored_json(shot.provenance, "settings").get("grid")
    return GridSettings.model_validate(grid).to_grid() if grid else None


def _ghost_share(shots: Sequence[StoredDroplets], per_shot: float) -> Estimate | str:
    if not shots:
        return NOTHING_COUNTED
    if any(P_REAL not in shot.columns for shot in shots):
        return NO_P_REAL
    p_real = np.concatenate([np.asarray(shot.columns[P_REAL], np.float64) for shot in shots])
    sized = all(DIAMETER in shot.columns for shot in shots)
    if all(map(_beside_liquid, shots)):
        return told_share(p_real, sized, per_shot, BESIDE_LIQUID)
    return told_share(p_real, sized, per_shot)


def _beside_liquid(shot: StoredDroplets) -> bool:
    """Whether that is why nothing says how probably the droplets of any exposure are real."""
    exposures = shot.exposures
    return all(
        exposure["verdict"] == GOOD
        and exposure.get("hidden", {}).get("liquid_objects", 0)
        > MANY_OBJECTS * np.count_nonzero(shot.columns["frame"] == frame)
        for frame, exposure in exposures.items()
    )
