"""Names that become names of files, folders and keys: what may stand in them."""

import re
from typing import Annotated

from pydantic import StringConstraints

IDENTIFIER = r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,199}$"
"""An id names a file or a folder: it leads nowhere else, and file systems take it with any ending."""

Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER)]
"""Id of a run, a calibration, or results; the same in paths, queries and bodies."""


def is_identifier(text: str) -> bool:
    """Whether a text can be an id at all."""
    return re.fullmatch(IDENTIFIER, text) is not None


ViewName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
"""A view in a run, whoever recorded it."""

RigViewName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
"""A view of a rig that records here: also a key of its TOML file, and a name of its devices."""

RunName = Annotated[str, StringConstraints(min_length=1, max_length=80, pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]*$")]
"""What an operator calls a run; its id adds a time."""
