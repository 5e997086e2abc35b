"""Export: in which formats of other programs droplets and tracks are written, and where."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

from processing.analysis.droplets.droplet_file import read_droplets
from processing.analysis.exports.csv_file import write_csv
from processing.analysis.exports.parquet_file import require_pyarrow, write_parquet
from processing.analysis.exports.stored import Stored
from processing.analysis.exports.tecplot_file import write_tecplot
from processing.analysis.exports.vtk_file import write_vtk
from processing.analysis.velocity.track_file import read_tracks


class Export(StrEnum):
    """A format."""

    CSV = "csv"
    VTK = "vtk"
    PARQUET = "parquet"
    TECPLOT = "tecplot"

    @property
    def suffix(self) -> str:
        """Ending of its files."""
        return _SUFFIXES.get(self, f".{self.value}")

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


_SUFFIXES: Mapping[Export, str] = MappingProxyType({Export.VTK: ".vtkhdf", Export.TECPLOT: ".dat"})
_WRITERS: Mapping[Export, Callable[[Path, Stored], None]] = MappingProxyType(
    {
        Export.CSV: write_csv,
        Export.VTK: write_vtk,
        Export.PARQUET: write_parquet,
        Export.TECPLOT: write_tecplot,
    }
)


def export_path(file: Path, export: Export) -> Path:
    """Where the export of a file of droplets or tracks lies: beside it, with another ending."""
    return file.with_suffix(export.suffix)


def export_droplets(droplets_file: str | Path, export: str) -> Path:
    """Write a file of droplets once more beside it, for other programs; an old export is replaced.

    Parameters
    ----------
    droplets_file : path
        Of ``tomoshadow measure``.
    export : {"csv", "vtk", "parquet", "tecplot"}
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
    return _exported(Path(droplets_file), Export(export), read_droplets)


def export_tracks(tracks_file: str | Path, export: str) -> Path:
    """Write a file of tracks once more beside it, as ``export_droplets`` does one of droplets.

    Parameters
    ----------
    tracks_file : path
        Of ``tomoshadow tracks``; DropletFileError where it is none.
    export : str
        As of ``export_droplets``.
    """
    return _exported(Path(tracks_file), Export(export), read_tracks)


def _exported(source: Path, kind: Export, read: Callable[[Path], Stored]) -> Path:
    kind.require()
    target = export_path(source, kind)
    _WRITERS[kind](target, read(source))
    return target
