"""Accuracy: how finely images are resampled."""

from enum import StrEnum


class Accuracy(StrEnum):
    """Pixels per voxel of rectified images; their samples are interpolated linearly."""

    NOMINAL = "nominal"
    """As accurate as linear interpolation of the recorded image."""
    FINE = "fine"
    """Two to three times more accurate, at twice the cost."""

    @property
    def pixels_per_voxel(self) -> float:
        """Of the plane that is nearest to the camera."""
        return 0.95 if self is Accuracy.NOMINAL else 1.5
