"""Errors of the laboratory: what cannot be done, whoever asked for it."""

from daq.errors import DaqError
from processing.errors import BadInput


class ServerError(Exception):
    """Base of the errors that the server itself raises on purpose.

    Parameters
    ----------
    reason : str
        For the operator.
    code : str
        For programs; empty where the kind of the error says enough.
    """

    def __init__(self, reason: str, code: str = "") -> None:
        super().__init__(reason)
        self.code = code


class NotFound(ServerError):
    """There is no such thing; the text names it."""


class Conflict(ServerError):
    """The thing is not in a state that allows this; the text names the state."""


class Forbidden(ServerError):
    """Not everybody may do that."""


class Locked(ServerError):
    """Somebody else holds control of the rig; the text names him."""


class Damaged(ServerError):
    """A file that the server keeps cannot be read; the text names it."""


class Stale(ServerError):
    """The request was too long on its way; what it asks for may not be wanted any more."""


class Unprocessable(ServerError):
    """The request is well formed and makes no sense here."""


def told(error: BaseException) -> str:
    """What an operator reads of an error: its text; before that of a mistake of the program, its kind."""
    is_raised_on_purpose = isinstance(error, BadInput | DaqError | ServerError)
    return str(error) if is_raised_on_purpose else f"{type(error).__name__}: {error}"
