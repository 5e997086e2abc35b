"""``tomoshadow import`` of whole measuring days: depths of grey values, patterns, stacks, pairs in one image."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from daq.files.run_directory import RunReader
from processing.calibration.sets.calibration_set import load_calibration_set
from processing.image_file import read_image
from processing.reconstruction.volume_file import read_volume
from processing.synthetic.paper_rig import paper_cameras, paper_optics
from processing.synthetic.target import Checkerboard, render_target
from tests.support.command_line import GRID, refused, told
from tests.support.droplet_run import write_calibration
from tests.support.particle_images import write_particles

VIEWS = ("left", "right")
Capture = pytest.CaptureFixture[str]


def write_manifest(folder: Path, run: str) -> Path:
    (folder / "manifest.toml").write_text(f'[run]\npolarity = "bright"\n{run}')
    return folder / "manifest.toml"


def image(view: str, shot: int, frame: str = "a") -> NDArray[np.uint8]:
    """An image that no other view, shot or exposure has."""
    value = 10 * shot + 2 * VIEWS.index(view) + "ab".index(frame)
    return np.add.outer(np.arange(4), np.arange(6) + value).astype(np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Pairs ``VIEW/im0003_a.png`` of shots 3 to 7."""
    for view in VIEWS:
        (tmp_path / view).mkdir()
        for shot in range(3, 8):
            for frame in "ab":
                cv2.imwrite(str(tmp_path / view / f"im{shot:04d}_{frame}.png"), image(view, shot, frame))
    return tmp_path


def kept(run_dir: Path) -> list[dict[str, list[NDArray[np.generic]]]]:
    """Every exposure by shot and view."""
    with RunReader(run_dir) as run:
        shots = [run.read_shot(index) for index in range(run.shot_count)]
    return [
        {
            view: [frame for frame in (frames.frame_a, frames.frame_b) if frame is not None]
            for view, frames in shot.views.items()
        }
        for shot in shots
    ]


def assert_pairs(run_dir: Path, shots: list[int]) -> None:
    """The run holds these shots, A and B, and each camera's own."""
    found = kept(run_dir)
    assert len(found) == len(shots)
    for exposures, shot in zip(found, shots, strict=True):
        assert list(exposures) == list(VIEWS)
        for view, frames in exposures.items():
            np.testing.assert_array_equal(frames, [image(view, shot, frame) for frame in "ab"])


PAIRS = '[[run.shots]]\nframe_a = "{view}/im{shot:04d}_a.png"\nframe_b = "{view}/im{shot:04d}_b.png"\n'


def test_a_pattern_stands_for_every_shot_that_is_there(folder: Path, capsys: Capture) -> None:
    result = told(capsys, "import", write_manifest(folder, PAIRS), "-o", folder / "out")
    assert (result["cameras"], result["shots"]) == (list(VIEWS), 5)
    assert_pairs(folder / "out" / "run", [3, 4, 5, 6, 7])


def test_the_first_and_the_last_number_are_both_taken(folder: Path, capsys: Capture) -> None:
    told(capsys, "import", write_manifest(folder, PAIRS + "shots = [4, 6]\n"), "-o", folder / "out")
    assert_pairs(folder / "out" / "run", [4, 5, 6])


def test_single_exposures_at_even_times_keep_their_rate(folder: Path, capsys: Capture) -> None:
    frames = 'rate_hz = 2500.0\n[[run.shots]]\nframes = "{view}/im{shot:04d}_a.png"\n'
    result = told(capsys, "import", write_manifest(folder, frames), "-o", folder / "out")
    assert result["shots"] == 5
    with RunReader(folder / "out" / "run") as run:
        assert (run.header.frames_per_shot, run.header.rate_hz) == (1, 2500.0)
        np.testing.assert_array_equal(run.read_shot(4).views["right"].frame_a, image("right", 7))


