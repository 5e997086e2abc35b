"""Droplets of single images: rendered discs of known size, and shadowgraphs that others have annotated."""

import csv
import os
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from processing.analysis.flat.darkness import LightError
from processing.analysis.flat.flat_doubts import flat_doubts
from processing.analysis.flat.flat_droplets import FlatDroplets, measure_flat
from processing.analysis.flat.flat_settings import FlatSettings
from processing.errors import BadInput
from processing.preprocessing import Polarity
from tests.support.flat_scenes import LIGHT, PLACES, SHAPE, Disc, noisy, seen, shadow, spread_discs

EVERY = 4
"""So many of the annotated images are taken; of all 273 droplets 98.9 % are found, and sized by 0.98 in the median."""


@pytest.mark.parametrize(
    ("diameter_px", "blur_px"),
    [(d, b) for d in (8.0, 13.3, 31.0, 60.4) for b in (0.0, 0.7, 1.5, 3.0) if b <= 0.25 * d],
)
def test_the_area_of_a_disc_is_exact_to_two_percent_however_sharp(diameter_px: float, blur_px: float) -> None:
    found = measure_flat(shadow([(100.3, 80.7, diameter_px)], blur_px))
    assert len(found) == 1
    assert (found.diameters_px[0] / diameter_px) ** 2 == pytest.approx(1, abs=0.02)
    np.testing.assert_allclose(found.centres_px[0], (100.3, 80.7), atol=0.03)
    assert found.blur_px[0] == pytest.approx(np.hypot(blur_px, 0.29), abs=0.25), "a pixel blurs by 1 / sqrt(12)"
    assert found.depths[0] > 0.5
    assert found.circularity[0] > 0.95


def test_noise_and_uneven_light_change_sizes_little() -> None:
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = LIGHT * (1.1 - 0.4 * ((row - 70) / 160) ** 2 - 0.4 * ((column - 130) / 220) ** 2)
    discs = [(40.2, 40.0, 12.0), (110.0, 60.5, 20.0), (170.0, 110.2, 30.0), (60.0, 120.0, 16.0)]
    found = measure_flat(shadow(discs, blur_px=1.0, noise=0.02, light=light))
    for disc, nearest in matched(found, discs):
        assert found.diameters_px[nearest] == pytest.approx(disc[2], rel=0.02)
    assert len(found) == len(discs)


def matched(found: FlatDroplets, discs: Sequence[Disc]) -> list[tuple[Disc, int]]:
    return [
        (disc, int(np.argmin(np.hypot(found.centres_px[:, 0] - disc[0], found.centres_px[:, 1] - disc[1]))))
        for disc in discs
    ]


@pytest.mark.parametrize("depth", [0.22, 0.25, 0.3])
def test_pale_droplets_that_stand_out_are_measured_and_alone(depth: float) -> None:
    discs = [(40.2, 40.0, 12.0), (110.0, 60.5, 20.0), (170.0, 110.2, 30.0), (60.0, 120.0, 16.0)]
    found = measure_flat(LIGHT - depth * (LIGHT - shadow(discs, blur_px=1.0)))
    assert len(found) == len(discs)
    assert not found.overlapping.any()
    for disc, nearest in matched(found, discs):
        assert found.diameters_px[nearest] == pytest.approx(disc[2], rel=0.02)


def test_what_is_known_of_the_light_is_used_and_brightness_means_nothing() -> None:
    light = LIGHT * (1 + 0.3 * np.sin(np.arange(SHAPE[1]) / 8.0)) * np.ones(SHAPE)
    discs = [(60.0, 60.0, 18.0), (150.0, 90.0, 25.0)]
    image = shadow(discs, 1.0, light=light)
    found = measure_flat(image, background=light)
    assert len(found) == 2
    assert sorted(found.diameters_px) == pytest.approx([18, 25], rel=0.02)
    brighter = measure_flat(7 * image, background=7 * light)
    np.testing.assert_allclose(brighter.diameters_px, found.diameters_px, rtol=1e-4)


