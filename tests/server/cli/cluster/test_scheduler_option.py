"""``--scheduler``: what other computers do is what this one does, bit by bit, and bad input is told as here."""

import io
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from processing.reconstruction.volume_file import read_volume
from server.cli.main import main
from tests.support.bright_scenes import BOX, write_bright_calibration, write_bright_run
from tests.support.cluster import Cluster, cluster
from tests.support.command_line import GRID, refused, told
from tests.support.droplet_run import write_calibration, write_run

SHOTS = 8


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("lab"), None, workers=1) as made:
        yield made


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs with their calibrations."""
    folder = tmp_path_factory.mktemp("runs")
    write_run(folder / "shadows", shots=SHOTS, invalid=(1,))
    write_calibration(folder / "shadows.json")
    write_bright_run(folder / "bright", shots=2)
    write_bright_calibration(folder / "bright.json")
    return folder


def reconstruct(folder: Path, out: Path, *more: object) -> list[object]:
    return [
        "reconstruct", folder / "shadows", "--calibration", folder / "shadows.json", "-o", out, f"--grid={GRID}", *more
    ]  # fmt: skip


def measure(folder: Path, out: Path, *more: object) -> list[object]:
    return ["measure", folder / "bright", "--calibration", folder / "bright.json", "-o", out, f"--grid={BOX}", *more]


def assert_same(here: Path, there: Path) -> None:
    names = sorted(path.name for path in here.iterdir())
    assert names == sorted(path.name for path in there.iterdir())
    for name in names:
        if name.endswith(".vtkhdf"):  # how tightly it is deflated depends on threads
            (voxels, *told), (others, *told_there) = read_volume(here / name), read_volume(there / name)
            np.testing.assert_array_equal(voxels, others)
            assert told == told_there
        else:
            assert (here / name).read_bytes() == (there / name).read_bytes(), name


def test_volumes_and_droplets_of_workers_are_those_of_this_computer(
    lab: Cluster, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Workers call the folder of the runs by another name."""
    mounted = tmp_path / "mounted"
    mounted.symlink_to(folder)
    for command in (reconstruct, measure):
        here, there = tmp_path / f"{command.__name__}-here", tmp_path / f"{command.__name__}-there"
        local = told(capsys, *command(folder, here))
        remote = told(capsys, *command(folder, there, *lab.options, "--path", f"{folder}={mounted}"))
        assert_same(here, there)
        assert local.keys() == remote.keys()
        assert local["recipe_sha256"] == remote["recipe_sha256"]
        assert local["grid"] == remote["grid"]
    assert local["statistics"] == remote["statistics"]


class Interrupting(io.StringIO):
    """A stream on which the process is interrupted, once, when a text is written."""

    def write(self, text: str) -> int:
        if "shot 3 by" in text:
            signal.raise_signal(signal.SIGINT)
        return super().write(text)


def test_ctrl_c_ends_the_command_and_it_goes_on_where_it_was(
    lab: Cluster, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with monkeypatch.context() as stream:
        stream.setattr("sys.stderr", error := Interrupting())
        assert main([*map(str, reconstruct(folder, out, *lab.options))]) == 1
    (told_shots,) = [line for line in error.getvalue().splitlines() if "go on with" in line]
    left = told_shots.rpartition(" ")[2]
    assert int(left.partition(":")[0]) >= 3
    told(capsys, *reconstruct(folder, out, *lab.options, "--shots", left))
    told(capsys, *reconstruct(folder, tmp_path / "whole"))
    whole = sorted((tmp_path / "whole").glob("*.vtkhdf"))
    assert sorted(out.iterdir()) == [out / "settings.json", *(out / volume.name for volume in whole)]
    for volume in whole:  # they say which shots were asked for with them
        np.testing.assert_array_equal(read_volume(volume)[0], read_volume(out / volume.name)[0])


def test_what_is_wrong_with_a_shot_is_told_as_here(
    lab: Cluster, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    coarse = ["--grid=-1:1,-1:1,-1:1@0.5"]
    arguments = ["measure", folder / "bright", "--calibration", folder / "bright.json", *coarse]
    texts = [refused(capsys, *arguments, "-o", tmp_path / "out", *more) for more in ([], lab.options)]
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--scheduler", "10.0.0.1"], "--scheduler 10.0.0.1: is no address of a scheduler, for example tls://"),
        (["--scheduler", "tcp://10.0.0.1:8786"], "--scheduler tcp://10.0.0.1:8786: leaves this computer without"),
        (["--scheduler", "tls://10.0.0.1:8786"], "--scheduler tls://10.0.0.1:8786: needs certificates, the folder"),
        (
            ["--scheduler", "tls://10.0.0.1:8786", "--certificates", "nowhere"],
            f"--certificates nowhere: there is no file {os.getcwd()}/nowhere/ca.pem; docs/cluster.md tells how",
        ),
        (["--scheduler", "tcp://127.0.0.1:1", "--path", "/a=b"], "--path {'/a': 'b'}: 'b' must begin with /, here"),
        (["--certificates", "nowhere"], "--certificates: is for --scheduler"),
    ],
)
def test_options_that_cannot_be_followed_are_told_before_anything_is_done(
    options: list[str], text: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert text in refused(capsys, *reconstruct(folder, tmp_path / "out", *options))
    assert not (tmp_path / "out").exists()
