"""Files: what is no plain file is refused at once wherever one is read; what is written is whole or as before."""

import os
import resource
import signal
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import command
import numpy as np
import pytest
from model_files import EXAMPLES
from refusals import refuses

import eomgen as eg

EXAMPLE = EXAMPLES / "pendulum.yaml"


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


@pytest.mark.parametrize("suffix", ["yaml", "urdf", "xml"])
def test_a_model_is_read_from_a_plain_file(suffix: str, other: tuple[str, str]) -> None:
    refuses(f"EG-FILE odd.{suffix} {other[1].split()[-1]}", eg.load, f"odd.{suffix}")
    found = command.run("check", f"odd.{suffix}")
    assert (found.code, f"odd.{suffix} is {other[1]}, not a plain file" in found.err) == (2, True)


def test_what_else_is_read_is_a_plain_file(other: tuple[str, str]) -> None:
    Path("mesh.yaml").write_text("name: m\nbodies: {b: {solids: [{type: mesh, file: odd.stl, density: 1}]}}\n")
    refuses("EG-FILE bodies.b.solids[0].file", lambda: eg.load("mesh.yaml").check())
    Path("native.yaml").write_text("name: n\nfunctions: {f: {type: native, source: odd.c, arguments: 1}}\n")
    refuses("EG-FILE functions.f.source odd.c", lambda: eg.load("native.yaml", allow_native=True).check())
    found = command.run("ensemble", "model.yaml", "--target", "numpy", "--cases", "odd.csv", "--end", "0.1")
    assert found.code == 2
    assert f"odd.csv is not a plain file but {other[1]}" in found.err or "'odd.csv' is a directory" in found.err
    refuses("EG-FILE-DAMAGED file", eg.load_trajectory, "odd.npz")
    os.renames("store/manifest.json", "pendulum/model.json")
    found = command.run("generate", "model.yaml", "--out", ".")
    assert (found.code, "is not a generated package" in found.err) == (2, True)


class Odd(os.PathLike[str]):
    """Its path is an error."""

    def __fspath__(self) -> str:
        raise ZeroDivisionError


NO_PATHS = (b"a.yaml", "", None, 3, ["a.yaml"], "a\0.yaml", "\ud800.yaml", Odd())


def test_what_is_no_path_is_refused_with_the_same_message(run: Any) -> None:
    for door in (eg.load, eg.load_trajectory, eg.load(EXAMPLE).save, run.save):
        for given in NO_PATHS:
            refuses("EG-TYPE folder", door, given)


# -- writing ----------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def run() -> Any:
    return eg.load(EXAMPLE).compile(target="numpy").simulate((0.0, 0.2))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def writers(run: Any) -> dict[str, Callable[[Path], Any]]:
    module = eg.load(EXAMPLE).compile(target="numpy")
    ensemble = module.simulate_many(0.1, np.zeros((2, 2)))
    sensitivities = module.sensitivities(list(module.p_names)[:1], 0.1)
    document = eg.load(EXAMPLE).derive().explain(level="short")
    return {
        "r.npz": run.save, "r.csv": run.save, "m.yaml": eg.load(EXAMPLE).save, "e.npz": ensemble.save,
        "s.csv": sensitivities.save, "d.html": document.save,
    }  # fmt: skip


def test_every_writer_leaves_the_earlier_file_on_a_full_disk(tmp_path: Path, run: Any) -> None:
    made = writers(run)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    for name in made:
        (tmp_path / name).write_text("earlier")
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        for name, write in made.items():
            with pytest.raises(OSError) as raised:  # noqa: PT011
                write(tmp_path / name)
            assert raised.value.filename == str(tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    assert names(tmp_path) == sorted(made)
    assert {(tmp_path / name).read_text() for name in made} == {"earlier"}


def test_no_writer_follows_a_link(tmp_path: Path, run: Any) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for name, write in writers(run).items():
        (tmp_path / name).symlink_to(victim)
        refuses("EG-FILE symbolic", write, tmp_path / name)
    assert victim.read_text() == "precious"


def test_a_file_is_replaced_whole_with_the_rights_it_had(tmp_path: Path) -> None:
    file, model = tmp_path / "a.yaml", eg.load(EXAMPLE)
    (tmp_path / "plain").write_text("")
    model.save(file)
    assert file.stat().st_mode == (tmp_path / "plain").stat().st_mode
    file.write_text("earlier " * 1000)
    file.chmod(0o640)
    model.save(file)
    assert file.read_text() == model.to_yaml()
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    (tmp_path / "there").mkdir()
    (tmp_path / "results").symlink_to("there")
    model.save(tmp_path / "results" / ("é" * 125 + ".yaml"))  # folders above may be links, and names long
    model.save("/dev/null")
    with pytest.raises(OSError, match="too long"):
        model.save(tmp_path / ("a" * 300))
    assert names(tmp_path) == ["a.yaml", "plain", "results", "there"]
    assert len(names(tmp_path / "there")) == 1


def test_links_are_refused_before_the_work_and_generate_goes_through_none(tmp_path: Path) -> None:
    (tmp_path / "r.npz").symlink_to(tmp_path / "victim")
    refused = command.run("run", EXAMPLE, "--out", tmp_path / "r.npz")
    assert (refused.code, "symbolic link" in refused.err, "integrate" in refused.err) == (2, True, False)
    victim = tmp_path / "victim"
    (victim / "runtime").mkdir(parents=True)
    (victim / "runtime" / "bound_model.py").write_text("precious")
    out = tmp_path / "out"
    out.mkdir()
    (out / "pendulum").symlink_to(victim)
    words = ["generate", str(EXAMPLE), "--out", str(out)]
    assert "pendulum is a symbolic link to" in command.run(*words).err
    (out / "pendulum").unlink()
    assert command.run(*words).code == 0
    inner = out / "pendulum" / "runtime"
    inner.rename(tmp_path / "aside")
    inner.symlink_to(victim / "runtime")
    assert "runtime is a symbolic link to" in command.run(*words).err
    assert (victim / "runtime" / "bound_model.py").read_text() == "precious"
    assert names(victim) == ["runtime"]
    inner.unlink()
    (out / "pendulum" / "errors.py").unlink()
    (out / "pendulum" / "errors.py").symlink_to(victim / "runtime" / "bound_model.py")
    assert command.run(*words).code == 0  # the link itself is replaced
    assert (victim / "runtime" / "bound_model.py").read_text() == "precious"
    assert not (out / "pendulum" / "errors.py").is_symlink()
