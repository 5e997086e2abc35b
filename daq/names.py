"""Names that become names of files, folders and keys: what may stand in them."""

from typing import Annotated

from pydantic import StringConstraints

ViewName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")]
"""A view in a run, whoever recorded it."""

RigViewName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
"""A view of a rig that records here: also a key of its TOML file, and a name of its devices."""

RunName = Annotated[str, StringConstraints(min_length=1, max_length=80, pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._-]*$")]
"""What an operator calls a run; its id adds a time."""
