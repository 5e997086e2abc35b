from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.serving import Serving, serving


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path / "runs") as server:
        yield server
