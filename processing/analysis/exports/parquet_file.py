"""Droplets or tracks as Parquet, by pyarrow, which is an extra: ``pip install 'tomoshadow[tables]'``."""

import json
from importlib import import_module
from pathlib import Path
from typing import Any

from daq.files.atomic_file import replacing
from processing.analysis.exports.shot_table import shot_table
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.told_verdict import told_texts
from processing.errors import BadInput

PROVENANCE = "tomoshadow"
"""Key of the metadata of the table that holds the provenance, as JSON."""


class MissingLibraryError(BadInput):
    """What was asked for needs a library that is not installed; the text says which."""


def require_pyarrow() -> tuple[Any, Any]:
    """The library, and its part for Parquet.

    Raises
    ------
    MissingLibraryError
        It is not installed.
    """
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        raise MissingLibraryError(
            "Parquet needs pyarrow, which is not installed: pip install 'tomoshadow[tables]', or export csv"
        ) from error


def write_parquet(path: Path, stored: Stored) -> None:
    """Write a table.

    Parameters
    ----------
    path : Path
        Usually ``*.parquet``; an existing file is replaced.
    stored : Stored
        Droplets of a shot, or tracks; their provenance becomes metadata of the table, and what they are good for.

    Raises
    ------
    MissingLibraryError
        pyarrow is not installed.
    """
    pyarrow, parquet = require_pyarrow()
    table = pyarrow.table(
        {name: pyarrow.array(column, from_pandas=True) for name, column in shot_table(stored).items()}
    )
    metadata = {PROVENANCE: json.dumps(stored.provenance), **told_texts(stored)}
    with replacing(path) as part:
        parquet.write_table(table.replace_schema_metadata(metadata), part)
