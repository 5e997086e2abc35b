"""Where tracks are, how fast they are, and where they should be in the next frame: a Kalman filter for all at once.

A droplet keeps its velocity but for an acceleration that changes from frame to frame by chance. Times are in frames.
"""

from dataclasses import dataclass, replace

import numpy as np

from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.moving_droplets import MovingDroplets
from processing.geometry import FloatArray

ACCELERATED = np.kron([[0.25, 0.5], [0.5, 1.0]], np.eye(3))
"""What an acceleration of 1 during a frame does to place and velocity, as a covariance."""
ONWARD = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(3))
"""Place and velocity a frame later."""


@dataclass(frozen=True, eq=False)
class TrackStates:
    """Tracks that go on.

    Parameters
    ----------
    ids : (N,) int array
        Their numbers.
    state : (N, 6) array
        Place in voxels and velocity in voxels per frame.
    covariance : (N, 6, 6) array
        Of both.
    log_sizes : (N,) array
        Mean of their droplets.
    lengths, missed : (N,) int arrays
        Droplets so far, and frames since the last one.
    """

    ids: Indices
    state: FloatArray
    covariance: FloatArray
    log_sizes: FloatArray
    lengths: Indices
    missed: Indices

    @classmethod
    def begun(cls, ids: Indices, seen: MovingDroplets, velocities: FloatArray, scatter: float) -> "TrackStates":
        """Tracks of a droplet each, whose velocities are those around them, to a standard deviation."""
        covariance = np.zeros((len(ids), 6, 6))
        covariance[:, :3, :3], covariance[:, 3:, 3:] = seen.covariance, scatter**2 * np.eye(3)
        state = np.hstack([seen.places, velocities])
        return cls(ids, state, covariance, seen.log_sizes, np.ones(len(ids), np.intp), np.zeros(len(ids), np.intp))

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def places(self) -> FloatArray:
        """In voxels."""
        return self.state[:, :3]

    @property
    def velocities(self) -> FloatArray:
        """In voxels per frame."""
        return self.state[:, 3:]

    @property
    def droplets(self) -> MovingDroplets:
        """What a frame should show of them."""
        return MovingDroplets(self.places, self.covariance[:, :3, :3], self.log_sizes)

    def where(self, chosen: Indices) -> "TrackStates":
        """The chosen ones, by index or mask."""
        return TrackStates(*(column[chosen] for column in vars(self).values()))

    def joined(self, more: "TrackStates") -> "TrackStates":
        """These and more."""
        pairs = zip(vars(self).values(), vars(more).values(), strict=True)
        return TrackStates(*(np.concatenate(pair) for pair in pairs))

    def onward(self, acceleration: float) -> "TrackStates":
        """A frame later, with accelerations of this standard deviation, in voxels per frame squared."""
        covariance = ONWARD @ self.covariance @ ONWARD.T + acceleration**2 * ACCELERATED
        return replace(self, state=self.state @ ONWARD.T, covariance=covariance, missed=self.missed + 1)

    def seen(self, rows: Indices, droplets: MovingDroplets) -> "TrackStates":
        """After some rows have been seen as droplets, one each."""
        before = self.covariance[rows]
        gain = before[:, :, :3] @ np.linalg.inv(before[:, :3, :3] + droplets.covariance)
        state, covariance, log_sizes = self.state.copy(), self.covariance.copy(), self.log_sizes.copy()
        lengths, missed = self.lengths.copy(), self.missed.copy()
        state[rows] += np.einsum("nij,nj->ni", gain, droplets.places - self.places[rows])
        covariance[rows] = before - gain @ before[:, :3]
        lengths[rows] += 1
        log_sizes[rows] += (droplets.log_sizes - log_sizes[rows]) / lengths[rows]
        missed[rows] = 0
        return replace(self, state=state, covariance=covariance, log_sizes=log_sizes, lengths=lengths, missed=missed)
