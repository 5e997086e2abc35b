"""The circuit of docs/firmware/wiring.md and parts.md as a KiCad schematic, from the table of its parts.

    schematic.py pulse_generator.kicad_sch

Every part is a box, every pin carries the label of its net, and pins of the same label are connected: KiCad 6 and later
opens it. The same table gives the same bytes.
"""

import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

from circuit import OPEN, Part, parts

_GRID = 2.54
_COLUMN_MM, _GAP_MM, _PAGE_MM = 63.5, 12.7, 560.0
_BOX_MM, _PIN_MM = 12.7, 5.08
_NAMESPACE = uuid.UUID("6f0c8a52-6d1c-4f5e-9d3e-74d6f6d6f1a2")


def _uuid(name: str) -> str:
    return str(uuid.uuid5(_NAMESPACE, name))


def _symbol(part: Part) -> Iterator[str]:
    """The box of a part, for the library in the file: pins at its left, one below the other."""
    bottom = -_GRID * len(part.pins)
    name = f"tomoshadow:{part.reference}"
    yield f'    (symbol "{name}" (in_bom yes) (on_board yes)'
    for number, (key, text) in enumerate((("Reference", part.reference), ("Value", part.value))):
        yield f'      (property "{key}" "{text}" (id {number}) (at 0 {_GRID:g} 0) (effects (font (size 1.27 1.27))))'
    yield f'      (symbol "{part.reference}_1_1"'
    yield (
        f"        (rectangle (start 0 0) (end {_BOX_MM:g} {bottom:g})"
        " (stroke (width 0.254) (type default)) (fill (type background)))"
    )
    for row, pin in enumerate(part.pins):
        yield (
            f"        (pin {pin.kind} line (at {-_PIN_MM:g} {-_GRID * (row + 0.5):g} 0) (length {_PIN_MM:g})"
            f' (name "{pin.name}" (effects (font (size 1 1)))) (number "{pin.number}" (effects (font (size 1 1)))))'
        )
    yield "      )"
    yield "    )"


def _placed(part: Part, x: float, y: float) -> Iterator[str]:
    yield (
        f'  (symbol (lib_id "tomoshadow:{part.reference}") (at {x:g} {y:g} 0) (unit 1) (in_bom yes) (on_board yes)'
        f" (uuid {_uuid(part.reference)})"
    )
    for number, (key, text) in enumerate((("Reference", part.reference), ("Value", part.value))):
        yield (
            f'    (property "{key}" "{text}" (id {number}) (at {x + _BOX_MM / 2:g} {y - _GRID * (2 - number):g} 0)'
            " (effects (font (size 1.27 1.27))))"
        )
    yield "  )"
    for row, pin in enumerate(part.pins):
        at = f"(at {x - _PIN_MM:g} {y + _GRID * (row + 0.5):g}"
        identity = f"(uuid {_uuid(f'{part.reference}.{pin.number}')})"
        if pin.net == OPEN:
            yield f"  (no_connect {at}) {identity})"
        else:
            yield (
                f'  (global_label "{pin.net}" (shape passive) {at} 180)'
                f" (effects (font (size 1 1)) (justify right)) {identity})"
            )


def _places(all_parts: tuple[Part, ...]) -> Iterator[tuple[Part, float, float]]:
    """Column by column, on the grid of 50 mil."""
    x, y = _COLUMN_MM, 25.4
    for part in all_parts:
        height = _GRID * len(part.pins)
        if y + height > _PAGE_MM:
            x, y = x + _COLUMN_MM, 25.4
        yield part, x, y
        y += _GRID * round((height + _GAP_MM) / _GRID)


def schematic(all_parts: tuple[Part, ...]) -> str:
    """The file."""
    lines = [
        "(kicad_sch (version 20211123) (generator tomoshadow)",
        f"  (uuid {_uuid('sheet')})",
        '  (paper "A1")',
        '  (title_block (title "tomoshadow pulse generator") (comment 1 "not built: see docs/firmware/parts.md"))',
        "  (lib_symbols",
        *(line for part in all_parts for line in _symbol(part)),
        "  )",
        *(line for placed in _places(all_parts) for line in _placed(*placed)),
        '  (sheet_instances (path "/" (page "1")))',
        "  (symbol_instances",
        *(
            f'    (path "/{_uuid(part.reference)}" (reference "{part.reference}") (unit 1)'
            f' (value "{part.value}") (footprint ""))'
            for part in all_parts
        ),
        "  )",
        ")",
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(schematic(parts()))
