"""How far the balls of a spray hang together with the nozzle: the truth of a break-up length."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from processing.synthetic.spray import Spray
from processing.synthetic.stamping import FloatArray


def connected_length_mm(spray: Spray, nozzle_mm: FloatArray, near_mm: float) -> float:
    """Largest distance along y of what touches, ball by ball, what is near the nozzle; 0 where nothing is."""
    radii_mm = spray.diameters_mm / 2
    pairs = cKDTree(spray.positions_mm).query_pairs(2 * float(radii_mm.max()), output_type="ndarray")
    one, other = pairs.T
    apart_mm = np.linalg.norm(spray.positions_mm[one] - spray.positions_mm[other], axis=1)
    one, other = pairs[apart_mm <= radii_mm[one] + radii_mm[other]].T
    links = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(spray), len(spray)))
    labels = connected_components(links, directed=False)[1]
    near = np.linalg.norm(spray.positions_mm - nozzle_mm, axis=1) - radii_mm < near_mm
    held = np.isin(labels, labels[near])
    return float(np.max(spray.positions_mm[held, 1] + radii_mm[held] - nozzle_mm[1], initial=0.0))
