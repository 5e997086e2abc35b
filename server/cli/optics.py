"""``tomoshadow optics``: what the lenses, lights and cameras of a rig allow."""

from argparse import Namespace
from typing import Any

from server.cli.options import Verbs, add_rig, add_verb
from server.cli.output import Outcome, table


def add(verbs: Verbs) -> None:
    """Add the command."""
    summary = "optics of a rig: d_A, depth of field, blur, straddling window"
    add_rig(add_verb(verbs, "optics", optics, summary))


def optics(options: Namespace) -> Outcome:
    """Work out the optics of every view."""
    from server.rig.config import load_config
    from server.rig.optics_table import optics_table

    result = optics_table(load_config(options.config))
    return Outcome(result, f"{views_table(result)}\n{_motion(result)}")


def views_table(result: dict[str, Any]) -> str:
    """A line per view, for people."""
    rows = [
        [
            name,
            f"{view['image_scale_px_per_mm']:.2f}",
            f"{view['field_width_mm']:.1f} x {view['field_height_mm']:.1f}",
            f"{view['depth_of_field_mm']:.2f}",
            f"{view['airy_diameter_um']:.1f}",
            f"{view['resolved_diameter_um']:.1f}",
            f"{view['smallest_droplet_um']:.1f}",
            f"{view['blur_px']:.2f}",
            f"{view['displacement_px']:.1f}",
            _window(view["straddling_window_ns"]),
        ]
        for name, view in result["views"].items()
    ]
    heads = ["view", "px/mm", "field [mm]", "depth of field [mm]", "d_A [um]", "resolved [um]", "smallest [um]"]
    return table([*heads, "blur [px]", "displacement [px]", "separation [ns]"], rows)


def _motion(result: dict[str, Any]) -> str:
    motion = result["motion"]
    pulses = f"pulses of {motion['width_ns']} ns, {motion['separation_ns']} ns apart"
    moved = f"blur {motion['blur_um']:g} um, displacement {motion['displacement_um']:g} um"
    window = f"all cameras accept {_window(result['straddling_window_ns'])} ns"
    return f"droplets of {motion['velocity_m_s']:g} m/s, {pulses}: {moved}\n{window}"


def _window(window_ns: list[int]) -> str:
    shortest_ns, longest_ns = window_ns
    return f"{shortest_ns} to {longest_ns}"
