"""AcquisitionLimits: every deadline of acquisition in one value."""

from dataclasses import dataclass


@dataclass(frozen=True)
class AcquisitionLimits:
    """Deadlines and sizes of acquisition.

    Parameters
    ----------
    frame_s : float
        Time for the network, after the cycle of the slowest camera, until an exposure counts as missing.
    patience_s : float
        For cameras that re-base or are late with their frames, which takes milliseconds, until the light is off.
    light_off_s : float
        Until the generator must have confirmed that the light is off.
    disarm_s : float
        Until cameras that are not disarmed are left alone.
    drain_s : float
        Until shots that wait must be on the disk.
    heartbeat_s : float
        Period of the status requests to the generator.
    invalid_in_a_row : int
        Invalid shots, one after the other, that end a run.
    disk_margin_bytes : int
        What a run leaves free on the disk: without it no run starts, and one under way ends.
    live_unwatched_s : float
        Until a live view that nobody looks at is over.
    recorder_depth, recorder_threads : int
        Shots that may wait for the disk, and threads that compress them.
    """

    frame_s: float = 1.0
    patience_s: float = 0.2
    light_off_s: float = 2.0
    disarm_s: float = 5.0
    drain_s: float = 60.0
    heartbeat_s: float = 0.2
    invalid_in_a_row: int = 5
    live_unwatched_s: float = 600.0
    disk_margin_bytes: int = 256 * 2**20
    recorder_depth: int = 8
    recorder_threads: int = 2
