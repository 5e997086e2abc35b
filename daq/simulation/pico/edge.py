"""What the outputs of the emulated board do."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Edge:
    """A change of an output.

    Parameters
    ----------
    cycle : int
        System clock cycles of 8 ns since construction of the emulator.
    output : str
        ``light0`` to ``light3``, ``camera0`` to ``camera3``, or ``trigger``, the inner line that starts a shot.
    high : bool
        Level after the change.
    """

    cycle: int
    output: str
    high: bool
