"""Chapters on ligaments, break-up, and what nobody can know: they say what files say, and why something is missing."""

import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from processing.analysis.droplets.droplet_file import StoredDroplets
from processing.analysis.objects.break_up import THRESHOLDS, Reach
from processing.analysis.objects.seeing_views import UnseenMap
from processing.volume import VoxelGrid
from server.reports.liquid_sections import NO_MAP, ReportedLiquid, break_up_section, liquid_rows, unknown_section

GRID = VoxelGrid((4, 5, 6), (0.0, 0.0, 0.0), 0.1)


def reach(length_mm: float) -> Reach:
    return Reach(THRESHOLDS, (length_mm,) * 4, (False,) * 4, 0.01)


def shot(*reaches: Reach) -> StoredDroplets:
    """A ligament and a sheet in each exposure."""
    classes = ["ligament", "sheet"] * len(reaches)
    numbers = {"x_mm": 0.0, "y_mm": 1.0, "z_mm": 0.0, "length_mm": 0.5, "width_mm": 0.1, "thickness_mm": 0.1}
    more = {"length_sd_mm": 0.01, "direction_x": 0.6, "direction_y": 0.8, "direction_z": 0.0, "own_share": 1.0}
    objects: dict[str, Any] = {name: np.full(len(classes), value) for name, value in {**numbers, **more}.items()}
    objects |= {"frame": np.repeat(["a", "b"], 2)[: len(classes)], "class": np.array(classes)}
    objects["open"] = np.zeros(len(classes), np.uint8)
    told: dict[str, Any] = {"ligaments": 1, "sheets": 1, "clusters": 0, "blind_share": 0.01}
    exposures = {
        frame: {
            "objects": {**told, "unjudged_share": 0.02 * (1 + number), "reach": asdict(one)},
            "hidden": {"volume_share": 0.1},
        }
        for number, (frame, one) in enumerate(zip("ab", reaches, strict=False))
    }
    return StoredDroplets({"frame": np.empty(0, "U1")}, {"exposures": json.dumps(exposures)}, objects)


def test_lengths_have_limits_and_truth_and_objects_are_counted_by_exposure() -> None:
    liquid = ReportedLiquid.of_files([shot(reach(length_mm), reach(9.0)) for length_mm in (4.0, 5.0, 6.0)])
    assert liquid
    (name, value, within), *ligaments = liquid_rows(liquid)
    assert (name, value, " to " in within) == ("break-up length [mm]", "5.00", True)
    assert ligaments[0][:2] == ["ligaments, median length [mm]", "0.500"]
    section = break_up_section(liquid)
    assert section.text.startswith("Break-up length 5.00 mm along the axis (95 % limits ")
    assert "3 shots" in section.text
    (table,) = section.tables
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["ligaments"] == ["6", "1.0", "0.500 (0.500 to 0.500)", "0.50 to 0.50", "0.100 (0.100 to 0.100)"]
    assert rows["clusters"] == ["0", "0.0", "", "", ""]
    curve, objects = section.pictures[0].figure.axes
    assert "share of shots" in curve.get_ylabel()
    assert "ligament (1)" in {text.get_text() for text in objects.get_legend().get_texts()}  # type: ignore[union-attr]
    known = ReportedLiquid(liquid.reaches, 6, liquid.by_shot, liquid.shown, np.array([4.9, 5.2, 5.0]))
    assert "In truth it is 5.00 mm" in break_up_section(known).text


def test_a_large_body_that_lies_apart_is_told_beside_the_length() -> None:
    apart = [replace(reach(4.0), apart_mm=(5.0, 9.0)), reach(4.2)]
    liquid = ReportedLiquid.of_files([shot(one) for one in apart])
    assert liquid
    text = break_up_section(liquid).text
    assert text.startswith("Break-up length 4.10 mm")
    assert "In 1 of 2 shots a large body, 5.00 to 9.00 mm from the nozzle" in text


def test_without_a_length_the_reason_is_told_and_there_is_no_curve() -> None:
    liquid = ReportedLiquid.of_files([shot(Reach(reason="nobody stated where the nozzle is"))])
    assert liquid
    assert liquid_rows(liquid) == []
    section = break_up_section(liquid)
    assert section.text.startswith("No break-up length: nobody stated where the nozzle is.")
    assert len(section.pictures[0].figure.axes) == 1


def test_shares_that_cannot_be_known_are_told_and_mapped_where_images_were_seen() -> None:
    shots = [shot(reach(5.0), reach(5.0))]
    section = unknown_section(shots)
    assert section
    assert NO_MAP in section.text
    assert [row[1:] for row in section.tables[0].rows] == [["3.00", "4.00"], ["1.00", "1.00"], ["10.00", "10.00"]]
    mapped = unknown_section([_mapped(one, GRID) for one in shots])
    assert mapped
    assert NO_MAP not in mapped.text
    (axes, _) = mapped.pictures[0].figure.axes
    assert axes.get_title() == "25.0 % of the volume is seen by < 3 views"
    elsewhere = unknown_section([_mapped(shots[0], GRID), _mapped(shots[0], VoxelGrid((4, 5, 7), (0, 0, 0), 0.1))])
    assert elsewhere
    assert NO_MAP in elsewhere.text


def _mapped(of: StoredDroplets, places: VoxelGrid) -> StoredDroplets:
    """The same with a map: two views see the first of four planes, four the others."""
    exposures = json.loads(str(of.provenance["exposures"]))
    seeing = np.full(places.shape, 4, np.uint8)
    seeing[0] = 2
    for one in exposures.values():
        one["objects"]["unseen"] = UnseenMap.of(seeing, places).told()
    return StoredDroplets(of.columns, {"exposures": json.dumps(exposures)}, of.objects)


def test_of_files_that_say_nothing_there_is_no_chapter() -> None:
    old = StoredDroplets({"frame": np.empty(0, "U1")}, {"exposures": json.dumps({"a": {"verdict": "good"}})})
    assert ReportedLiquid.of_files([old]) is None
    assert unknown_section([old]) is None
    bright = {"a": {"verdict": "good", "hidden": {"volume_share": 0.1}}}
    assert unknown_section([StoredDroplets(old.columns, {"exposures": json.dumps(bright)})]) is None
