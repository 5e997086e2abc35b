"""A page of a report: everything is in it, and nothing that somebody wrote becomes markup."""

import base64
import re
from pathlib import Path

from matplotlib.figure import Figure

from server.reports.page import Picture, Section, Table, write_report


def test_a_page_holds_text_tables_and_pictures_of_both_kinds(tmp_path: Path) -> None:
    drawn = Figure(figsize=(1.5, 1))
    drawn.add_subplot().plot([0, 1])
    pictures = [Picture(drawn, "drawn", svg=True), Picture(drawn, "dots")]
    table = Table(["<b>", "n"], [["a & b", "1"]], words=True, caption="the <table>")
    file = tmp_path / "page.html"
    write_report(file, "a <title>", [Section("First", "1 < 2", [table], pictures, ["a <point>"])])
    text = file.read_text()
    for written in ("a &lt;title&gt;", "1 &lt; 2", "&lt;b&gt;", "a &amp; b", "the &lt;table&gt;", "a &lt;point&gt;"):
        assert written in text, written
    assert text.count('style="width: 1.5in"') == 2, "letters are as large in small pictures as in large ones"
    kinds = dict(re.findall(r'src="data:image/([a-z+]+);base64,([^"]+)"', text))
    assert base64.b64decode(kinds["svg+xml"]).lstrip().startswith(b"<?xml")
    assert base64.b64decode(kinds["png"]).startswith(b"\x89PNG")
    assert '<table class="words">' in text
    assert "@page { size: A4" in text
