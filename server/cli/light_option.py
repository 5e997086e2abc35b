"""The light of shadows as an option."""

from argparse import ArgumentParser

from server.cli.options import setting


def add_light(parser: ArgumentParser) -> None:
    """Let a command be told the light of shadows."""
    parser.add_argument(
        "--light",
        type=_light,
        metavar="RATIO",
        help="of shadows: aperture of the light over that of the lens, incoherent, or gaussian; default: estimated",
    )


def _light(text: str) -> "float | str":
    from processing.runs.droplets.measure_settings import MeasureSettings

    light: float | str = setting("light", text, MeasureSettings)
    return light
