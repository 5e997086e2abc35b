"""Tables that files keep as texts are read in one place."""

import re
from pathlib import Path

from processing.analysis.stored_json import stored_json

ROOT = Path(__file__).parents[3]
READ_ELSEWHERE = re.compile(r"json\.loads\(str\((?!self)[\w.]*(?:provenance|shot|told)[.\[]")


def test_a_table_that_is_not_there_or_null_is_empty() -> None:
    assert stored_json({"velocity": '{"reason": "one exposure"}'}, "velocity") == {"reason": "one exposure"}
    assert stored_json({"velocity": "null"}, "velocity") == {}
    assert stored_json({}, "velocity") == {}


def test_nobody_else_reads_them() -> None:
    modules = [path for room in ("processing", "server", "tomoshadow") for path in (ROOT / room).rglob("*.py")]
    readers = [path.name for path in modules if READ_ELSEWHERE.search(path.read_text("utf-8"))]
    assert readers == ["stored_json.py"]
