"""Worst case of the stack, from the call graph that the compiler writes (-fcallgraph-info=su).

    stack.py LIMIT FILE.ci ...

Adds what may stand on it at once: the main loop, an interrupt of the lower priority, one of the higher, and a fault,
each with the frame that the processor pushes. Exit status 1 above the limit.
"""

import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

NODE = re.compile(r'^node: { title: "([^"]+)" label: "[^"]*?(?:(\d+) bytes \((\w+)\))?"', re.MULTILINE)
EDGE = re.compile(r'^edge: { sourcename: "([^"]+)" targetname: "([^"]+)"', re.MULTILINE)
CONTEXTS = {
    "main loop": ("main",),
    "lower interrupt": ("timer_isr", "clock_check_isr", "serial_uart_isr", "serial_usb_isr"),
    "higher interrupt": ("interlock_isr",),
    "fault": ("start_fault",),
}
EXCEPTION_BYTES = 36
LIBRARY_BYTES = 16
"""Division and memory routines, whose frames nobody tells."""
INDIRECT = "__indirect_call"


class StackError(Exception):
    """The stack cannot be bounded, or exceeds its limit."""


@dataclass
class CallGraph:
    """Frames in bytes, and who calls whom."""

    frames: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def read(self, text: str) -> None:
        for name, size, kind in NODE.findall(text):
            if kind not in ("", "static"):
                raise StackError(f"{name}: its frame is {kind}")
            if size:
                self.frames[name] = int(size)
        for caller, called in EDGE.findall(text):
            self.calls.setdefault(caller, set()).add(called)

    def only_by_pointer(self) -> set[str]:
        """What nobody calls by name must be called through a pointer, or be where a context starts."""
        called = set().union(*self.calls.values())
        starts = {"start_reset", *(name for names in CONTEXTS.values() for name in names)}
        return {name for name in self.frames if name not in called and name not in starts}


def depths(graph: CallGraph) -> Mapping[str, int]:
    """Bytes by context, without the processor's frames."""
    by_pointer = graph.only_by_pointer()
    under_way: set[str] = set()

    @cache
    def depth(name: str) -> int:
        if name in under_way:
            raise StackError(f"{name} calls itself")
        under_way.add(name)
        called = by_pointer if name == INDIRECT else graph.calls.get(name, set())
        deepest = max((depth(other) for other in called), default=0)
        under_way.discard(name)
        return deepest + (0 if name == INDIRECT else graph.frames.get(name, LIBRARY_BYTES))

    return {
        context: max((depth(name) for name in names if name in graph.frames), default=0)
        for context, names in CONTEXTS.items()
    }


def worst_bytes(files: Iterable[Path]) -> tuple[int, Mapping[str, int]]:
    """The sum, and its parts."""
    graph = CallGraph()
    for file in files:
        graph.read(file.read_text())
    if "main" not in graph.frames:
        raise StackError("no call graph of a main loop")
    parts = depths(graph)
    return sum(parts.values()) + EXCEPTION_BYTES * (len(parts) - 1), parts


def main() -> None:
    limit = int(sys.argv[1])
    worst, parts = worst_bytes(map(Path, sys.argv[2:]))
    told = ", ".join(f"{context} {size}" for context, size in parts.items())
    sys.stdout.write(
        f"           STACK:        {worst} B of {limit} B at worst: {told}, {EXCEPTION_BYTES} per exception\n"
    )
    if worst > limit:
        raise StackError(f"{worst} bytes of stack do not fit {limit}")


if __name__ == "__main__":
    main()
