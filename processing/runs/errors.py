"""The error of work on runs."""

from processing.errors import BadInput


class PipelineError(BadInput):
    """A shot cannot be reconstructed; the text names run, shot and reason."""
