"""What droplets say of the light, and what speaks against diameters in it."""

from dataclasses import dataclass

from processing.analysis.droplets.shadows.light.fringes import LEAST_FRINGES, Fringes

UNSURE, SURE = 1 / 3, 2 / 3
"""Shares of the droplets that must be explained better, to be unsure of the light, and to be sure that it shows.

Of simulated shots 0 to 20 % were behind a Gaussian blur, 73 to 100 % in light that shows.
"""
LEAST_DROPLETS = 10
"""That vote; blur is taken as Gaussian where there are fewer."""
STATE_IT = (
    "state what is known of the rig (--light: aperture of the light over that of the lens; incoherent; or gaussian, of "
    "a lens that is not sharp)"
)


@dataclass(frozen=True)
class SeenLight:
    """What droplets say of the light.

    Parameters
    ----------
    condenser_ratio : float | None
        Numerical aperture of the light over that of the lens; None: it does not show behind a Gaussian blur.
    share : float
        Of the droplets, which this light, or the best one, explains better than a Gaussian blur does.
    radius_sd : float
        Standard deviation that all radii share because the light is not known better, in the unit of the radii.
    fringes : Fringes | None
        Of the light that explains droplets best: without them it is not believed. None: it makes none, or it explains
        them worse than a Gaussian blur, or nobody asked.
    """

    condenser_ratio: float | None = None
    share: float = 0.0
    radius_sd: float = 0.0
    fringes: Fringes | None = None

    def doubts(self, droplets: int) -> tuple[str, ...]:
        """What speaks against the diameters of so many droplets in it."""
        if self.fringes is None:
            return light_doubts(self.share, droplets)
        if self.fringes.seen:
            return ()
        if self.fringes.missing:
            return (without_fringes(self.fringes, "are those behind a Gaussian blur, and may be 10 um too large"),)
        return (
            "which light this is cannot be told: droplets look as in light from few directions, or larger behind a "
            "Gaussian blur, or moving while the light is on; fringes would tell, and are lost in noise. Diameters may "
            f"be up to 10 um too large; {STATE_IT}",
        )


STATED = SeenLight(share=1.0)
"""Nobody asked the droplets."""


def light_doubts(share: float, droplets: int) -> tuple[str, ...]:
    """What speaks against diameters in an estimated light.

    Parameters
    ----------
    share : float
        Of the droplets, which a light that shows explains better than a Gaussian blur does.
    droplets : int
        How many.
    """
    if not droplets or share >= SURE or (droplets >= LEAST_DROPLETS and share <= UNSURE):
        return ()
    few = f": fewer than {LEAST_DROPLETS} do not vote" if droplets < LEAST_DROPLETS else ""
    return (
        f"which light this is cannot be told from these droplets{few}, and diameters may be up to 10 um wrong; "
        f"{STATE_IT}",
    )


def without_fringes(fringes: Fringes, wrong: str) -> str:
    """Why a light whose fringes are missing is doubted, and how wrong diameters may be."""
    return (
        f"droplets look as in light from few directions, and {100 * max(fringes.share, 0):.0f} % of its fringes are "
        f"there, limit {100 * LEAST_FRINGES:.0f} %: do they move while the light is on, or are lenses out of focus? "
        f"Diameters {wrong}: shorten the pulses, or state --light gaussian of a lens that is not sharp"
    )


def looks_otherwise(stated: float | None, seen: float | None, off_um: float, *, by_others: bool) -> str:
    """Why a light is doubted that was stated, or told by other shots: droplets tell another, with other diameters."""
    names = [
        "behind a Gaussian blur" if ratio is None else f"in light of {ratio:g} apertures" for ratio in (stated, seen)
    ]
    told = "by the first shots of the run, droplets are" if by_others else "droplets are stated to be"
    remedy = "measure shots in one light apart from the others" if by_others else "leave it out, and droplets tell"
    return (
        f"{told} seen {names[0]}, and these look as {names[1]}, where diameters are {abs(off_um):.1f} um "
        f"{'larger' if off_um > 0 else 'smaller'}: state --light as the rig has it, or {remedy}"
    )
