"""``tomoshadow measure`` without a calibration: images and single views, in pixels or micrometres."""

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest

from daq.files.run_directory import DoubleFrame, ExposureRecord, ImageKey, RunHeader, RunWriter, Shot, ViewFormat
from processing.analysis.droplets.droplet_file import DropletFileError, read_droplets
from server.cli.main import main
from tests.support.command_line import refused, shown, told
from tests.support.droplet_run import write_run
from tests.support.flat_scenes import LIGHT, SHAPE, shadow

DISCS = [(60.0, 60.0, 18.0), (150.0, 90.0, 25.0)]


def grey(discs: list[tuple[float, float, float]], blur_px: float = 1.0) -> Any:
    return np.round(shadow(discs, blur_px)).astype(np.uint8)


@pytest.fixture
def images(tmp_path: Path) -> list[Path]:
    """Two images, one with a droplet at the border."""
    paths = [tmp_path / "first.png", tmp_path / "second.tif"]
    cv2.imwrite(str(paths[0]), grey(DISCS))
    cv2.imwrite(str(paths[1]), grey([(100.0, 80.0, 20.0), (3.0, 50.0, 20.0)]))
    return paths


def test_images_are_measured_in_pixels(images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = told(capsys, "measure", *images, "-o", tmp_path / "out")
    assert [(shot["image"], shot["droplets"], shot["verdict"]) for shot in result["shots"]] == [
        ("first", 2, "good"),
        ("second", 1, "good"),
    ]
    assert result["shots"][1]["left_out"] == {"border": 1}
    assert result["doubts"] == []
    stored = read_droplets(tmp_path / "out" / "first_droplets.h5")
    assert sorted(stored.columns["diameter_px"]) == pytest.approx([18, 25], rel=0.01)
    assert {name for name in stored.columns if name.endswith("_um")} == set()
    assert stored.columns["overlapping"].dtype == np.uint8
    assert stored.provenance["image"] == "first"
    assert stored.provenance["recipe_sha256"] == result["recipe_sha256"]
    said = [one["what"] for one in result["not_checked"]]
    expected = ("in proportion to light", "squeezed, or half covered", "too large for the spray")
    assert [[words in what for what in said].count(True) for words in expected] == [1, 1, 1]
    statistics = result["statistics"]
    assert (statistics["n"], statistics["d32_px"], statistics["relative_span"]) == (3, None, None)
    text = shown(capsys, "measure", *images, "-o", tmp_path / "again")
    assert "3 droplets in 2 images: too few droplets: means need 5" in text


def test_what_makes_bright_particles_too_large_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It was said of their amplitudes alone."""
    cv2.imwrite(str(tmp_path / "bright.png"), 190 - grey(DISCS))
    result = told(capsys, "measure", tmp_path / "bright.png", "-o", tmp_path / "out", "--polarity", "bright")
    said = " ".join(one["what"] for one in result["not_checked"])
    for words in ("discs of 14 px 6 % too large", "black was cut off", "at full scale", "a median of 9 px"):
        assert words in said


def test_dust_that_counts_in_every_image_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In real images of a spray half of what was measured as droplets was dust on a window."""
    dust = [(30.0, 30.0, 6.0), (190.0, 40.0, 8.0), (110.0, 130.0, 7.0)]
    for number, disc in enumerate([(60.0, 60.0, 18.0), (150.0, 90.0, 25.0)]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), grey([*dust, disc]))
    arguments = ["measure", tmp_path / "0.png", tmp_path / "1.png", "--um-per-px", 5]
    (doubt,) = told(capsys, *arguments, "-o", tmp_path / "out")["doubts"]
    assert doubt.startswith("0 and 1: 3 droplets are in both, in the same place: is it dust on a window?")
    assert doubt in shown(capsys, *arguments, "-o", tmp_path / "again")


