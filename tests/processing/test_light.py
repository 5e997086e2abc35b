"""Exposures whose light does not fit what the run states of them."""

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from processing.imprint import imprint
from processing.interlaced import rows_alternate
from processing.light import hollowed, light_share, odd_light
from processing.preprocessing import Polarity, Preprocessing, intensity

Grey = NDArray[np.float64]
ROWS, COLUMNS = np.mgrid[:96, :128]
LIGHT: Grey = 180.0 - 0.006 * ((ROWS - 48.0) ** 2 + (COLUMNS - 64.0) ** 2)


def droplets(seed: int) -> Grey:
    """Share of light that is missing."""
    random = np.random.default_rng(seed)
    missing = np.zeros(LIGHT.shape)
    for v, u in random.uniform(5, (91, 123), (40, 2)):
        missing = np.maximum(missing, 0.9 * np.exp(-((ROWS - v) ** 2 + (COLUMNS - u) ** 2) / 8))
    return missing


def grey(light: Grey) -> NDArray[np.uint8]:
    noise = np.random.default_rng(9).normal(0, 2, light.shape)
    return np.clip(np.round(light + noise), 0, 255).astype(np.uint8)


def told(shot: Grey, background: Grey | None, polarity: Polarity = "shadow", dark: Grey | None = None) -> str:
    seen_dark, seen_light = (None if one is None else grey(one).astype(np.float32) for one in (dark, background))
    return odd_light(grey(shot), polarity, bits=8, dark=seen_dark, background=seen_light)


SHOT = LIGHT * (1 - droplets(1))


@pytest.mark.parametrize("gain", [0.9, 1.0, 1.1], ids=lambda gain: f"light of {gain:g}")
def test_shadows_before_their_own_light_are_fine(gain: float) -> None:
    assert told(gain * SHOT, LIGHT, dark=0 * LIGHT + 3) == ""
    assert told(SHOT, None) == ""


def test_a_shot_before_itself_is_odd() -> None:
    assert told(SHOT, SHOT).startswith("is its own background")


LEANING: Grey = LIGHT * (1 + 0.1 * (COLUMNS - 64) / 64 - 0.05 * (ROWS - 48) / 48)


@pytest.mark.parametrize(
    ("background", "better"),
    [
        (LEANING[::-1, ::-1], "the same one turned by half"),
        (LEANING[:, ::-1], "the same one with left and right exchanged"),
        ((LEANING - 0.1 * (ROWS - 48))[::-1], "the same one upside down"),
    ],
)
def test_a_background_that_is_turned_is_told(background: Grey, better: str) -> None:
    shot = background[::-1, ::-1] if "half" in better else background[:, ::-1] if "left" in better else background[::-1]
    assert told(shot * (1 - droplets(1)), background) == (
        f"does not fit its background, but {better}: is that exchanged, or turned?"
    )


def test_a_background_of_another_view_is_told() -> None:
    backgrounds = {f"that of view{n}": grey(light).astype(np.float32) for n, light in ((1, LEANING), (2, LIGHT))}
    shot = grey(LEANING * (1 - droplets(1)))
    assert odd_light(shot, "shadow", bits=8, background=backgrounds["that of view1"], others=backgrounds) == ""
    wrong = odd_light(shot, "shadow", bits=8, background=backgrounds["that of view2"], others=backgrounds)
    assert wrong.startswith("does not fit its background, but that of view1")


