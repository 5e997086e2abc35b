"""A number of things, as people say it."""


def counted(number: int, what: str) -> str:
    """``1 shot``, ``2 shots``."""
    return f"{number} {what}{'s' * (number != 1)}"
