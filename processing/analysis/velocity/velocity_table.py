"""Velocities of the droplets of one exposure, a row each, in the order of the droplets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from processing.analysis.droplets.droplet_table import Columns
from processing.analysis.velocity.common_motion import Indices
from processing.analysis.velocity.partners import Partners
from processing.geometry import FloatArray

M_S_PER_MM_NS = 1e6
COVARIANCES = ("uu", "uv", "uw", "vv", "vw", "ww")
NO_PARTNER = -1


@dataclass(frozen=True, eq=False)
class Velocities:
    """Velocities of the droplets of one exposure.

    Parameters
    ----------
    velocities_m_s : (N, 3) array
        (u, v, w) along x, y, z; not a number where a droplet has no partner.
    covariance_m2_s2 : (N, 3, 3) array
        By the covariances of both places; errors of the calibration are common to both, and cancel.
    partners : Partners
        In the other exposure.
    """

    velocities_m_s: FloatArray
    covariance_m2_s2: FloatArray
    partners: Partners

    @classmethod
    def of_pairs(
        cls, partners: Partners, rows: Indices, velocities_m_s: FloatArray, covariance_m2_s2: FloatArray
    ) -> "Velocities":
        """Of all droplets of an exposure, where those of some rows are known."""
        every = np.full((len(partners.partner), 3), np.nan), np.full((len(partners.partner), 3, 3), np.nan)
        every[0][rows], every[1][rows] = velocities_m_s, covariance_m2_s2
        return cls(*every, partners)

    def __len__(self) -> int:
        return len(self.velocities_m_s)

    @property
    def paired(self) -> NDArray[np.bool_]:
        """Which droplets have a partner, (N,)."""
        return self.partners.partner >= 0

    def columns(self, others_first_row: int) -> Columns:
        """Columns by their names, as files have them.

        Parameters
        ----------
        others_first_row : int
            Row of the table in which the droplets of the other exposure begin.
        """
        partner = np.where(self.paired, self.partners.partner + others_first_row, NO_PARTNER)
        return {
            **dict(zip(("u_m_s", "v_m_s", "w_m_s"), self.velocities_m_s.T, strict=True)),
            **{
                f"cov_{pair}_m2_s2": self.covariance_m2_s2[:, "uvw".index(pair[0]), "uvw".index(pair[1])]
                for pair in COVARIANCES
            },
            "partner": partner.astype(np.int64),
            "p_pair": self.partners.p_pair,
            "p_runner_up": self.partners.p_runner_up,
        }
