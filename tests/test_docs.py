"""What the pages say is so: their links, the files, names and commands in them, and the code to copy."""

import ast
import re
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from processing.calibration.sets.calibration_set import load_calibration_set
from server.cli.main import main
from tests.hunt import lights
from tests.support.sampled_sprays import cone_shots, write_results
from tests.support.write_measured import PARTS, replaced
from tests.support.write_rig_file import rig_file_page

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [page for pattern in ("*.md", "docs/**/*.md", "firmware/**/*.md") for page in sorted(ROOT.glob(pattern))]
OLD_DATA = ROOT / "tests" / "fixtures" / "v0.1.0"

LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```(\w*)\n(.*?)^```|`([^`\n]+)`", re.DOTALL | re.MULTILINE)
FOLDERS = "daq|processing|server|tomoshadow|firmware|configs|tests|docs"
NAMED = re.compile(rf"(?<![\w/.$-])((?:{FOLDERS})/[\w./*-]*)(?:::([\w.]+))?")
COMMAND = re.compile(r"(?:^|[\s/])(?<!import )tomoshadow((?: +[a-z|-]+)+)([^\n]*)")
TARGET = re.compile(r"(?<![\w-])make +([a-z][a-z0-9-]*)")

in_pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def without_code(page: Path) -> str:
    return re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def code_of(page: Path) -> str:
    """Everything that a page prints as code, a line each or a block."""
    text = page.read_text(encoding="utf-8").replace("\\|", "|")
    return "\n".join(block or inline for _, block, inline in CODE.findall(text))


def python_of(page: Path) -> list[str]:
    return [block for language, block, _ in CODE.findall(page.read_text(encoding="utf-8")) if language == "python"]


def anchors(page: Path) -> set[str]:
    """Headings as GitHub names them."""
    headings = re.findall(r"^#+ (.*)$", without_code(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@in_pages
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(without_code(page)):
        if re.match(r"https?://", link):
            continue
        path, _, anchor = link.partition("#")
        there = page.parent / path if path else page
        assert there.exists(), link
        assert not anchor or anchor in anchors(there), link


@in_pages
def test_files_and_names_in_code_are_there(page: Path) -> None:
    """``file.py::name`` is a name of that file."""
    named = set(NAMED.findall(code_of(page)))
    assert not [path for path, _ in named if not list(ROOT.glob(path))]
    assert not [f"{path}::{name}" for path, name in named if name and name not in names_in(ROOT / path)]


@cache
def names_in(file: Path) -> frozenset[str]:
    """Classes, functions and constants of a file, members as ``Class.member``; of C and C++ every word."""
    text = file.read_text(encoding="utf-8")
    return frozenset(_names(ast.parse(text).body)) if file.suffix == ".py" else frozenset(re.findall(r"\w+", text))


def _names(body: list[ast.stmt], owner: str = "") -> list[str]:
    names = []
    for node in body:
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            names.append(owner + node.name)
            names += _names(node.body, f"{owner}{node.name}.") if isinstance(node, ast.ClassDef) else []
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names += [owner + target.id for target in targets if isinstance(target, ast.Name)]
    return names


@in_pages
def test_commands_in_code_exist(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for verbs, rest in COMMAND.findall(code_of(page)):
        for command in _alternatives(verbs.split()):
            told = help_of(tuple(command), capsys)
            assert told, f"tomoshadow {' '.join(command)}"
            for option in re.findall(r"(?<!\S)--?[a-z][a-z-]*", rest):
                assert re.search(rf"{option}\b", told), f"tomoshadow {' '.join(command)} {option}"


def _alternatives(words: list[str]) -> list[list[str]]:
    """``firmware info|selftest`` is two commands; words after the verbs are for people."""
    verb, *more = words
    if verb not in ("study", "firmware") or not more:
        return [[verb]]
    return [[verb, tool] for tool in more[0].split("|")]


_HELP: dict[tuple[str, ...], str] = {}


def help_of(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command says of itself; nothing if there is no such command."""
    if command not in _HELP:
        with pytest.raises(SystemExit) as ended:
            main([*command, "--help"])
        said = capsys.readouterr().out
        _HELP[command] = said if ended.value.code == 0 else ""
    return _HELP[command]


@in_pages
def test_make_targets_in_code_exist(page: Path) -> None:
    makefiles = (ROOT / "Makefile").read_text() + (ROOT / "firmware" / "Makefile").read_text()
    for target in TARGET.findall(code_of(page)):
        assert re.search(rf"^([\w ]+ )?{target}( [\w ]+)?:", makefiles, re.MULTILINE), f"make {target}"


def test_the_readme_is_short() -> None:
    assert (ROOT / "README.md").read_text().count("\n") < 120


def test_every_page_is_found_from_the_index() -> None:
    linked = {(DOCS / link.partition("#")[0]).resolve() for link in LINK.findall((DOCS / "README.md").read_text())}
    assert set(DOCS.glob("*.md")) - linked == {DOCS / "README.md"}


def test_the_architecture_names_every_thread() -> None:
    """Of a real rig; the far ends of simulated wires have theirs in one sentence."""
    page = (DOCS / "architecture.md").read_text()
    sources = [path for package in ("daq", "processing", "server") for path in (ROOT / package).rglob("*.py")]
    lines = [line for path in sources if "simulation" not in path.parts for line in path.read_text().splitlines()]
    threads = [line for line in lines if re.search(r"\bThread\(target", line)]
    assert len(threads) >= 5
    for line in threads:
        name = re.search(r'name=f?"([^"]+)"', line)
        assert name, line
        assert re.sub(r"{[^}]*}", "", name[1]).strip() in page, name[1]


def test_the_page_of_the_rig_file_is_that_of_the_models() -> None:
    assert (DOCS / "rig-file.md").read_text() == rig_file_page(), (
        "a key has changed: write the page with\n  python -m tests.support.write_rig_file > docs/rig-file.md"
    )


def test_the_table_of_lights_is_where_it_is_written_anew() -> None:
    assert replaced(lights.PAGE.read_text(), "lights", "another table").count("another table") == 1


def test_every_measured_table_is_there() -> None:
    page = (DOCS / "measured.md").read_text()
    for name in [*PARTS, "bench"]:
        table = page.partition(f"<!-- {name} -->")[2].partition(f"<!-- /{name} -->")[0]
        assert table.count("\n|") >= 3, name


@pytest.mark.parametrize(
    ("break_up_mm", "told"),
    [
        ({"value": 5.5, "low": 1.25, "high": 5.75}, "5.50 (1.25 to 5.75)"),
        ({"value": 5.5, "low": 1.25, "high": None}, "5.50 (1.25 to beyond the field)"),
        (None, "none: it is too dense"),
    ],
    ids=["between", "beyond", "none"],
)
def test_a_break_up_length_without_an_upper_limit_is_written_down(
    break_up_mm: dict[str, float | None] | None, told: str
) -> None:
    droplets: dict[str, Any] = {
        "d32_um": {"value": 40.0, "low": 38.0, "high": 42.0},
        "velocity": {"mean_m_s": (0.0, 20.0, 0.0)},
        "true_velocity_m_s": (0.0, 20.0, 0.0),
        **dict.fromkeys(("found_share", "true_ghost_share", "hidden_share"), 0.0),
        **dict.fromkeys(("counted_from_um", "true_d32_um", "velocity_rms_m_s"), 1.0),
        "verdict": "good",
    }
    liquid = {"break_up_mm": break_up_mm, "break_up_reason": "it is too dense", "shots": 8, "true_break_up_mm": 5.4}
    said = {"views": {}, "quality_factor": 0.5, "shots_valid": 8, "shots_planned": 8}
    cone = {"measured": {"value": 62.1, "low": 60.0, "high": 64.3}, "true": 63.0}
    spray = {"cone_angle_deg": cone, "mass_flux_kg_m2_s": {"measured": None, "true": None}}
    table = PARTS["demo"].table({**said, "droplets": droplets, "liquid": liquid, "spray": spray})
    assert f"| {told} | 5.40 |" in table
    assert "| cone angle, 90 % of the liquid [°] | 62.1 (60.0 to 64.3) | 63.0 |" in table
    assert "| mass flux [kg/(m² s)] | not told |  |" in table


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with what the pages read: a run, a volume, the runs of a demonstration."""
    runs = {path.name.split("-", 1)[1]: path for path in (OLD_DATA / "runs").glob("2*")}
    shutil.copytree(runs["spray"], tmp_path / "RUN")
    shutil.copytree(runs["spray"], tmp_path / "demo-out" / "runs" / "demo_sample")
    shutil.copytree(runs["target"], tmp_path / "demo-out" / "runs" / "demo_calibration")
    volume = next((tmp_path / "RUN" / "results").glob("smart-*/shot_00000_a.vtkhdf"))
    shutil.copy(volume, tmp_path / volume.name)
    monkeypatch.chdir(tmp_path)


def run_python(page: Path) -> dict[str, object]:
    """Run the blocks of a page one after the other, in one name space; returns it."""
    names: dict[str, object] = {}
    for block in python_of(page):
        exec(compile(block, str(page), "exec"), names)
    return names


@pytest.mark.usefixtures("workplace")
def test_the_code_that_reads_volumes_reads_them(capsys: pytest.CaptureFixture[str]) -> None:
    names = run_python(DOCS / "reading-volumes.md")
    brightest, made_from = capsys.readouterr().out.splitlines()[:2]
    assert re.match(r"brightest voxel: 0\.\d+ at x, y, z = \[", brightest)
    assert "20261128T090938-spray 0 a smart" in made_from
    assert names["volume"].max() == pytest.approx(names["intensities"].max())  # type: ignore[attr-defined]
    assert names["middle_plane"].shape == names["volume"].shape[1:]  # type: ignore[attr-defined]
    assert names["rows"].shape[1] == 4  # type: ignore[attr-defined]


@pytest.mark.usefixtures("workplace")
def test_the_code_that_reads_runs_reads_them() -> None:
    names = run_python(DOCS / "file-formats.md")
    assert names["frame_b"].max() > 0  # type: ignore[attr-defined]
    assert list(names["keys"]) == [0, 0, 3]  # type: ignore[call-overload]


@pytest.mark.usefixtures("workplace")
def test_five_lines_give_a_d32_and_five_a_velocity_with_intervals(capsys: pytest.CaptureFixture[str]) -> None:
    velocity = '{"verdict": "good", "reasons": [], "pairs": 120, "stayed": 125}'
    write_results(Path("demo-out/runs/demo_sample/results/droplets-0"), cone_shots(0, 1, 120), velocity=velocity)
    for page in ("measure.md", "spray.md"):
        (block,) = [block for block in python_of(DOCS / page) if "demo-out" in block]
        assert len([line for line in block.splitlines() if line]) == 5
        exec(compile(block, page, "exec"), {})
    interval = r"95 % between \d+\.\d+ and \d+\.\d+"
    assert re.fullmatch(rf"v \d\.\d\d m/s, {interval}\nD32 \d+\.\d um, {interval}", capsys.readouterr().out.strip())


@pytest.mark.usefixtures("workplace")
def test_the_first_hour_goes_as_written(capsys: pytest.CaptureFixture[str]) -> None:
    """What it does with images from elsewhere, on those of a small rig, whose calibration stands for the slow fit."""
    page = DOCS / "first-hour.md"
    run_python(page)
    commands = re.findall(r"^\.venv/bin/tomoshadow (.*first.*)$", page.read_text(), flags=re.MULTILINE)
    importing, calibrating, reconstructing = (command.split() for command in commands)
    assert main(importing) == 0, capsys.readouterr().err
    assert calibrating == ["calibrate", "first", "-o", "first.json"]
    found = load_calibration_set(Path("first"))
    assert [len(view.planes) for view in found.views.values()] == [3, 3, 3]
    shutil.copy(next(OLD_DATA.glob("runs/calibrations/*-pinhole.json")), "first.json")
    assert main([*reconstructing, "--grid=-0.6:0.6,-0.6:0.6,-0.3:0.3@0.05"]) == 0, capsys.readouterr().err
    assert Path("first-volumes/shot_00000_b.vtkhdf").is_file()