def test_bright_particles_are_measured_likewise() -> None:
    discs = [(60.0, 60.0, 18.0), (150.0, 90.0, 25.0)]
    found = measure_flat(255 - shadow(discs, 1.0), FlatSettings(polarity="bright"))
    assert sorted(found.diameters_px) == pytest.approx([18, 25], rel=0.02)


def test_droplets_at_the_border_are_left_out_and_counted() -> None:
    found = measure_flat(shadow([(100.0, 80.0, 20.0), (4.0, 60.0, 20.0), (150.0, 155.0, 30.0)], 1.0))
    assert len(found) == 1
    assert found.left_out == {"border": 2}


def test_a_white_frame_is_no_light_and_its_edge_is_a_border() -> None:
    image = shadow([(100.0, 80.0, 20.0), (32.0, 60.0, 20.0)], 1.0)
    image[:, :30] = image[:, -25:] = image[:20] = image[-10:] = 255
    found = measure_flat(image)
    assert len(found) == 1
    assert found.left_out == {"border": 1}
    np.testing.assert_allclose(found.centres_px[0], (100, 80), atol=0.05)
    assert found.diameters_px[0] == pytest.approx(20, rel=0.01)


def test_a_ligament_is_not_round_and_two_droplets_that_overlap_are_flagged() -> None:
    ligament = [(x_px, 40.0 + 0.1 * x_px, 12.0) for x_px in np.arange(50.0, 130.0, 1.0)]
    found = measure_flat(shadow([*ligament, (60.0, 120.0, 24.0), (78.0, 120.0, 20.0), (160.0, 120.0, 20.0)], 0.7))
    assert found.left_out == {"not_round": 1}
    for (_, _, diameter_px), nearest in matched(found, [(60.0, 120.0, 24.0), (78.0, 120.0, 20.0)]):
        assert found.overlapping[nearest]
        assert found.diameters_px[nearest] == pytest.approx(diameter_px, rel=0.06)
    assert found.overlapping.tolist().count(False) == 1
    assert len(found) == 3


@pytest.mark.parametrize(("apart_px", "blur_px"), [(27.5, 0.8), (27.5, 2.0)])
def test_two_droplets_that_touch_are_both_told(apart_px: float, blur_px: float) -> None:
    """Neither was, nor were they left out, where the saddle between them lay a fifth below both: images were empty."""
    pair = [(80.0, 80.0, 30.0), (80.0 + apart_px, 80.0, 24.0)]
    found = measure_flat(noisy(seen(pair, blur_px=blur_px)))
    assert (len(found), found.left_out) == (2, {})
    assert found.overlapping.all()
    assert sorted(found.diameters_px) == pytest.approx([24, 30], rel=0.06)


@pytest.mark.parametrize(("x_px", "blur_px", "flagged"), [(132.0, 16.0, False), (140.0, 7.0, True)])
def test_a_sharp_droplet_is_sized_before_a_blurred_one_and_told_where_that_reaches_into_it(
    x_px: float, blur_px: float, flagged: bool
) -> None:
    front = (x_px, 84.0, 14.0)
    found = measure_flat(shadow([(110.0, 80.0, 34.0)], blur_px) * shadow([front], 0.7) / LIGHT)
    ((_, nearest),) = matched(found, [front])
    assert found.diameters_px[nearest] == pytest.approx(14, rel=0.05)
    assert found.overlapping[nearest] == flagged


def test_what_is_out_of_focus_or_too_small_is_counted_and_not_sized() -> None:
    found = measure_flat(shadow([(60.0, 60.0, 10.0)], 4.5), FlatSettings(least_depth=0.1))
    assert (len(found), found.left_out) == (0, {"unsharp": 1})
    found = measure_flat(shadow([(60.0, 60.0, 3.0)]))
    assert (len(found), found.left_out) == (0, {"small": 1})


@pytest.mark.parametrize("level", [60.0, 180.0, 254.0])
def test_an_image_without_droplets_has_none(level: float) -> None:
    noise = np.random.default_rng(0).normal(0, 2, SHAPE)
    assert len(measure_flat(np.full(SHAPE, level))) == 0
    assert len(measure_flat(level + noise)) == 0