@pytest.mark.parametrize("missing", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("flicker", [0.95, 1.05])
def test_a_cloud_at_one_side_is_no_other_background(missing: float, flicker: float) -> None:
    cloud = missing / (1 + np.exp((64 - COLUMNS) / 12)) * (1 - 0.3 * ROWS / 96)
    for light in (LIGHT, LEANING, LEANING[:, ::-1]):
        assert "does not fit" not in told(flicker * light * (1 - cloud) * (1 - droplets(1)), light)


def mean_of(*light: Grey) -> Grey:
    """Each with noise of its own."""
    noise = np.random.default_rng(5)
    return np.asarray(np.mean([one + noise.normal(0, 2, one.shape) for one in light], axis=0))


def of_itself(backgrounds: Grey) -> str:
    """What is said of the shot before this mean, which has no further noise."""
    return odd_light(grey(SHOT), "shadow", bits=8, background=backgrounds.astype(np.float32))


@pytest.mark.parametrize("count", [2, 4, 10])
def test_a_shot_among_its_own_backgrounds_is_odd(count: int) -> None:
    told_share = re.match(r"has (\d+) % of its own shadows", of_itself(mean_of(SHOT, *[LIGHT] * (count - 1))))
    assert told_share
    assert int(told_share[1]) > 80 / count


def test_the_mean_of_a_series_as_background_is_odd_and_that_of_other_shots_is_not() -> None:
    others = [LIGHT * (1 - droplets(seed)) for seed in range(2, 10)]
    assert re.match(r"has \d+ % of its own shadows in its background", of_itself(mean_of(SHOT, *others)))
    assert "of its own shadows" not in of_itself(mean_of(*others))


@pytest.mark.parametrize(("share", "told"), [(0.0, False), (0.02, False), (0.06, True)])
def test_a_quick_look_at_many_shadows_misses_none_in_the_background(share: float, told: bool) -> None:
    light, missing = (np.tile(one, (5, 5)) for one in (LIGHT, droplets(1)))
    background = (light * (1 - share * missing)).astype(np.float32)
    found = imprint(grey(light * (1 - missing)), background)
    assert found == pytest.approx(share, abs=0.01) if told else found == 0


@pytest.mark.parametrize("shift_px", [0, 1, 3])
def test_a_nozzle_that_shakes_is_no_shadow_of_the_shot(shift_px: int) -> None:
    def nozzle(down_px: int) -> Grey:
        edge = 1 / (1 + np.exp(-(ROWS - 40.0 - down_px) / 1.5))
        return np.where(np.abs(COLUMNS - 64) < 20, edge, 1.0)

    shot = odd_light(
        grey(SHOT * nozzle(shift_px)), "shadow", bits=8, background=mean_of(LIGHT * nozzle(0)).astype("f4")
    )
    assert "of its own shadows" not in shot


def test_light_that_the_camera_cannot_tell_is_odd() -> None:
    assert re.fullmatch(
        r"has a background of which \d+ % are saturated: shadows are too pale there", told(1.6 * SHOT, 1.6 * LIGHT)
    )
    assert told(1.6 * SHOT, 1.6 * LIGHT, dark=0 * LIGHT + 8).startswith("has a background of which")


def lit(level: float, seed: int, frames: int = 1, full: float = 1.0, fall: float = 0.0) -> NDArray[np.float64]:
    """Grey values of 12 bits of even light with 1 % of noise, by a camera that is full at a share of its full scale."""
    rng = np.random.default_rng(seed)
    light = level * (1 - fall * COLUMNS / COLUMNS.max())
    seen = [np.minimum(light + rng.normal(0, 0.01, light.shape), full) for _ in range(frames)]
    return np.asarray(np.mean(np.rint(4095 * np.clip(seen, 0, 1)), axis=0))


def told_lit(level: float, seed: int, full: float = 1.0, fall: float = 0.0) -> str:
    shot = lit(level, seed, full=full, fall=fall) * (1 - droplets(seed))
    background = lit(level, seed + 100, frames=8, full=full, fall=fall).astype(np.float32)
    return odd_light(np.rint(shot).astype(np.uint16), "shadow", bits=12, background=background)


@pytest.mark.parametrize("full", [0.85, 0.97, 0.995])
@pytest.mark.parametrize("level", [1.05, 1.3])
def test_a_camera_that_is_full_below_its_full_scale_is_told(level: float, full: float) -> None:
    """Its shadows are too pale: voxels by four views have 0.04 to 0.7 of their values."""
    assert "saturated" in told_lit(level, 1, full=full)


def test_a_background_near_saturation_is_told() -> None:
    """Mean of noise that is cut at full scale: of many pixels here and there nothing is known."""
    assert "of its pixels, here and there, of which nothing is known" in told_lit(0.978, 1)


@pytest.mark.parametrize("fall", [0.0, 0.3])
@pytest.mark.parametrize("level", [0.3, 0.8, 0.94])
def test_bright_light_that_the_camera_can_tell_is_fine(level: float, fall: float) -> None:
    assert [told for seed in range(10) if (told := told_lit(level, seed, fall=fall))] == []


def test_bright_particles_on_black_are_fine() -> None:
    assert told(5 + 200 * droplets(1), None, "bright") == ""
    assert told(5 + 0 * LIGHT, None, "bright") == ""


def test_half_a_view_of_liquid_is_fine() -> None:
    assert told(np.where(COLUMNS < 64, 0.1, 1.0) * LIGHT, LIGHT) == ""


@pytest.mark.parametrize(
    ("shot", "background", "polarity", "words"),
    [
        pytest.param(SHOT, None, "bright", 'is it "shadow"', id="shadows said to be bright"),
        pytest.param(SHOT, LIGHT, "bright", 'is it "shadow"', id="shadows said to be bright, with a background"),
        pytest.param(255 - SHOT, 255 - LIGHT, "shadow", 'polarity = "bright"', id="inverted"),
        pytest.param(SHOT, LIGHT * (1 - droplets(2)), "shadow", "spray in the background", id="a shot as background"),
        pytest.param(SHOT, 0.6 * LIGHT, "shadow", "with less light", id="background with less light"),
        pytest.param(0.5 * SHOT, LIGHT, "shadow", "at most 5[0-9] % of the light", id="background with more light"),
        pytest.param(SHOT, 0 * LIGHT, "shadow", "background without light", id="background without light"),
    ],
)
def test_what_does_not_fit_is_told(shot: Grey, background: Grey | None, polarity: Polarity, words: str) -> None:
    assert re.search(words, told(shot, background, polarity))


@pytest.mark.parametrize("polarity", ["shadow", "bright"])
def test_a_dark_image_that_is_brighter_than_the_shot_is_told(polarity: Polarity) -> None:
    shot = SHOT if polarity == "shadow" else 5 + 200 * droplets(1)
    assert told(shot, LIGHT, polarity, dark=0 * LIGHT + 100).startswith("is darker than its dark image")


@pytest.mark.parametrize("background", [None, 0.8 * LIGHT])
def test_an_overexposed_shot_is_odd_whatever_its_background(background: Grey | None) -> None:
    assert re.match(r"is saturated in \d+ % of its pixels|is brighter than its background", told(2 * SHOT, background))


def test_bright_particles_that_fill_the_camera_are_odd() -> None:
    assert re.match(r"is saturated in \d+ % of its pixels", told(5 + 900 * droplets(1), None, "bright"))


@pytest.mark.parametrize(("missing", "words"), [(ROWS > 70, "has 25 rows"), (COLUMNS == 5, "has 1 columns")])
def test_a_part_of_an_image_that_is_missing_is_no_liquid(missing: NDArray[np.bool_], words: str) -> None:
    frame = np.where(missing, 0, grey(SHOT)).astype(np.uint8)
    assert odd_light(frame, "shadow", bits=8, background=LIGHT.astype(np.float32)).startswith(words)


@pytest.mark.parametrize(("window_px", "hollow"), [(3, True), (9, True), (41, False), (0, False)])
def test_a_window_that_is_narrower_than_what_is_dense_is_told(window_px: int, hollow: bool) -> None:
    """A black disc of 24 px: the least value around its middle is black, too."""
    disc = 0.95 * (np.hypot(ROWS - 40, COLUMNS - 70) < 12)
    frame, background = grey(LIGHT * (1 - disc)), grey(LIGHT).astype(np.float32)
    image = intensity(frame, Preprocessing("shadow", window_px), bits=8, background=background)
    told_of_it = hollowed(frame, image, "shadow", bits=8, background=background)
    assert told_of_it.startswith("loses ") == hollow
    assert bool(told_of_it) == hollow


@pytest.mark.parametrize(("light", "window_px", "hollow"), [(0.8, 41, False), (0.8, 9, True), (1.1, 41, False)])
def test_light_that_is_missing_everywhere_is_not_lost_to_a_window(light: float, window_px: int, hollow: bool) -> None:
    disc = 0.7 * (np.hypot(ROWS - 40, COLUMNS - 70) < 12)
    frame, background = grey(light * LIGHT * (1 - disc)), grey(LIGHT).astype(np.float32)
    image = intensity(frame, Preprocessing("shadow", window_px), bits=8, background=background)
    assert bool(hollowed(frame, image, "shadow", bits=8, background=background)) == hollow


@pytest.mark.parametrize("light", [0.7, 0.85, 1.0, 1.1])
@pytest.mark.parametrize("spray", ["droplets", "a veil over a third"])
def test_the_share_of_light_is_that_beside_the_spray(light: float, spray: str) -> None:
    missing = droplets(1) if spray == "droplets" else 0.4 * (COLUMNS < 43)
    frame, background = grey(light * LIGHT * (1 - missing)), grey(LIGHT).astype(np.float32)
    assert light_share(frame, background, bits=8) == pytest.approx(light, abs=0.01)


def test_what_is_black_all_over_tells_no_share_of_light() -> None:
    assert np.isnan(light_share(grey(0 * LIGHT), grey(LIGHT).astype(np.float32), bits=8))


@pytest.mark.parametrize(("window_px", "hollow"), [(3, True), (41, False)])
def test_bright_particles_can_be_hollow_too(window_px: int, hollow: bool) -> None:
    frame = grey(12 + 200.0 * (np.hypot(ROWS - 40, COLUMNS - 70) < 12))
    image = intensity(frame, Preprocessing("bright", window_px), bits=8)
    assert bool(hollowed(frame, image, "bright", bits=8)) == hollow


def woven(first: Grey, second: Grey) -> Grey:
    """The even rows of one, the odd rows of the other."""
    return np.where(ROWS % 2, second, first)


@pytest.mark.parametrize("polarity", ["shadow", "bright"])
def test_two_fields_of_video_are_told(polarity: Polarity) -> None:
    seen = [180 * one if polarity == "bright" else LIGHT * (1 - one) for one in (droplets(1), droplets(2))]
    background = LIGHT if polarity == "shadow" else None
    assert told(woven(*seen), background, polarity).startswith("has rows that alternate: are these two fields of video")


@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_rows_that_differ_everywhere_are_those_of_a_camera(gain: float) -> None:
    uneven = np.where(ROWS % 2, gain, 1.0)
    assert told(uneven * SHOT, uneven * LIGHT) == ""
    assert told(SHOT[:, ::-1].T.copy(), LIGHT[:, ::-1].T.copy()) == ""


@pytest.mark.parametrize("brightest", [200, 3000])
def test_bright_droplets_on_black_do_not_alternate(brightest: float) -> None:
    """Half of the noise is below black: what is left of it has no share of rows that alternate to speak of."""
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(0, brightest / 100, LIGHT.shape)
        seen = np.clip(np.round(brightest * droplets(seed) + noise), 0, None)
        assert not rows_alternate(seen.astype(np.uint16)), seed


def test_nothing_at_all_does_not_alternate() -> None:
    for level in (0.0, 0.1, 77.7):
        assert not rows_alternate(np.full((96, 128), level, np.float32))
        assert not rows_alternate(np.full((96, 128), level, np.uint8))
    assert not rows_alternate(np.zeros((3, 128), np.uint8))
