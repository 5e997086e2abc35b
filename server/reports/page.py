"""report.html: one self-contained page of tables and figures."""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from matplotlib.figure import Figure

DPI = 180
"""Dots of a picture per inch: sharp in print."""
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 2rem auto; padding: 0 1rem; color: #1d2733;
  counter-reset: figure; }
h1 { font-weight: 600; } h2 { font-weight: 600; margin-top: 2.5rem; border-bottom: 1px solid #d5dbe1; }
table { border-collapse: collapse; margin: 1rem 0; } th, td { padding: .3rem .9rem; text-align: right; }
th { border-bottom: 2px solid #1d2733; font-weight: 600; } td { border-bottom: 1px solid #d5dbe1; }
th:first-child, td:first-child { text-align: left; } table:not(.words) td + td { white-space: nowrap; }
table.words th, table.words td { text-align: left; } caption { text-align: left; color: #5b6875; }
figure { margin: 1.5rem 0; counter-increment: figure; } img { max-width: 100%; } figcaption { color: #5b6875; }
figcaption::before { content: "Figure " counter(figure) ". "; font-weight: 600; }
ul { padding-left: 1.2rem; }
@page { size: A4; margin: 18mm 16mm; }
@media print {
  body { font-size: 9.5pt; max-width: none; margin: 0; padding: 0; } h1 { font-size: 16pt; }
  h2 { font-size: 12pt; margin-top: 1.2rem; break-after: avoid; } th, td { padding: .12rem .5rem; }
  section:first-of-type { break-after: page; }
  figure, tr, table { break-inside: avoid; } thead { display: table-header-group; } p { orphans: 3; widows: 3; }
}
"""


@dataclass(frozen=True)
class Table:
    """Rows under a header; numbers come formatted, and stand to the right; words to the left."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: bool = False
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """A figure and what it shows; as SVG it is sharp at any size, but large where there are many shapes."""

    figure: Figure
    caption: str
    svg: bool = False


@dataclass(frozen=True)
class Section:
    """One chapter of the report."""

    title: str
    text: str = ""
    tables: Sequence[Table] = field(default_factory=tuple)
    pictures: Sequence[Picture] = field(default_factory=tuple)
    points: Sequence[str] = field(default_factory=tuple)


def write_report(file: Path, title: str, sections: Sequence[Section]) -> None:
    """Write the page; an existing report is replaced."""
    body = "\n".join(_section(section) for section in sections)
    page = (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f"<style>{STYLE}</style></head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )
    file.write_text(page, encoding="utf-8")


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.title)}</h2>"]
    if section.text:
        parts.append(f"<p>{escape(section.text)}</p>")
    if section.points:
        parts.append("<ul>" + "".join(f"<li>{escape(point)}</li>" for point in section.points) + "</ul>")
    parts += [_table(table) for table in section.tables]
    parts += [_picture(picture) for picture in section.pictures]
    return "<section>" + "\n".join(parts) + "</section>"


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in table.header)
    rows = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    words = ' class="words"' if table.words else ""
    return f"<table{words}>{caption}<thead><tr>{head}</tr></thead>\n<tbody>{rows}</tbody></table>"


def _picture(picture: Picture) -> str:
    buffer = io.BytesIO()
    kind, mime, dpi = ("svg", "svg+xml", DPI) if picture.svg else ("png", "png", DPI)
    picture.figure.savefig(buffer, format=kind, dpi=dpi)
    data = base64.b64encode(buffer.getvalue()).decode()
    caption = escape(picture.caption)
    width = f"{picture.figure.get_figwidth():g}in"
    image = f'<img alt="{caption}" style="width: {width}" src="data:image/{mime};base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"
