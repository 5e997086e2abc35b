"""How work on runs ends early."""

from processing.errors import BadInput


class PipelineError(BadInput):
    """A shot cannot be reconstructed; the text names run, shot and reason."""


class Stopped(Exception):
    """Work on a shot was told to stop."""
