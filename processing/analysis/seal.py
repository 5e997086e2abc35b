"""A seal: a hash of tables and of what is told beside them, by which a file that was edited is known."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEAL = "seal_sha256"
Table = Mapping[str, NDArray[Any]]


def seal_of(kinds: Mapping[str, Mapping[str, Table]], provenance: Mapping[str, Any]) -> str:
    """Hash of all that is written, as hexadecimal digits.

    Parameters
    ----------
    kinds : mapping of kind to exposures, of these to tables
        Their columns; neither the order of exposures nor that of columns matters.
    provenance : Mapping[str, str | int | float]
        Where they come from; an older seal among it does not count.
    """
    digest = hashlib.sha256()
    for kind, tables in kinds.items():
        for frame in sorted(tables):
            for part in _bytes_of(tables[frame]):
                digest.update(f"{kind} {frame} ".encode() + part)
    kept = {name: value for name, value in provenance.items() if name != SEAL}
    digest.update(json.dumps(kept, sort_keys=True).encode())
    return digest.hexdigest()


def _bytes_of(table: Table) -> Iterator[bytes]:
    """Column by column; texts do not depend on how many bytes each has in the file."""
    for name in sorted(table):
        values = np.ascontiguousarray(table[name])
        if values.size:
            text = values.dtype.kind in "SU"
            yield f"{name} {'text' if text else values.dtype.str} ".encode()
            yield "\0".join(values.astype("U").tolist()).encode() if text else values.tobytes()
