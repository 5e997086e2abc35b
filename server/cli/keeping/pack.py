"""``tomoshadow pack``: one plain HDF5 file of a run, to be given away."""

from argparse import Namespace

from daq.counted import counted
from server.cli.options import Verbs, add_out, add_verb, run_directory
from server.cli.output import Outcome


def add(verbs: Verbs) -> None:
    """Add the command."""
    parser = add_verb(verbs, "pack", pack, "copy a run into one plain HDF5 file that needs no other one")
    parser.add_argument("run", type=run_directory, metavar="RUN", help="run directory, or that of an import")
    add_out(parser, "file to write")


def pack(options: Namespace) -> Outcome:
    """Pack; a run of which a shot cannot be read is not packed."""
    from daq.files.run_directory import RunReader
    from daq.files.run_directory import pack as pack_run
    from processing.runs.overwriting import replacing, require_free

    require_free(options.out, overwrite=options.overwrite)
    shots = RunReader(options.run).shot_count
    with replacing(options.out) as out:
        pack_run(options.run, out)
    size_bytes = options.out.stat().st_size
    result = {"run": str(options.run), "file": str(options.out), "shots": shots, "size_bytes": size_bytes}
    return Outcome(result, f"{options.out}: {counted(shots, 'shot')}, {size_bytes / 1e6:.1f} MB")
