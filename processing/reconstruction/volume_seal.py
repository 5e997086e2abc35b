"""A seal on files of volumes: one whose scale, place or origin was edited is refused when read."""

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

SEAL = "seal_sha256"


def seal_of(shape: tuple[int, ...], *tables: Mapping[str, Any]) -> str:
    """A hash of all that a file says of its voxels.

    The voxels themselves are not in it, as that would take as long as to write them; their chunks have checksums,
    which find what happened by chance.

    Parameters
    ----------
    shape : tuple of int
        Of the voxels.
    tables : mapping of name to value
        Attributes: where the voxels lie, their unit, where they come from. One that is named as the seal is left out.
    """
    said = [{name: _plain(value) for name, value in table.items() if name != SEAL} for table in tables]
    return hashlib.sha256(json.dumps([list(shape), *said], sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    plain = np.asarray(value).tolist()
    return plain.decode() if isinstance(plain, bytes) else plain
