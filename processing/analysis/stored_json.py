"""The one reader of tables that a file keeps beside its columns: texts of JSON among its attributes."""

import json
from collections.abc import Mapping
from typing import Any


def stored_json(provenance: Mapping[str, object], name: str) -> Any:
    """A table by its name, of a file's provenance; empty where the file keeps none, or null.

    Parameters
    ----------
    provenance : mapping of str to str, int or float
        What a file says of itself.
    name : str
        ``exposures``, ``velocity``, ``settings``, ``notes``, ``spray``, ...
    """
    return json.loads(str(provenance.get(name, "{}"))) or {}