def test_means_say_that_small_droplets_are_not_in_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    large = [(30.0 * (1 + number), 60.0, 16.0) for number in range(6)]
    image = tmp_path / "spray.png"
    cv2.imwrite(str(image), grey([*large, (60.0, 100.0, 3.0), (140.0, 100.0, 3.0)], 0.5))
    text = shown(capsys, "measure", image, "-o", tmp_path / "out")
    assert "means are of the larger droplets: 2 seen are smaller than least_diameter_px" in text
    cv2.imwrite(str(image), grey(large, 0.5))
    assert "means are of" not in shown(capsys, "measure", image, "-o", tmp_path / "large")


def test_an_image_of_which_most_is_not_measured_is_doubtful(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    image, small = tmp_path / "spray.png", [(40.0 + 30 * number, 100.0, 3.0) for number in range(3)]
    cv2.imwrite(str(image), grey([(60.0, 50.0, 16.0), (120.0, 50.0, 16.0), *small], 0.5))
    (shot,) = told(capsys, "measure", image, "-o", tmp_path / "out")["shots"]
    assert (shot["verdict"], shot["droplets"], shot["left_out"]) == ("doubtful", 2, {"small": 3})
    assert shot["reasons"] == ["2 of 5 shadows are measured (3 small): means are of those, not of the spray"]
    cv2.imwrite(str(image), grey(small, 0.5))
    (none,) = told(capsys, "measure", image, "-o", tmp_path / "none")["shots"]
    assert (none["verdict"], none["reasons"][0][:32]) == ("empty", "0 of 3 shadows are measured (3 s")


@pytest.mark.parametrize(("pairs", "crowded"), [(1, False), (4, True)])
def test_an_image_of_shadows_that_lie_over_one_another_is_doubtful(
    pairs: int, crowded: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sprays were measured as *good* where four of ten shadows overlapped, and D10 was 4 to 10 % too small."""
    alone = [(25.0 + 40 * k, 25.0 + 35 * row, 16.0) for k in range(5) for row in range(3)]
    beside = [(x + 13, y, diameter) for x, y, diameter in alone[:pairs]]
    cv2.imwrite(str(tmp_path / "spray.png"), grey([*alone, *beside]))
    result = told(capsys, "measure", tmp_path / "spray.png", "-o", tmp_path / "out")
    (shot,) = result["shots"]
    assert (shot["verdict"] == "doubtful") is crowded
    assert ["overlap others or are no discs" in what for what in shot["reasons"]] == [True] * crowded
    assert ["overlap others or are no discs" in what for what in result["doubts"]] == [True] * crowded


def test_images_of_which_each_has_few_rings_are_doubted_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bubbles of thin walls are told 6 to 16 % too large; two in an image are chance, four in two images are not."""
    alone = [(25.0 + 40 * k, 40.0, 16.0) for k in range(2)]
    hollow = grey([*alone, (110.0, 40.0, 13.0), (160.0, 100.0, 15.0)]) + LIGHT
    hollow = hollow - shadow([(110.0, 40.0, 10.0), (160.0, 100.0, 11.5)], 1.0)
    paths = [tmp_path / "one.png", tmp_path / "two.png"]
    cv2.imwrite(str(paths[0]), np.round(hollow).astype(np.uint8))
    cv2.imwrite(str(paths[1]), np.round(hollow[::-1, ::-1]).astype(np.uint8))
    result = told(capsys, "measure", *paths, "-o", tmp_path / "out")
    assert [shot["verdict"] for shot in result["shots"]] == ["good", "good"]
    (doubt,) = (what for what in result["doubts"] if "no blurred discs" in what)
    assert doubt.startswith("4 of 8 droplets, limit 10 %, are no blurred discs")


def test_means_know_that_the_border_cuts_large_droplets_more_often(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two of 60 px are whole and two are cut; without weights D10 was a ninth too small."""
    cuts = [(x, y, 60.0) for x, y in ((5.0, 40.0), (105.0, 155.0))]
    small = [(20.0 + 30 * k, 90.0 if k < 3 else 40.0, 10.0) for k in (0, 1, 4, 5, 6)]
    cv2.imwrite(str(tmp_path / "a.png"), grey([*cuts, (80.0, 45.0, 60.0), (175.0, 100.0, 60.0), *small]))
    statistics = told(capsys, "measure", tmp_path / "a.png", "-o", tmp_path / "out")["statistics"]
    weights = 1 / np.array([(1 - d / SHAPE[0]) * (1 - d / SHAPE[1]) for d in (60, 10)]) * (2, 5)
    assert statistics["n"] == 7
    assert statistics["d10_px"]["value"] == pytest.approx(weights @ (60, 10) / weights.sum(), rel=0.01)


def test_images_of_two_sizes_have_no_common_scale(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A camera that bins, or another one: pixels of the two are hardly as wide in the spray."""
    images = [tmp_path / "one.png", tmp_path / "two.png", tmp_path / "three.png"]
    for image, discs, part in zip(images, (DISCS, DISCS[:1], DISCS), (SHAPE[1], SHAPE[1], 200), strict=True):
        cv2.imwrite(str(image), grey(discs)[:, :part])
    assert told(capsys, "measure", *images[:2], "-o", tmp_path / "alike")["doubts"] == []
    (doubt,) = told(capsys, "measure", *images, "-o", tmp_path / "out", "--um-per-px", 5)["doubts"]
    assert doubt.startswith("images have 2 sizes (one: 220 x 160 px, three: 200 x 160 px): are they of one camera")


def test_droplets_of_images_are_no_spray(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told(capsys, "measure", *images, "-o", tmp_path / "out")
    assert "has droplets of images, in 2-D" in refused(capsys, "statistics", tmp_path / "out")


def test_diameters_that_were_edited_are_refused(images: list[Path], tmp_path: Path) -> None:
    file = tmp_path / "out" / "first_droplets.h5"
    assert main(["measure", *map(str, images), "-o", str(file.parent)]) == 0
    assert len(read_droplets(file).columns["diameter_px"]) == 2
    with h5py.File(file, "r+") as stored:
        stored["droplets/diameter_px"][:] *= 2
    with pytest.raises(DropletFileError, match="was changed after it had been measured"):
        read_droplets(file)


def test_a_scale_turns_pixels_into_micrometres(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["measure", images[0], "-o", tmp_path / "out", "--um-per-px", "4", "--export", "csv"]
    told(capsys, *arguments)
    path = tmp_path / "out" / "first_droplets.h5"
    columns = read_droplets(path).columns
    assert sorted(columns["diameter_um"]) == pytest.approx([72, 100], rel=0.01)
    assert sorted(columns["x_um"]) == pytest.approx([240, 600], rel=0.01)
    assert not [name for name in columns if name.endswith("_px")]
    with h5py.File(path) as file:
        assert file["droplets/blur_um"].attrs["units"] == "um"
    others = [tmp_path / f"other{number}.png" for number in range(3)]
    for number, path in enumerate(others):
        cv2.imwrite(str(path), grey(DISCS, 1 + 0.05 * number))
    more = told(capsys, "measure", *others, "-o", tmp_path / "more", "--um-per-px", "4")["statistics"]
    assert (more["d10_um"]["value"], more["intervals_over"]) == (pytest.approx(86, rel=0.01), "shots")
    head, first, *_ = (tmp_path / "out" / "first_droplets.csv").read_text().splitlines()
    assert head.startswith("image,frame,x_um,y_um,diameter_um")
    assert first.startswith("first,a,")


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "1e300", "1e-300", "0.0164"])
def test_a_scale_that_no_camera_has_is_refused(
    scale: str, images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["measure", str(images[0]), "-o", str(tmp_path / "out"), "--um-per-px", scale])
    assert f"--um-per-px: {scale} must be" in capsys.readouterr().err


def write_single(run_dir: Path, **told_of_it: Any) -> Path:
    """A run of one view, dark image and background known, two exposures."""
    header = RunHeader(
        run_id=run_dir.name,
        created_utc="2026-01-01T00:00:00+00:00",
        views={"side": ViewFormat(SHAPE, 8)},
        separation_ns=6400,
        **told_of_it,
    )
    seen = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    shot = Shot(0, ImageKey.SAMPLE, {"side": DoubleFrame(grey(DISCS), grey(DISCS[:1]), seen, seen)})
    with RunWriter(run_dir, header) as writer:
        writer.write_shot(shot)
        writer.finish("completed")
    return run_dir


@pytest.mark.parametrize("command", ["statistics", "report", "tracks", "separation"])
def test_droplets_of_a_view_of_a_run_are_no_spray(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their files are named as those of shots are."""
    told(capsys, "measure", write_single(tmp_path / "single"), "-o", tmp_path / "out")
    goes_to = ["-o", tmp_path / "made"] if command in ("report", "tracks") else []
    assert "has droplets of images, in 2-D" in refused(capsys, command, tmp_path / "out", *goes_to)


def test_a_run_of_one_view_is_measured_exposure_by_exposure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = told(capsys, "measure", write_single(tmp_path / "single"), "-o", tmp_path / "out")
    (shot,) = result["shots"]
    assert (shot["shot"], shot["droplets"], shot["file"]) == (0, 3, "shot_00000_droplets.h5")
    stored = read_droplets(tmp_path / "out" / shot["file"])
    assert stored.columns["frame"].tolist() == ["a", "a", "b"]
    assert (stored.provenance["run"], stored.provenance["view"]) == ("single", "side")


def test_saturated_light_is_refused_whatever_dark_image_was_taken_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a dark image no pixel is at the end of a scale any more, and droplets were told too small."""
    header = RunHeader(run_id="lit", created_utc="2026-01-01T00:00:00+00:00", views={"side": ViewFormat(SHAPE, 8)})
    lit = np.clip(1.6 * grey(DISCS).astype(float), 0, 255).astype(np.uint8)
    dark = np.random.default_rng(0).integers(3, 9, (2, *SHAPE)).astype(np.float32)
    seen = ExposureRecord(valid=True, frame_id=1, device_timestamp_ns=1)
    with RunWriter(tmp_path / "lit", header) as writer:
        writer.write_references({"side": dark}, {})
        writer.write_shot(Shot(0, ImageKey.SAMPLE, {"side": DoubleFrame(lit, lit, seen, seen)}))
        writer.finish("completed")
    shot, *_ = told(capsys, "measure", tmp_path / "lit", "-o", tmp_path / "out", status=1)["shots"]
    assert shot["verdict"] == "refused"
    assert "% of the image are saturated" in shot["reasons"][0]


@pytest.mark.parametrize(("stated", "doubted"), [(4.0, False), (4.3, False), (8.0, True), (3.5, True)])
def test_a_scale_that_is_not_that_of_the_rig_is_doubted(
    stated: float, doubted: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = {"views": {"side": {"lens": {"magnification": 2.0}, "sensor": {"pixel_pitch_um": 8.0}}}}
    run_dir = write_single(tmp_path / "single", configuration=rig)
    result = told(capsys, "measure", run_dir, "-o", tmp_path / "out", "--um-per-px", stated)
    assert [f"stated to be {stated:g} um" in doubt and "4 um of it" in doubt for doubt in result["doubts"]] == (
        [True] * doubted
    )
    assert not [one for one in result["not_checked"] if "um wide" in one["what"]]


def test_a_scale_that_nothing_contradicts_is_not_checked(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = told(capsys, "measure", images[0], "-o", tmp_path / "out", "--um-per-px", "8.3")
    (one,) = [one for one in result["not_checked"] if "um wide" in one["what"]]
    assert one["what"].startswith("whether a pixel is 8.3 um wide in the spray, as was stated")


def test_one_of_several_views_must_be_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_dir = write_run(tmp_path / "run")
    arguments = ["measure", run_dir, "-o", tmp_path / "out"]
    assert "has views view1, view2, view3: --calibration says where they are" in refused(capsys, *arguments)
    assert "has no view 'left', it has view1" in refused(capsys, *arguments, "--view", "left")
    assert told(capsys, *arguments, "--view", "view2")["passed"]


def test_what_makes_no_sense_is_refused_before_anything_is_written(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_dir = write_run(tmp_path / "run")
    out = ["-o", tmp_path / "out"]
    for arguments, text in (
        (["measure", images[0], *out, "--shots", "5:9"], "--shots: is for runs"),
        (["measure", images[0], *out, "--view", "left"], "--view: is for runs"),
        (["measure", images[0], *out, "--export", "csv,vtk"], "no place in space"),
        (["measure", *images, run_dir, *out], "images and runs are not measured at once"),
        (["measure", *images, *out, "--grid=0:1,0:1,0:1"], "--grid: needs --calibration"),
        (["measure", *images, *out, "--light", "0.8"], "--light: needs --calibration"),
        (["measure", images[0], images[0], *out], "two images are called first"),
        (["measure", tmp_path / "none.png", *out], "none.png"),
        (["measure", images[0], *out, "--background", images[1].with_name("none.tif")], "none.tif"),
        (["measure", run_dir, *out, "--view", "view1", "--background", images[0]], "--background: is for images"),
        (["measure", run_dir, *out, "--view", "view1", "--polarity", "bright"], "not measured as bright"),
        (["measure", run_dir, *out, "--calibration", "c.json", "--um-per-px", "3"], "--um-per-px: is for droplets"),
    ):
        assert text in refused(capsys, *arguments)
        assert not (tmp_path / "out").exists()


def test_an_image_that_cannot_be_read_stops_no_other(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "torn.png").write_bytes(images[0].read_bytes()[:99])
    result = told(capsys, "measure", tmp_path / "torn.png", images[0], "-o", tmp_path / "out")
    assert [(shot["verdict"], shot["droplets"]) for shot in result["shots"]] == [("refused", 0), ("good", 2)]
    assert "torn.png" in result["shots"][0]["reasons"][0]


def test_a_dark_image_is_refused_by_itself(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "dark.png"), np.zeros(SHAPE, np.uint8))
    result = told(capsys, "measure", images[0], tmp_path / "dark.png", "-o", tmp_path / "out")
    assert [shot["verdict"] for shot in result["shots"]] == ["good", "refused"]
    assert "is a lens covered" in result["shots"][1]["reasons"][0]
    assert main(["measure", str(tmp_path / "dark.png"), "-o", str(tmp_path / "other"), "--json"]) == 1
    alone = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (alone["statistics"]["d32_px"], alone["statistics"]["reason"]) == (None, "no droplet was measured")


def test_images_of_another_background_do_not_join_a_directory(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "light.png"), np.full(SHAPE, 180, np.uint8))
    told(capsys, "measure", images[0], "-o", tmp_path / "out", "--background", tmp_path / "light.png")
    error = refused(capsys, "measure", images[1], "-o", tmp_path / "out")
    assert "holds results of another run, calibration or settings" in error
    stored = read_droplets(tmp_path / "out" / "first_droplets.h5")
    assert stored.provenance["background"] == "light.png"


def test_what_is_refused_leaves_no_recipe(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["measure", images[0], "-o", tmp_path / "out"]
    told(capsys, *arguments)
    recipe = tmp_path / "recipe.toml"
    assert "first_droplets.h5: exists" in refused(capsys, *arguments, "--write-recipe", recipe)
    assert not recipe.exists()
    told(capsys, *arguments[:3], tmp_path / "other", "--write-recipe", recipe)
    assert recipe.exists()


def test_a_recipe_says_how(images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "recipe.toml"
    first = told(capsys, "measure", images[0], "-o", tmp_path / "one", "--write-recipe", recipe)
    assert "least_circularity = 0.8" in recipe.read_text()
    recipe.write_text(recipe.read_text().replace("least_diameter_px = 4.0", "least_diameter_px = 20.0"))
    second = told(capsys, "measure", images[0], "-o", tmp_path / "two", "--recipe", recipe)
    assert (first["statistics"]["n"], second["statistics"]["n"]) == (2, 1)
    assert second["shots"][0]["left_out"] == {"small": 1}
    assert first["recipe_sha256"] != second["recipe_sha256"]


def test_a_copy_of_an_image_does_not_count_twice(
    images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = shutil.copy(images[0], tmp_path / "copy.png")
    message = refused(capsys, "measure", *images, copy, "-o", tmp_path / "out")
    assert message == f"{copy}: the same image as first.png; its droplets would count twice"


@pytest.mark.parametrize(
    ("background", "reason"),
    [(grey(DISCS), "is its own background"), (np.full(SHAPE, 255, np.uint8), "has a background of which 100 % are")],
)
def test_a_background_that_tells_nothing_is_refused(
    background: Any, reason: str, images: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "light.png"), background)
    arguments = ["measure", images[0], "--background", tmp_path / "light.png", "-o", tmp_path / "out"]
    (shot,) = told(capsys, *arguments, status=1)["shots"]
    assert (shot["verdict"], shot["droplets"]) == ("refused", 0)
    assert shot["reasons"][0].startswith(reason)


def spray(seed: int, blur_px: float, diameter_px: float = 14.0) -> Any:
    """Discs in rows, of sizes as a spray has them, that do not touch; and the mean of their diameters."""
    rng = np.random.default_rng(seed)
    sizes = np.clip(rng.lognormal(np.log(diameter_px), 0.35, 20), 7, 26)
    aside = rng.uniform(-4, 4, (20, 2))
    places = [(24.0 + 42 * (k % 5) + aside[k, 0], 24.0 + 37 * (k // 5) + aside[k, 1]) for k in range(20)]
    discs = [(x, y, float(size)) for (x, y), size in zip(places, sizes, strict=True)]
    return np.round(shadow(discs, blur_px, noise=0.005)).astype(np.uint8), float(sizes.mean())


@pytest.mark.parametrize(("blur_px", "doubtful"), [(1.0, False), (3.5, True)])
def test_means_of_what_is_sharp_enough_are_doubted_where_small_ones_are_not(
    blur_px: float, doubtful: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Behind a blur of 3.5 px a fifth to a third was left out, the smallest ones; D10 was 12 % too large, and good."""
    drawn = [spray(seed, blur_px) for seed in range(3)]
    paths = [tmp_path / f"{number}.png" for number in range(3)]
    for path, (image, _) in zip(paths, drawn, strict=True):
        cv2.imwrite(str(path), image)
    result = told(capsys, "measure", *paths, "-o", tmp_path / "out")
    error = result["statistics"]["d10_px"]["value"] / np.mean([mean for _, mean in drawn]) - 1
    assert bool(error > 0.05) is doubtful
    assert any("too large for what is seen" in doubt for doubt in result["doubts"]) is doubtful
    assert any(shot["verdict"] == "doubtful" for shot in result["shots"]) is doubtful


def test_light_that_piles_up_below_full_scale_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A camera that is full at 230: where its light would be a third more, D10 was 5 % too small, and good."""
    rng = np.random.default_rng(1)
    light = shadow(DISCS, 1.5) * 1.7 + rng.normal(0, 3, SHAPE)
    cv2.imwrite(str(tmp_path / "full.png"), np.clip(np.rint(light), 0, 230).astype(np.uint8))
    cv2.imwrite(str(tmp_path / "whole.png"), np.clip(np.rint(light / 1.5), 0, 230).astype(np.uint8))
    full, whole = told(capsys, "measure", tmp_path / "full.png", tmp_path / "whole.png", "-o", tmp_path / "out")[
        "shots"
    ]
    assert [one["verdict"] for one in (full, whole)] == ["refused", "good"]
    assert "of the image are saturated" in full["reasons"][0]


def test_an_image_of_two_grey_values_says_who_has_set_the_sizes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Somebody's threshold: of discs of 14 px behind a blur of 2 px one of three quarters made D10 17 % too large."""
    discs = [(30.0 + 45 * k, 40.0 + 40 * row, 14.0) for k in range(4) for row in range(3)]
    sharp = shadow(discs, 2.0)
    cv2.imwrite(str(tmp_path / "cut.png"), np.where(sharp > 0.75 * LIGHT, 200, 0).astype(np.uint8))
    cv2.imwrite(str(tmp_path / "whole.png"), np.round(sharp).astype(np.uint8))
    shot, whole = told(capsys, "measure", tmp_path / "cut.png", tmp_path / "whole.png", "-o", tmp_path / "out")["shots"]
    assert [one["verdict"] for one in (shot, whole)] == ["refused", "good"]
    assert shot["reasons"][0].startswith("has 2 grey values: whoever set the threshold")
