"""What the views say of discs, each alone: how large it is, how surely, and whether they dispute it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.geometry import FloatArray

UNDISPUTED_SHARE, UNDISPUTED_SIGMAS = 0.75, 15.0
"""The squared radius that a view alone would give: over that of all, in the view that gives least; and over its
standard deviation, in the view that gives the second least."""
SUPPORT_SHARE, SUPPORT_SIGMAS = 0.4, 5.0
"""Views that judge a droplet must give it such a share of its squared radius, so surely."""


@dataclass(frozen=True, eq=False)
class DiscSupports:
    """What K views say of N discs, each while all others stay as they are.

    Parameters
    ----------
    squares_voxel2 : (N,) array
        Of the discs.
    sums : (K, N, 11) array
        As ``job.hpp`` has them.
    """

    squares_voxel2: FloatArray
    sums: FloatArray

    @property
    def alone(self) -> FloatArray:
        """Squared radii (K, N) that each view alone would give the discs."""
        return self.squares_voxel2 + self.sums[:, :, 7] / np.maximum(self.sums[:, :, 6], 1e-30)

    @property
    def alone_sd(self) -> FloatArray:
        """Their standard deviations (K, N); huge where a view sees nothing."""
        return 1 / np.sqrt(np.maximum(self.sums[:, :, 6], 1e-30))

    @property
    def disagreement(self) -> FloatArray:
        """How much more (N,) the views differ on the squared radii than noise lets them, 1 at least.

        The ratio of Birge (Phys. Rev. 40, 207, 1932), by which measurements that disagree lose their trust.
        """
        deviations = (self.alone - self.squares_voxel2) / self.alone_sd
        freedom = np.maximum(np.count_nonzero(self.sums[:, :, 6] > 0, axis=0) - 1, 1)
        return np.asarray(np.maximum(1.0, np.sqrt(np.sum(deviations**2, axis=0) / freedom)))

    @property
    def residual(self) -> FloatArray:
        """Root mean square (N,) of what is left around the discs, over the noise."""
        return np.asarray(np.sqrt(self.sums[:, :, 8].sum(axis=0) / np.maximum(self.sums[:, :, 9].sum(axis=0), 1)))

    @property
    def place_noise(self) -> FloatArray:
        """Root mean square (N,) of what is left, over the noise, where the images tell the places.

        That is at edges, which are darker than the light, and so less noisy (White, Econometrica 48, 817, 1980).
        """
        told = self.sums[:, :, 0].sum(axis=0) + self.sums[:, :, 2].sum(axis=0)
        return np.asarray(np.sqrt(self.sums[:, :, 10].sum(axis=0) / np.maximum(told, 1e-30)))

    def information(self, slopes_px: FloatArray) -> FloatArray:
        """Information (N, 4, 4) on x, y, z and the squared radius, by the slopes (K, N, 2, 3) of the lattice."""
        uu, uv, vv, us, vs, ss = np.moveaxis(self.sums[:, :, :6], -1, 0)
        places = np.stack([np.stack([uu, uv], -1), np.stack([uv, vv], -1)], -2)
        both = np.stack([us, vs], -1)
        out = np.empty((len(self.squares_voxel2), 4, 4))
        out[:, :3, :3] = np.einsum("knai,knab,knbj->nij", slopes_px, places, slopes_px)
        out[:, :3, 3] = out[:, 3, :3] = np.einsum("knai,kna->ni", slopes_px, both)
        out[:, 3, 3] = ss.sum(axis=0)
        return out


def undisputed(supports: DiscSupports) -> NDArray[np.bool_]:
    """Droplets (N,) to which every view gives about what all together do, and of which two at most are unsure."""
    share = (supports.alone / supports.squares_voxel2).min(axis=0)
    second = np.sort(supports.alone / supports.alone_sd, axis=0)[1]
    return np.asarray((share > UNDISPUTED_SHARE) & (second > UNDISPUTED_SIGMAS))


def supporting_views(supports: DiscSupports) -> NDArray[np.int64]:
    """How many views (N,) support each droplet alone."""
    sure = supports.alone > SUPPORT_SIGMAS * supports.alone_sd
    large = supports.alone > SUPPORT_SHARE * supports.squares_voxel2
    return np.asarray(np.count_nonzero(sure & large, axis=0), dtype=np.int64)
