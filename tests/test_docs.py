"""What the pages link to is there: files, and headings within them."""

import re
from pathlib import Path

import pytest

from tests.support.write_measured import PARTS
from tests.support.write_rig_file import rig_file_page

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [page for pattern in ("*.md", "docs/**/*.md", "firmware/**/*.md") for page in sorted(ROOT.glob(pattern))]
LINK = re.compile(r"\]\(([^)\s]+)\)")


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """Headings as GitHub names them."""
    headings = re.findall(r"^#+ (.*)$", without_code(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(without_code(page)):
        if re.match(r"https?://", link):
            continue
        path, _, anchor = link.partition("#")
        there = page.parent / path if path else page
        assert there.exists(), link
        assert not anchor or anchor in anchors(there), link


def test_the_page_of_the_rig_file_is_that_of_the_models() -> None:
    assert (DOCS / "rig-file.md").read_text() == rig_file_page(), (
        "a key has changed: write the page with\n  python -m tests.support.write_rig_file > docs/rig-file.md"
    )


def test_every_measured_table_is_there() -> None:
    page = (DOCS / "measured.md").read_text()
    for name in [*PARTS, "bench"]:
        table = page.partition(f"<!-- {name} -->")[2].partition(f"<!-- /{name} -->")[0]
        assert table.count("\n|") >= 3, name
