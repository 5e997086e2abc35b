"""Mean diameters in a light that is not known for sure: it makes all of them wrong alike, and no mean takes it out."""

from processing.analysis.droplets.size_statistics import SizeStatistics
from processing.analysis.estimates import MANY, Estimate, reach


def in_its_light(sizes: SizeStatistics, light_sd_um: float) -> SizeStatistics:
    """The same with intervals that hold what the light is not known to, too."""
    if not light_sd_um:
        return sizes
    told = {name: one for name, one in dict(sizes).items() if name.endswith("_um") and isinstance(one, Estimate)}
    wider = {name: one.less_sure(_of_light(light_sd_um, one)) for name, one in told.items()}
    return sizes.model_copy(update={"light_sd_um": light_sd_um, **wider})


def by_shots(sizes: SizeStatistics, name: str) -> Estimate | None:
    """A figure with the interval that shots alone give it: all shots, and all runs of a rig, are in one light."""
    one: Estimate | None = getattr(sizes, name)
    return one.without(_of_light(sizes.light_sd_um, one)) if one and name.endswith("_um") and sizes.light_sd_um else one


def _of_light(light_sd_um: float, figure: Estimate) -> float:
    """Half of a 95 % interval over the figure."""
    return reach(MANY) * light_sd_um / figure.value
