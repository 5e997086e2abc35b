"""Forms that are kept under a name."""

import re
from pathlib import Path

import pytest

from daq.errors import StorageError
from server.lab.errors import Unprocessable
from server.lab.events import EventPublisher
from server.web.ui.draft import first_draft
from server.web.ui.run.templates import TemplateStore
from tests.support.memory_rig import memory_config


def test_a_template_keeps_the_form_but_what_belongs_to_the_day(tmp_path: Path) -> None:
    values = first_draft(memory_config(tmp_path / "runs")) | {
        "shots": 77,
        "references": ["dark-1"],
        "calibration": "cal",
    }
    templates = TemplateStore(tmp_path / "templates", EventPublisher())
    assert templates.names() == []
    templates.save("long run", values)
    kept = templates.load("long run")
    assert (kept["shots"], kept["current_a"]) == (77, values["current_a"])
    assert not {"references", "are_references_chosen", "calibration"} & set(kept)
    templates.remove("long run")
    assert (templates.names(), templates.load("long run")) == ([], {})


@pytest.mark.parametrize("text", ['{"shots": ', '{"kind": "party"}', "[]"])
def test_a_torn_template_is_set_aside_and_hides_no_other(tmp_path: Path, text: str) -> None:
    events = EventPublisher()
    templates = TemplateStore(tmp_path, events)
    templates.save("good", first_draft(memory_config(tmp_path / "runs")))
    (tmp_path / "torn.json").write_text(text)
    assert templates.names() == ["good"]
    (aside,) = tmp_path.glob("torn.json.damaged-*")
    assert aside.read_text() == text
    assert events.since(0)[0].name == "file_damaged"


@pytest.mark.parametrize("name", ["", "../draft", "a/b", ".hidden"])
def test_a_name_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    templates = TemplateStore(tmp_path / "templates", EventPublisher())
    with pytest.raises(Unprocessable, match="is no name for a template"):
        templates.save(name, {})
    assert templates.load(name) == {}


def test_a_disk_that_refuses_is_named(tmp_path: Path) -> None:
    (tmp_path / "templates").write_text("a file where the folder should be")
    with pytest.raises(StorageError, match=re.escape(str(tmp_path))):
        TemplateStore(tmp_path / "templates", EventPublisher()).save("bright", {"shots": 7})
