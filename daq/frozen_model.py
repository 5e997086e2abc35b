"""FrozenModel: the base of values that come from files, plans and HTTP."""

from pydantic import BaseModel, ConfigDict


class FrozenModel(BaseModel):
    """A value: frozen, and a misspelt field is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")
