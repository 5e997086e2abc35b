"""The option ``--export``: what is measured, in formats of other programs too."""

from argparse import ArgumentParser, ArgumentTypeError
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from processing.analysis.exports.export import Export


def add_export(parser: ArgumentParser, what: str) -> None:
    """Add the option."""
    metavar = "csv,vtk,parquet,tecplot"
    parser.add_argument(
        "--export", type=_exports, default=(), metavar=metavar, help=f"write {what} in these formats too"
    )


def _exports(text: str) -> "tuple[Export, ...]":
    from processing.analysis.exports.export import Export

    try:
        return tuple(dict.fromkeys(Export(name) for name in text.split(",")))
    except ValueError as error:
        raise ArgumentTypeError(f"{text}: formats are {', '.join(Export)}, with commas between them") from error
