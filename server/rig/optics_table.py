"""What the lenses, lights and cameras of a rig allow, for the command ``tomoshadow optics``."""

from dataclasses import dataclass
from typing import Any

from daq.drivers.camera_profile import load_camera_profile
from daq.errors import PlanError
from processing.optics import (
    airy_diameter_um,
    depth_of_field_mm,
    image_scale_px_per_mm,
    resolved_diameter_um,
    straddling_window,
    travel_um,
)
from server.rig.config import RigConfig, ViewConfig


@dataclass(frozen=True)
class Motion:
    """How fast droplets fly, and how they are lit.

    Parameters
    ----------
    velocity_m_s : float
        Fastest droplets; water at 6 bar leaves the nozzle with sqrt(2 dp / rho) = 34.6 m/s.
    width_ns, separation_ns : int
        Pulse pair; the paper's is the default.
    """

    velocity_m_s: float = 34.6
    width_ns: int = 1000
    separation_ns: int = 6400


PAPER_MOTION = Motion()


def optics_table(config: RigConfig, motion: Motion = PAPER_MOTION) -> dict[str, Any]:
    """Optics of every view, and the pulse separations that all cameras accept.

    Raises
    ------
    PlanError
        The pulses do not fit the exposures of a camera; names view and camera profile.
    """
    windows_ns = {name: _straddling_window_ns(name, view, motion) for name, view in config.views.items()}
    views = {
        name: {**_view(view, motion), "straddling_window_ns": windows_ns[name]} for name, view in config.views.items()
    }
    return {
        "motion": {
            "velocity_m_s": motion.velocity_m_s,
            "width_ns": motion.width_ns,
            "separation_ns": motion.separation_ns,
            "blur_um": round(travel_um(motion.velocity_m_s, motion.width_ns), 1),
            "displacement_um": round(travel_um(motion.velocity_m_s, motion.separation_ns), 1),
        },
        "straddling_window_ns": [
            max(shortest for shortest, _ in windows_ns.values()),
            min(longest for _, longest in windows_ns.values()),
        ],
        "views": views,
    }


def _straddling_window_ns(name: str, view: ViewConfig, motion: Motion) -> list[int]:
    timing = load_camera_profile(view.camera.profile).camera_timing
    try:
        window = straddling_window(
            width_ns=motion.width_ns,
            exposure_a_ns=timing.exposure_a_ns,
            gap_ns=timing.gap_ns,
            exposure_b_ns=timing.exposure_b_ns,
            guard_ns=timing.guard_ns,
        )
    except ValueError as error:
        raise PlanError(f"{name}: {error} of {view.camera.profile}") from error
    return [window.shortest_ns, window.longest_ns]


def _view(view: ViewConfig, motion: Motion) -> dict[str, float]:
    lens, sensor = view.lens, view.sensor
    scale_px_per_mm = image_scale_px_per_mm(lens.magnification, sensor.pixel_pitch_um)
    airy_um = airy_diameter_um(lens.f_number, lens.magnification)
    values = {
        "airy_diameter_um": airy_um,
        "airy_diameter_px": airy_um / sensor.pixel_pitch_um,
        "resolved_diameter_um": resolved_diameter_um(lens.f_number, lens.magnification),
        "depth_of_field_mm": depth_of_field_mm(lens.f_number, lens.magnification),
        "image_scale_px_per_mm": scale_px_per_mm,
        "field_width_mm": sensor.width_px / scale_px_per_mm,
        "field_height_mm": sensor.height_px / scale_px_per_mm,
        "blur_px": travel_um(motion.velocity_m_s, motion.width_ns) / 1000 * scale_px_per_mm,
        "displacement_px": travel_um(motion.velocity_m_s, motion.separation_ns) / 1000 * scale_px_per_mm,
    }
    return {key: round(value, 2) for key, value in values.items()}
