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
    smallest_droplet_um,
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
    windows_ns = {name: _straddling_ns(name, view, motion.width_ns) for name, view in config.views.items()}
    views = {
        name: {**_view(view, motion), "straddling_window_ns": list(windows_ns[name])}
        for name, view in config.views.items()
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


def _straddling_ns(name: str, view: ViewConfig, width_ns: int) -> tuple[int, int]:
    camera = load_camera_profile(view.camera.profile).camera_timing
    if not camera.has_room_for(width_ns):
        raise PlanError(
            f"{name}: width_ns: {width_ns} ns and 2 x guard {camera.guard_ns} ns do not fit the shorter exposure, "
            f"{min(camera.exposure_a_ns, camera.exposure_b_ns)} ns of {view.camera.profile}"
        )
    return camera.straddling_ns(width_ns)


def _view(view: ViewConfig, motion: Motion) -> dict[str, float]:
    lens, sensor = view.lens, view.sensor
    scale_px_per_mm = image_scale_px_per_mm(lens.magnification, sensor.pixel_pitch_um)
    airy_um = airy_diameter_um(lens.f_number, lens.magnification)
    values = {
        "airy_diameter_um": airy_um,
        "airy_diameter_px": airy_um / sensor.pixel_pitch_um,
        "resolved_diameter_um": resolved_diameter_um(lens.f_number, lens.magnification),
        "smallest_droplet_um": smallest_droplet_um(airy_um / sensor.pixel_pitch_um, scale_px_per_mm),
        "depth_of_field_mm": depth_of_field_mm(lens.f_number, lens.magnification),
        "image_scale_px_per_mm": scale_px_per_mm,
        "field_width_mm": sensor.width_px / scale_px_per_mm,
        "field_height_mm": sensor.height_px / scale_px_per_mm,
        "blur_px": travel_um(motion.velocity_m_s, motion.width_ns) / 1000 * scale_px_per_mm,
        "displacement_px": travel_um(motion.velocity_m_s, motion.separation_ns) / 1000 * scale_px_per_mm,
    }
    return {key: round(value, 2) for key, value in values.items()}