def test_shots_that_all_views_have_lost_are_told(folder: Path, capsys: Capture) -> None:
    for view in VIEWS:
        for frame in "ab":
            (folder / view / f"im0005_{frame}.png").unlink()
    error = refused(capsys, "import", write_manifest(folder, PAIRS), "-o", folder / "out")
    assert "shots between 4 and 6 are missing of all views; say shots = [first, last]" in error
    parts = PAIRS + "shots = [3, 4]\n" + PAIRS + "shots = [6, 7]\n"
    told(capsys, "import", write_manifest(folder, parts), "-o", folder / "out")
    assert_pairs(folder / "out" / "run", [3, 4, 6, 7])


def test_every_second_number_is_no_loss(folder: Path, capsys: Capture) -> None:
    for view in VIEWS:
        for name in ("im0004_a", "im0004_b", "im0006_a", "im0006_b"):
            (folder / view / f"{name}.png").unlink()
    told(capsys, "import", write_manifest(folder, PAIRS), "-o", folder / "out")
    assert_pairs(folder / "out" / "run", [3, 5, 7])


def test_backgrounds_and_darks_have_patterns_too(folder: Path, capsys: Capture) -> None:
    more = PAIRS.replace("run.shots", "run.backgrounds") + "shots = [5, 6]\n"
    more += PAIRS.replace("run.shots", "run.darks") + "shots = [7, 7]\n"
    result = told(capsys, "import", write_manifest(folder, PAIRS + "shots = [3, 4]\n" + more), "-o", folder / "out")
    assert result["shots"] == 2
    with RunReader(folder / "out" / "run") as run:
        background, dark = run.background("right"), run.dark("left")
    assert background is not None
    assert dark is not None
    np.testing.assert_array_equal(background[1], (image("right", 5, "b") + image("right", 6, "b").astype(float)) / 2)
    np.testing.assert_array_equal(dark[0], image("left", 7, "a"))


def test_a_last_shot_of_which_all_cameras_lack_exposure_a_is_not_left_out(folder: Path, capsys: Capture) -> None:
    for view in VIEWS:
        (folder / view / "im0007_a.png").unlink()
    message = refused(capsys, "import", write_manifest(folder, PAIRS), "-o", folder / "out")
    assert "run.shots.0.frame_a: left has 4 images" in message
    assert "shot 7 of left is missing" in message


@pytest.mark.parametrize(
    ("run", "lost", "complaint"),
    [
        (PAIRS, "right/im0005_a.png", "right has 4 images, left has 5: shot 5 of right is missing"),
        (PAIRS, "right/im0005_b.png", "run.shots.0.frame_b.right: {folder}/right/im0005_b.png does not exist"),
        (PAIRS + "shots = [3, 9]\n", "", "{folder}/left/im0008_a.png does not exist (and 7 more)"),
        (PAIRS + 'views = ["left", "top"]\n', "", "top has 0 images, left has 5: shot 3 of top is missing"),
        (PAIRS.replace("{shot:04d}", "{shot}"), "", "_a.png is there, and is left/im"),
        (PAIRS + 'frames = "{view}.tif"\n', "", "either frame_a, with or without frame_b, or frames"),
        (PAIRS + "shots = [7, 3]\n", "", "line 3: run.shots.0: shots: [7, 3] are not the first number and the last"),
        (
            PAIRS + "shots = [0, 999999999999]\n",
            "",
            "line 3: run.shots.0: shots: [0, 999999999999] are more than 100000",
        ),
        (PAIRS.replace("im", "\\u0000"), "", "a file name has no control characters"),
        (PAIRS.replace("{view}/", "left/"), "", "left/im{{shot:04d}}_a.png: {{view}} must say where"),
        (PAIRS.replace("{view}", "{camera}"), "", "{{camera}} is neither {{view}} nor {{shot}}"),
        (PAIRS.replace("04d", "04x"), "", "{{shot:04x}}: only numbers are padded, as {{shot:04d}}"),
        (PAIRS.replace("im{shot:04d}_a.png", "stack.tif"), "", "both exposures have {{shot}} in their names, or none"),
    ],
    ids=[
        "frame_a",
        "frame_b",
        "range",
        "both keys",
        "view",
        "padding",
        "backwards",
        "endless",
        "control",
        "no view",
        "field",
        "width",
        "stack",
    ],
)
def test_what_a_pattern_lacks_is_named(folder: Path, run: str, lost: str, complaint: str, capsys: Capture) -> None:
    if lost:
        (folder / lost).unlink()
    message = refused(capsys, "import", write_manifest(folder, run), "-o", folder / "out")
    assert complaint.format(folder=folder) in message
    assert f"{folder / 'manifest.toml'}, line " in message
    assert not (folder / "out").exists()


