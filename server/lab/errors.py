"""Errors of the laboratory: what cannot be done, whoever asked for it."""


class ServerError(Exception):
    """Base of the errors that the server itself raises on purpose."""


class NotFound(ServerError):
    """There is no such thing; the text names it."""


class Conflict(ServerError):
    """The thing is not in a state that allows this; the text names the state."""


class Damaged(ServerError):
    """A file that the server keeps cannot be read; the text names it."""


class Unprocessable(ServerError):
    """The request is well formed and makes no sense here."""
