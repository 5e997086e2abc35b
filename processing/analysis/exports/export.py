"""Export: in which formats of other programs droplets are written, and where."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

from processing.analysis.droplets.droplet_file import StoredDroplets, read_droplets
from processing.analysis.exports.csv_file import write_csv
from processing.analysis.exports.parquet_file import require_pyarrow, write_parquet
from processing.analysis.exports.vtk_file import write_vtk


class Export(StrEnum):
    """A format."""

    CSV = "csv"
    VTK = "vtk"
    PARQUET = "parquet"

    @property
    def suffix(self) -> str:
        """Ending of its files."""
        return ".vtkhdf" if self is Export.VTK else f".{self.value}"

    @property
    def is_flat(self) -> bool:
        """Whether it holds droplets that have no position in space."""
        return self is not Export.VTK

    def require(self) -> None:
        """Refuse a format whose library is not installed, before anything is computed.

        Raises
        ------
        MissingLibraryError
            Parquet, without pyarrow.
        """
        if self is Export.PARQUET:
            require_pyarrow()


_WRITERS: Mapping[Export, Callable[[Path, StoredDroplets], None]] = MappingProxyType(
    {Export.CSV: write_csv, Export.VTK: write_vtk, Export.PARQUET: write_parquet}
)


def export_path(droplets_file: Path, export: Export) -> Path:
    """Where the export of a file of droplets lies: beside it, with another ending."""
    return droplets_file.with_suffix(export.suffix)


def export_droplets(droplets_file: str | Path, export: str) -> Path:
    """Write a file of droplets once more beside it, for other programs; an old export is replaced.

    Parameters
    ----------
    droplets_file : path
        Of ``tomoshadow measure``.
    export : {"csv", "vtk", "parquet"}
        Format.

    Returns
    -------
    Path
        What was written.

    Raises
    ------
    DropletFileError
        The file is not of droplets, or for VTK not of droplets in space.
    MissingLibraryError
        Parquet, without pyarrow.
    """
    kind, source = Export(export), Path(droplets_file)
    kind.require()
    target = export_path(source, kind)
    _WRITERS[kind](target, read_droplets(source))
    return target
