"""Counts: as arguments whole numbers, not what Python would take for them; in texts as people say them."""

from numbers import Integral


def require_count(name: str, value: object, least: int = 0) -> int:
    """The count, or a refusal of what would be rounded, or is a truth value or a text.

    Raises
    ------
    ValueError
        The text names it.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise ValueError(f"{name} {value!r}: a whole number from {least}, please")
    return int(value)


def counted(number: int, what: str) -> str:
    """``1 shot``, ``2 shots``."""
    return f"{number} {what}{'s' * (number != 1)}"
