"""What the wires carry, and how a run goes about faults: parts of the rig file."""

from typing import Annotated

from pydantic import Field

from daq.frozen_model import FrozenModel
from daq.network import Network
from daq.run.limits import AcquisitionLimits


class NetworkConfig(FrozenModel):
    """The wires between cameras and computer."""

    packet_bytes: Annotated[
        int, Field(ge=576, le=9000, description="stream packets: 9000 where all carry jumbo frames, else 1500")
    ] = Network.packet_bytes
    packet_delay_ns: Annotated[
        int, Field(ge=0, le=1_000_000, description="pause of a camera between packets, where a switch needs it")
    ] = Network.packet_delay_ns
    socket_buffer_bytes: Annotated[
        int, Field(ge=2**18, le=2**30, description="may wait per camera; net.core.rmem_max must permit it")
    ] = Network.socket_buffer_bytes
    camera_gbit_s: Annotated[float, Field(gt=0, le=100, description="rate of the wire of one camera")] = (
        Network.camera_gbit_s
    )
    shared_gbit_s: Annotated[
        float | None, Field(gt=0, le=400, description="rate of the wire that all cameras share; none: each its own")
    ] = Network.shared_gbit_s

    def to_network(self) -> Network:
        """The same as a value of acquisition."""
        return Network(**self.model_dump())


class AcquisitionConfig(FrozenModel):
    """Deadlines and sizes of acquisition that depend on the rig."""

    frame_deadline_s: Annotated[
        float,
        Field(gt=0, le=60, description="time for the network, after the cameras' cycle, until a frame is missing"),
    ] = AcquisitionLimits.frame_s
    live_unwatched_s: Annotated[
        float, Field(ge=1, le=86_400, description="a live view that nobody looks at for so long ends")
    ] = AcquisitionLimits.live_unwatched_s
    recorder_depth: Annotated[int, Field(ge=1, le=1000, description="shots that may wait for the disk")] = (
        AcquisitionLimits.recorder_depth
    )
    recorder_threads: Annotated[int, Field(ge=1, le=64, description="threads that compress shots")] = (
        AcquisitionLimits.recorder_threads
    )

    def to_limits(self) -> AcquisitionLimits:
        """The same as limits of acquisition."""
        return AcquisitionLimits(
            frame_s=self.frame_deadline_s,
            live_unwatched_s=self.live_unwatched_s,
            recorder_depth=self.recorder_depth,
            recorder_threads=self.recorder_threads,
        )