def write_stacks(folder: Path, shots: int, frames: str, counts: tuple[int, int] | None = None) -> None:
    """``VIEW.tif`` with the exposures of all shots, pair after pair; or fewer of one view."""
    for view, count in zip(VIEWS, counts or (len(frames) * shots,) * 2, strict=True):
        pages = [image(view, shot, frame) for shot in range(shots) for frame in frames]
        tifffile.imwrite(folder / f"{view}.tif", np.array(pages[:count]), photometric="minisblack")


def test_the_pages_of_a_stack_are_shots(tmp_path: Path, capsys: Capture) -> None:
    write_stacks(tmp_path, 4, "a")
    manifest = write_manifest(tmp_path, '[[run.shots]]\nframe_a = "{view}.tif"\n')
    assert told(capsys, "import", manifest, "-o", tmp_path / "out")["shots"] == 4
    for shot, exposures in enumerate(kept(tmp_path / "out" / "run")):
        for view, frames in exposures.items():
            np.testing.assert_array_equal(frames, [image(view, shot)])


def test_the_pages_of_one_stack_alternate_between_a_and_b(tmp_path: Path, capsys: Capture) -> None:
    write_stacks(tmp_path, 4, "ab")
    run = '[[run.shots]]\nframe_a = "{view}.tif"\nframe_b = "{view}.tif"\nshots = [1, 3]\n'
    told(capsys, "import", write_manifest(tmp_path, run), "-o", tmp_path / "out")
    assert_pairs(tmp_path / "out" / "run", [1, 2, 3])


@pytest.mark.parametrize(
    ("counts", "more", "complaint"),
    [
        ((8, 6), "", "right has 6 images, left has 8 in frame_a"),
        ((7, 7), "", "7 images are no pairs A, B, A, B, ..."),
        ((8, 8), "shots = [0, 4]\n", "4 is beyond the 4 shots that are there"),
    ],
)
def test_stacks_of_different_lengths_are_named(
    tmp_path: Path, counts: tuple[int, int], more: str, complaint: str, capsys: Capture
) -> None:
    write_stacks(tmp_path, 4, "ab", counts)
    run = '[[run.shots]]\nframe_a = "{view}.tif"\nframe_b = "{view}.tif"\n' + more
    assert complaint in refused(capsys, "import", write_manifest(tmp_path, run), "-o", tmp_path / "out")


STATED = '[[run.shot]]\nframe_a = { left = "left.tif", right = "right.tif" }\n'


def test_a_stack_is_not_read_by_its_first_page_without_a_word(tmp_path: Path, capsys: Capture) -> None:
    write_stacks(tmp_path, 4, "a")
    message = refused(capsys, "import", write_manifest(tmp_path, STATED), "-o", tmp_path / "out")
    assert message.endswith("left.tif: holds 4 images; say by page = 0 to 3 which one is meant")


def test_a_shot_names_its_pages(tmp_path: Path, capsys: Capture) -> None:
    write_stacks(tmp_path, 4, "ab")
    run = STATED + STATED.splitlines()[1].replace("_a", "_b") + "\npage = 4\npage_b = 5\n"
    told(capsys, "import", write_manifest(tmp_path, run), "-o", tmp_path / "out")
    assert_pairs(tmp_path / "out" / "run", [2])


def test_an_image_of_twice_the_height_is_a_above_b(folder: Path, capsys: Capture) -> None:
    for view in VIEWS:
        for shot in (3, 4):
            cv2.imwrite(str(folder / view / f"{shot}.png"), np.vstack([image(view, shot, frame) for frame in "ab"]))
    run = 'double_height = true\n[[run.shots]]\nframe_a = "{view}/{shot}.png"\n'
    told(capsys, "import", write_manifest(folder, run), "-o", folder / "out")
    assert_pairs(folder / "out" / "run", [3, 4])
    odd = 'double_height = true\n[[run.shots]]\nframe_a = "{view}/odd{shot}.png"\n'
    for view in VIEWS:
        cv2.imwrite(str(folder / view / "odd0.png"), np.zeros((5, 6), np.uint8))
    assert "5 rows are not two exposures" in refused(
        capsys, "import", write_manifest(folder, odd), "-o", folder / "other"
    )
    both = "double_height = true\n" + PAIRS
    assert "exposure B is below A" in refused(capsys, "import", write_manifest(folder, both), "-o", folder / "other")


