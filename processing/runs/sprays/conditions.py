"""What the operator has written down of a run travels with what is measured of it."""

from daq.files.run_directory import RunHeader


def conditions_of(header: RunHeader) -> dict[str, str]:
    """What the operator has written down of a run, as far as it says anything of the spray."""
    spray = header.spray.model_dump_json() if header.spray else ""
    notes = header.notes.model_dump_json(exclude_defaults=True)
    return {name: text for name, text in (("spray", spray), ("notes", notes)) if text not in ("", "{}")}
