"""A path that is no plain file is refused at once, wherever a file is read; a pipe without a writer would block."""

from __future__ import annotations

import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import pytest

import eomgen as eg
from eomgen.cli.command import run_command
from eomgen.ensembles.store import Store, stored_length
from eomgen.errors import UsageError
from eomgen.files.reading import open_plain
from eomgen.generation import generate
from eomgen.simulation.checkpoint import Checkpoint

EXAMPLE = Path(__file__).parents[2] / "examples" / "pendulum.yaml"


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(path))


#: What may lie in the place of a file -> how it comes there, and what a message calls it.
OTHERS: dict[str, tuple[Callable[[Path], object], str]] = {
    "pipe": (os.mkfifo, "a pipe"),
    "folder": (Path.mkdir, "a folder"),
    "zero": (lambda path: path.symlink_to("/dev/zero"), "a device"),
    "null": (lambda path: path.symlink_to("/dev/null"), "a device"),
    "socket": (_socket, "a socket"),
}


@pytest.fixture(autouse=True)
def _in_time() -> Iterator[None]:
    def late(number: int, frame: FrameType | None) -> None:
        raise AssertionError("it waits")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 20.0)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(params=OTHERS)
def other(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """A short name without a suffix in the current folder, and what it is."""
    monkeypatch.chdir(tmp_path)
    make, what = OTHERS[request.param]
    for suffix in ("yaml", "urdf", "xml", "stl", "csv", "npz", "c"):
        make(Path(f"odd.{suffix}"))
    Path("store").mkdir()
    make(Path("store/manifest.json"))
    Path("model.yaml").write_text(EXAMPLE.read_text())
    return "odd", what


def test_an_open_file_is_plain(other: tuple[str, str]) -> None:
    with pytest.raises(UsageError, match=f"^odd.yaml is not a plain file but {other[1]}"):
        open_plain("odd.yaml")
    with open_plain("model.yaml") as file:
        assert file.read() == EXAMPLE.read_bytes()
    Path("link").symlink_to("model.yaml")
    with open_plain("link") as file:
        assert file.read() == EXAMPLE.read_bytes()
    with pytest.raises((UsageError, OSError)):
        open_plain("link", follow=False)


@pytest.mark.parametrize("suffix", ["yaml", "urdf", "xml"])
def test_a_model_is_read_from_a_plain_file(suffix: str, other: tuple[str, str],
                                           capfd: pytest.CaptureFixture[str]) -> None:  # fmt: skip
    with pytest.raises(UsageError, match=f"^odd.{suffix} is not a plain file but {other[1]}"):
        eg.load(f"odd.{suffix}")
    with pytest.raises(SystemExit, match="2"):
        run_command(["check", f"odd.{suffix}"])
    assert f"odd.{suffix} is {other[1]}, not a plain file" in capfd.readouterr().err


def test_what_a_model_names_is_a_plain_file(other: tuple[str, str]) -> None:
    Path("mesh.yaml").write_text("name: m\nbodies: {b: {solids: [{type: mesh, file: odd.stl, density: 1}]}}\n")
    with pytest.raises(eg.ModelError, match=r"not a plain file|outside the folder"):
        eg.load("mesh.yaml").check()
    Path("native.yaml").write_text("name: n\nfunctions: {f: {type: native, source: odd.c, arguments: 1}}\n")
    with pytest.raises(eg.ModelError, match="odd.c is not a plain file"):
        eg.load("native.yaml", allow_native=True).check()


def test_tables_and_results_are_plain_files(other: tuple[str, str], capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        sys.exit(run_command(["ensemble", "model.yaml", "--target", "numpy", "--cases", "odd.csv", "--end", "0.1"]))
    said = capfd.readouterr().err
    assert f"odd.csv is not a plain file but {other[1]}" in said or "'odd.csv' is a directory" in said
    with pytest.raises(UsageError, match="not a plain file"):
        eg.load_trajectory("odd.npz")
    with pytest.raises(UsageError, match="not a plain file"):
        Checkpoint("odd.npz", 1.0, None).open({})


def test_a_store_of_an_ensemble_has_plain_files(other: tuple[str, str]) -> None:
    assert stored_length("store") is None
    with pytest.raises(UsageError):
        Store("store", {"model": "m"})


def test_a_generated_package_has_a_plain_list_of_files(other: tuple[str, str]) -> None:
    model = eg.load("model.yaml")
    os.renames("store/manifest.json", f"{model.name}/model.json")
    with pytest.raises(UsageError, match="is not a generated package"):
        generate(model, ".", target="numpy")


@pytest.mark.parametrize("path", ["a\0.yaml", "\ud800.yaml", 3, None, 1.5])
def test_what_is_no_path_is_told(path: object) -> None:
    with pytest.raises(UsageError, match="path must be the name of a file"):
        eg.load(path)  # type: ignore[arg-type]