def test_planes_of_a_traverse_are_pages_of_a_stack(tmp_path: Path, capsys: Capture) -> None:
    camera, optics, heights_mm = paper_cameras(4)["view1"], paper_optics(4)["view1"], (-3.0, 0.0, 3.0)
    pages = [(40 + 200 * render_target(camera, Checkerboard(), z_mm, optics)).astype(np.uint8) for z_mm in heights_mm]
    tifffile.imwrite(tmp_path / "traverse.tif", np.array(pages), photometric="minisblack")
    board = '[calibration]\ntarget = { kind = "checkerboard", columns = 23, rows = 17, pitch_mm = 1.0 }\n'
    plane = '[[calibration.plane]]\nz_mm = {}\nimages = {{ view1 = "traverse.tif" }}\n'
    manifest = tmp_path / "manifest.toml"
    manifest.write_text(board + "".join(map(plane.format, heights_mm)))
    assert "line 5: calibration.plane.0.images.view1: " in refused(capsys, "import", manifest, "-o", tmp_path / "out")
    manifest.write_text(board + "".join(f"{plane.format(z)}page = {page}\n" for page, z in enumerate(heights_mm)))
    told(capsys, "import", manifest, "-o", tmp_path / "out")
    for page, file in enumerate(sorted((tmp_path / "out").glob("calibration/images/*/*.tif"))):
        np.testing.assert_array_equal(read_image(file), pages[page])
    for plane_seen in load_calibration_set(tmp_path / "out").views["view1"].planes:
        seen_px = camera.project(plane_seen.points_mm)
        assert np.median(np.linalg.norm(plane_seen.image_px - seen_px, axis=1)) < 0.1


def reconstructed(folder: Path, manifest: Path, capsys: Capture) -> NDArray[np.float32]:
    """Volume of the first shot of a manifest."""
    told(capsys, "import", manifest, "-o", folder / "out")
    calibration = write_calibration(folder / "calibration.json")
    arguments = ["--calibration", calibration, f"--grid={GRID}", "-o", folder / "volumes"]
    told(capsys, "reconstruct", folder / "out" / "run", *arguments)
    return read_volume(folder / "volumes" / "shot_00000_a.vtkhdf")[0]


def test_grey_values_of_12_bits_in_files_of_16_are_not_taken_for_darkness(tmp_path: Path, capsys: Capture) -> None:
    stated = write_particles(tmp_path / "twelve", 3900, np.uint16)
    manifest = write_manifest(tmp_path / "twelve", stated)
    message = refused(capsys, "import", manifest, "-o", tmp_path / "out")
    assert f"{manifest}, line 1: run: view1: the brightest pixel of all its images is 3900" in message
    assert "(bits = 12), or bits = 16 if the images are as dark as that" in message
    assert not (tmp_path / "out").exists()


def test_shadows_of_12_bits_are_taken_with_a_note(tmp_path: Path, capsys: Capture) -> None:
    manifest = write_manifest(tmp_path, write_particles(tmp_path, 3900, np.uint16))
    manifest.write_text(manifest.read_text().replace("bright", "shadow"))
    view1, *others = told(capsys, "import", manifest, "-o", tmp_path / "out")["notes"]
    assert view1.startswith("view1: the brightest pixel of all its images is 3900, and the files could hold 65535")
    assert len(others) == 2
    manifest.write_text(manifest.read_text().replace("[run]", "[run]\nbits = 12"))
    assert told(capsys, "import", manifest, "-o", tmp_path / "stated")["notes"] == []


