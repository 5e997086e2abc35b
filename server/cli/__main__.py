"""``python -m server.cli``."""

import sys

from server.cli.main import program

sys.exit(program())