def test_an_image_without_light_is_refused() -> None:
    noise = np.random.default_rng(0).normal(0, 2, SHAPE)
    for dark in (np.zeros(SHAPE), 3 + noise):
        with pytest.raises(LightError, match="is a lens covered, a light off"):
            measure_flat(dark)


def test_light_around_a_large_droplet_is_no_frame() -> None:
    found = measure_flat(shadow([(110.0, 80.0, 130.0), (20.0, 20.0, 16.0)], 1.0))
    assert sorted(found.diameters_px) == pytest.approx([16, 130], rel=0.02)


@pytest.mark.parametrize("polarity", ["shadow", "bright"])
def test_an_image_of_the_other_polarity_is_refused_instead_of_empty(polarity: Polarity) -> None:
    image = shadow([(60.0, 60.0, 18.0), (150.0, 90.0, 25.0)], 1.0, noise=0.01)
    other = "bright" if polarity == "shadow" else "shadow"
    with pytest.raises(BadInput, match=f"is the polarity another .--polarity {other}"):
        measure_flat(230 - image if polarity == "shadow" else image, FlatSettings(polarity=polarity))


def test_light_that_droplets_cover_is_refused_instead_of_empty() -> None:
    rng = np.random.default_rng(0)
    crowd = [(x, y, 20.0) for x, y in rng.uniform((0, 0), SHAPE[::-1], (110, 2))]
    with pytest.raises(BadInput, match=r"do droplets cover much of it \(--background IMAGE\)"):
        measure_flat(shadow(crowd, 1.0))
    with pytest.raises(BadInput, match="is the background of another light"):
        measure_flat(shadow([(60.0, 60.0, 18.0)]), background=np.full(SHAPE, LIGHT / 3))


def annotated() -> dict[str, NDArray[np.float64]]:
    """Column, row and diameter of the annotated droplets by image."""
    rows: dict[str, list[list[float]]] = defaultdict(list)
    with (folder() / "annotated_droplets.csv").open() as file:
        for row in csv.DictReader(file):
            rows[row["file"]].append([float(row[name]) for name in ("x_px", "y_px", "equiv_diameter_px")])
    return {name: np.array(values) for name, values in rows.items()}


def folder() -> Path:
    data = os.environ.get("TOMOSHADOW_DATA")
    if not data:
        pytest.skip("TOMOSHADOW_DATA does not say where the images of others are")
    return Path(data) / "shadowmaster_annotated_spray"


def overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Intersection over union of two circles."""
    r, s, distance = one[2] / 2, other[2] / 2, float(np.hypot(*(one[:2] - other[:2])))
    if distance >= r + s:
        return 0.0
    if distance <= abs(r - s):
        return float(min(r, s) ** 2 / max(r, s) ** 2)
    first = np.arccos((distance**2 + r**2 - s**2) / (2 * distance * r))
    second = np.arccos((distance**2 + s**2 - r**2) / (2 * distance * s))
    common = r**2 * (first - np.sin(2 * first) / 2) + s**2 * (second - np.sin(2 * second) / 2)
    return float(common / (np.pi * (r**2 + s**2) - common))


@pytest.mark.slow
def test_annotated_droplets_of_another_laboratory_are_found_and_sized() -> None:
    ratios, hits, blurs, depths, told = [], 0, [], [], []
    truth = dict(sorted(annotated().items())[::EVERY])
    for name, drawn in truth.items():
        image = cv2.imread(str(folder() / "train" / name), cv2.IMREAD_GRAYSCALE)
        assert image is not None
        found = measure_flat(image)
        circles = np.column_stack([found.centres_px, found.diameters_px])
        best = [max(range(len(circles)), key=lambda k, one=one: overlap(one, circles[k])) for one in drawn]  # type: ignore[misc]
        pairs = [(one, k) for one, k in zip(drawn, best, strict=True) if overlap(one, circles[k]) > 0.5]
        hits += len(pairs)
        ratios += [circles[k, 2] / one[2] for one, k in pairs]
        told += [k in {k for _, k in pairs} for k in range(len(found))]
        blurs += found.blur_px.tolist()
        depths += found.depths.tolist()
    assert hits / sum(map(len, truth.values())) >= 0.95
    assert 0.90 <= np.median(ratios) <= 1.05
    is_told, blur, deep = np.array(told), np.array(blurs), np.array(depths)
    as_good = (blur <= np.nanquantile(blur[is_told], 0.95)) & (deep >= np.quantile(deep[is_told], 0.05))
    assert is_told[as_good].mean() >= 0.6, "annotated share of what is as sharp and as dark as annotated droplets"


def test_an_image_of_no_numbers_has_not_no_droplets() -> None:
    image = np.full((60, 80), 200.0)
    image[5, 7] = np.nan
    with pytest.raises(ValueError, match=r"pixel \(column 7, row 5\) is nan"):
        measure_flat(image)


def exposed(light: float, shape: tuple[int, int] = (120, 160)) -> NDArray[np.float32]:
    """Two blurred discs and the noise of a camera of 8 bits."""
    row, column = np.mgrid[: shape[0], : shape[1]]
    dark = sum(1 / (1 + np.exp(np.hypot(row - v, column - u) - 9)) for u, v in ((50, 40), (110, 80)))
    grey = light * (1 - 0.95 * dark) + np.random.default_rng(1).normal(0, 1.5, shape)
    return np.asarray(np.clip(np.rint(grey), 0, 255), np.float32)


def test_an_overexposed_image_is_refused() -> None:
    """Its droplets would be too small, by a third where light is four times full scale."""
    assert measure_flat(exposed(200)).diameters_px == pytest.approx([18, 18], rel=0.05)
    with pytest.raises(LightError, match="% of the image are saturated"):
        measure_flat(exposed(600))


def test_a_background_of_other_bits_is_refused() -> None:
    background = np.full((120, 160), 16 * 200.0)
    with pytest.raises(LightError, match="has at most 6 % of the light of its background"):
        measure_flat(exposed(200), background=background)


def test_light_with_a_step_is_not_known() -> None:
    with pytest.raises(LightError, match="the light is not smooth"):
        measure_flat(np.hstack([exposed(200), exposed(100)]))


def lit(height: float, bits: int = 8) -> NDArray[np.float32]:
    """Three blurred discs on black, as high, clipped where a camera ends; some read noise."""
    row, column = np.mgrid[:120, :160]
    light = sum(1 / (1 + np.exp(np.hypot(row - v, column - u) - 9)) for u, v in ((30, 30), (80, 60), (120, 90)))
    grey = height * light + 8 + np.random.default_rng(2).normal(0, 1.5, row.shape)
    return np.asarray(np.clip(np.rint(grey), 0, 2**bits - 1), np.float32)


@pytest.mark.parametrize(("bits", "full", "unit"), [(8, 255, 1), (12, 4095, 1), (12, 4095, 16)])
def test_bright_particles_at_full_scale_are_not_measured(bits: int, full: float, unit: float) -> None:
    """Half of a height that is clipped lies too far out: at 1.5 times full scale they were 9 % larger."""
    bright = FlatSettings(polarity="bright")
    assert measure_flat(unit * lit(0.9 * full, bits), bright).diameters_px == pytest.approx([18, 18, 18], rel=0.02)
    over = measure_flat(unit * lit(1.5 * full, bits), bright)
    assert (len(over), over.left_out) == (0, {"saturated": 3})


@pytest.mark.parametrize("held", [0.35, 0.5])
def test_a_background_that_holds_droplets_is_refused(held: float) -> None:
    """As the mean of the image and an empty one: D10 was 2 to 4 % too small."""
    background = noisy(seen(spread_discs(), depth=held), 0.003, seed=1)
    with pytest.raises(LightError, match="% darker where droplets are"):
        measure_flat(noisy(seen(spread_discs())), background=background)


def test_dust_that_a_background_holds_is_its_own() -> None:
    dust = seen(spread_discs(0.5, aside_px=17.0, some=slice(17)), depth=0.5)
    found = measure_flat(noisy(seen(spread_discs()) * dust), background=noisy(dust, 0.003, seed=1))
    assert flat_doubts(found) == []
    assert len(found) == len(PLACES)