def test_images_of_12_bits_give_the_volume_that_those_of_16_give(tmp_path: Path, capsys: Capture) -> None:
    full = write_particles(tmp_path / "full", 3900 * 16, np.uint16)
    whole = reconstructed(tmp_path / "full", write_manifest(tmp_path / "full", full), capsys)
    twelve = "bits = 12\n" + write_particles(tmp_path / "twelve", 3900, np.uint16)
    volume = reconstructed(tmp_path / "twelve", write_manifest(tmp_path / "twelve", twelve), capsys)
    assert volume.max() > 0.1
    np.testing.assert_allclose(volume, whole, atol=2e-3)
    with RunReader(tmp_path / "twelve" / "out" / "run") as run:
        assert {view.bits for view in run.header.views.values()} == {12}


def test_a_pixel_beyond_the_stated_bits_names_its_file(tmp_path: Path, capsys: Capture) -> None:
    stated = "bits = 10\n" + write_particles(tmp_path, 3900, np.uint16, shots=2)
    message = refused(capsys, "import", write_manifest(tmp_path, stated), "-o", tmp_path / "out")
    assert f"{tmp_path / 'view1/0000.tif'}: a pixel of 3900, 10 bits reach to 1023" in message
    small = "bits = 12\n" + write_particles(tmp_path / "small", 200, np.uint8)
    message = refused(capsys, "import", write_manifest(tmp_path / "small", small), "-o", tmp_path / "out")
    assert message.endswith("line 3: run.bits: 12, and the images have 8 bits")


def test_grey_values_of_8_bits_in_files_of_16_are_kept_as_bytes(tmp_path: Path, capsys: Capture) -> None:
    stated = "bits = 8\n" + write_particles(tmp_path, 200, np.uint16)
    told(capsys, "import", write_manifest(tmp_path, stated), "-o", tmp_path / "out")
    (exposures,) = kept(tmp_path / "out" / "run")
    assert exposures["view1"][0].dtype == np.uint8
    assert exposures["view1"][0].max() == 200


def test_dark_images_that_are_said_to_fill_16_bits_are_taken(tmp_path: Path, capsys: Capture) -> None:
    stated = "bits = 16\n" + write_particles(tmp_path, 3900, np.uint16)
    assert told(capsys, "import", write_manifest(tmp_path, stated), "-o", tmp_path / "out")["shots"] == 1


def test_the_directory_of_an_import_serves_every_command(tmp_path: Path, capsys: Capture) -> None:
    told(capsys, "import", write_manifest(tmp_path, write_particles(tmp_path, 200, np.uint8)), "-o", tmp_path / "day")
    with_calibration = ["--calibration", write_calibration(tmp_path / "calibration.json")]
    told(capsys, "reconstruct", tmp_path / "day", *with_calibration, f"--grid={GRID}", "-o", tmp_path / "volumes")
    mean = ["-o", tmp_path / "mean.vtkhdf", f"--grid={GRID}"]
    assert told(capsys, "average", tmp_path / "day", *with_calibration, *mean)["volumes"] == 1
    assert told(capsys, "check", tmp_path / "day", *with_calibration)["shots"][0]["shot"] == 0


def test_an_import_replaces_an_import_and_nothing_else(tmp_path: Path, capsys: Capture) -> None:
    manifest = write_manifest(tmp_path, write_particles(tmp_path, 200, np.uint8, shots=2))
    arguments = ["import", manifest, "-o", tmp_path / "day"]
    (tmp_path / "day").mkdir()
    told(capsys, *arguments)
    assert refused(capsys, *arguments) == f"{tmp_path / 'day'}: exists; only --overwrite replaces it"
    write_manifest(tmp_path, write_particles(tmp_path, 200, np.uint8, shots=1))
    assert told(capsys, *arguments, "--overwrite")["shots"] == 1
    assert len(kept(tmp_path / "day" / "run")) == 1
    (tmp_path / "view1" / "0000.tif").write_bytes(b"torn")
    refused(capsys, *arguments, "--overwrite")
    assert len(kept(tmp_path / "day" / "run")) == 1
    shutil.rmtree(tmp_path / "day")
    (tmp_path / "day" / "photographs").mkdir(parents=True)
    assert "this command has not made" in refused(capsys, *arguments, "--overwrite")
