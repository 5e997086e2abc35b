"""LinkBudget: what the images of a shot take of the wires between cameras and computer. Pure."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from daq.devices import Camera
from daq.frozen_model import FrozenModel
from daq.network import Network

_EXPOSURES = 2


class CameraLink(FrozenModel):
    """The wire of one camera."""

    shot_bytes: Annotated[int, Field(description="images of one shot")]
    wire_s: Annotated[float, Field(description="time that they take on the wire of the camera")]
    cycle_s: Annotated[float, Field(description="time in which the camera can take the next shot")]


class LinkBudget(FrozenModel):
    """The wires of all cameras."""

    cameras: Annotated[dict[str, CameraLink], Field(description="by view")]
    camera_gbit_s: Annotated[float, Field(description="rate of the wire of one camera")]
    shared_gbit_s: Annotated[
        float | None, Field(description="rate of the wire that all cameras share; null: each its own")
    ]
    shared_s: Annotated[float | None, Field(description="time that a shot of all cameras takes on that wire")]
    packet_bytes: Annotated[int, Field(description="size of a stream packet")]
    most_hz: Annotated[float, Field(description="shots per second that wires and cameras permit")]

    @property
    def limited_by(self) -> str:
        """What permits no more, in words."""
        times = {view: max(one.wire_s, one.cycle_s) for view, one in self.cameras.items()}
        longest_s = max(times.values())
        if self.shared_s is not None and self.shared_s >= longest_s:
            return "the wire that all cameras share"
        slowest = [view for view, time_s in times.items() if time_s == longest_s]
        what = "wire" if self.cameras[slowest[0]].wire_s == longest_s else "camera"
        return f"the {what}s" if len(slowest) == len(times) > 1 else f"the {what} of {' and '.join(slowest)}"


def link_budget(network: Network, cameras: Mapping[str, Camera]) -> LinkBudget:
    """What a shot of these cameras takes of a network."""
    sizes = {view: _shot_bytes(camera) for view, camera in cameras.items()}
    own = replace(network, shared_gbit_s=None)
    links = {
        view: CameraLink(shot_bytes=size, wire_s=own.shot_s({view: size}), cycle_s=cameras[view].timing.cycle_ns / 1e9)
        for view, size in sizes.items()
    }
    all_s, slowest_s = network.shot_s(sizes), max(link.cycle_s for link in links.values())
    return LinkBudget(
        cameras=links,
        camera_gbit_s=network.camera_gbit_s,
        shared_gbit_s=network.shared_gbit_s,
        shared_s=None if network.shared_gbit_s is None else all_s,
        packet_bytes=network.packet_bytes,
        most_hz=1 / max(all_s, slowest_s),
    )


def _shot_bytes(camera: Camera) -> int:
    rows, columns = camera.image_shape
    return _EXPOSURES * rows * columns * (1 if camera.bits == 8 else 2)
