"""Files of results: whole or as before, on full disks, through links, with the rights they had."""

from __future__ import annotations

import errno
import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import eomgen as eg
from eomgen.cli.command import run_command
from eomgen.emit.write import write_package
from eomgen.errors import UsageError
from eomgen.files import writing
from eomgen.files.writing import TRIES, refuse_link, remove_parts, save_figure, whole_file, write_whole

EXAMPLE = Path(__file__).parents[2] / "examples" / "pendulum.yaml"
FULL = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # writing beyond the limit fails like a full disk
from eomgen.cli.command import run_command
import eomgen.cli.verb_run, numpy, scipy.integrate, matplotlib.figure, matplotlib.backends.backend_agg
from eomgen.runtime.storage import save
from eomgen.files import writing
opened = writing.os.open
def limited(*args):
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    return opened(*args)
writing.os.open = limited
sys.exit(run_command(sys.argv[1:]))
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    file = tmp_path / "new" / "a.txt"
    write_whole(file, "first")
    file.chmod(0o640)
    write_whole(file, "sécond")
    assert file.read_bytes() == "sécond".encode()
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert names(file.parent) == ["a.txt"]


def test_a_new_file_has_the_rights_of_any_other(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    write_whole(tmp_path / "ours", b"")
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize(
    "error", [OSError(errno.ENOSPC, "No space left on device"), ValueError("x"), KeyboardInterrupt()]
)
def test_a_failure_leaves_the_earlier_file(tmp_path: Path, error: BaseException) -> None:
    file = tmp_path / "a.npz"
    file.write_text("earlier")
    with pytest.raises(type(error)) as raised, whole_file(file) as stream:
        stream.write(b"part of what ")
        raise error
    assert file.read_text() == "earlier"
    assert names(tmp_path) == ["a.npz"]
    if isinstance(raised.value, OSError):
        assert raised.value.filename == str(file)


def test_names_may_be_as_long_as_names_can_be(tmp_path: Path) -> None:
    file = tmp_path / ("é" * 125 + ".csv")
    write_whole(file, "x")
    assert file.read_text() == "x"
    with pytest.raises(OSError, match="too long"):
        write_whole(tmp_path / ("a" * 300), "x")
    assert names(tmp_path) == [file.name]


@pytest.mark.parametrize("times", range(1, TRIES + 1))
def test_a_part_that_another_call_removes_is_written_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """Two calls on one store: the later one takes the part of the earlier for what a killed writer left."""
    file, replace, left = tmp_path / "a.npz", os.replace, [times]
    file.write_text("earlier")

    def late(part: Path, target: Path) -> None:
        if left[0]:
            left[0] -= 1
            remove_parts(target)
        replace(part, target)

    monkeypatch.setattr(writing.os, "replace", late)
    if times < TRIES:
        write_whole(file, "new")
    else:
        with pytest.raises(FileNotFoundError) as raised:
            write_whole(file, "new")
        assert raised.value.filename == str(file)
    assert (file.read_text(), names(tmp_path)) == ("new" if times < TRIES else "earlier", ["a.npz"])


@pytest.mark.parametrize("kind", ["file", "folder", "nothing"])
def test_links_are_refused_by_name(tmp_path: Path, kind: str) -> None:
    victim, link = tmp_path / "victim", tmp_path / "link.npz"
    if kind == "folder":
        victim.mkdir()
    elif kind != "nothing":
        victim.write_text("precious")
    link.symlink_to(victim)
    with pytest.raises(UsageError, match=r"link\.npz is a symbolic link to .*victim.*name that file itself"):
        write_whole(link, "x")
    assert names(tmp_path) == (["link.npz"] if kind == "nothing" else ["link.npz", "victim"])
    assert not victim.is_file() or victim.read_text() == "precious"


def test_devices_and_links_to_them_are_written_as_they_are(tmp_path: Path) -> None:
    link = tmp_path / "null"
    link.symlink_to("/dev/null")
    for path in ("/dev/null", link):
        write_whole(path, "x")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert link.is_symlink()
    with pytest.raises(OSError, match="No space left") as raised:
        write_whole("/dev/full", "x" * 100_000)
    assert raised.value.filename == "/dev/full"


def test_folders_above_may_be_links(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "results").symlink_to("there")
    write_whole(tmp_path / "results" / "a.csv", "x")
    assert (tmp_path / "there" / "a.csv").read_text() == "x"


def test_a_read_only_file_stays(tmp_path: Path) -> None:
    """Of a user other than root, whom nothing is forbidden."""
    file = tmp_path / "a.csv"
    file.write_text("earlier")
    file.chmod(0o444)
    user = os.geteuid() or 12345
    os.chown(file, user, -1)
    os.chown(tmp_path, user, -1)
    code = (
        "import os, sys; from eomgen.files.writing import write_whole; from pathlib import Path\n"
        "os.chdir(sys.argv[1]); os.setuid(int(sys.argv[2]))\n"
        "try: write_whole('a.csv', 'x')\nexcept PermissionError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path), str(user)], capture_output=True, text=True, check=True
    )
    assert "read-only: 'a.csv'" in done.stdout
    assert (file.read_text(), names(tmp_path)) == ("earlier", ["a.csv"])


def pictures(file: Path) -> None:
    save_figure(Figure(), file)


def package(file: Path) -> None:
    write_package({"model.json": '{"abi": 1}', "m.c": "x"}, file)


@pytest.fixture(scope="module")
def run() -> Any:
    return eg.load(EXAMPLE).compile(target="numpy").simulate((0.0, 0.2))


def writers(run: Any) -> dict[str, Callable[[Path], Any]]:
    module = eg.load(EXAMPLE).compile(target="numpy")
    ensemble = module.simulate_many(0.1, np.zeros((2, 2)))
    sensitivities = module.sensitivities(list(module.p_names)[:1], 0.1)
    return {
        "r.npz": run.save, "r.csv": run.save, "m.yaml": eg.load(EXAMPLE).save, "p.png": pictures,
        "e.npz": ensemble.save, "s.npz": sensitivities.save, "s.csv": sensitivities.save,
    }  # fmt: skip


def test_every_writer_leaves_the_earlier_file_on_a_full_disk(
    tmp_path: Path, run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
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
        with pytest.raises(UsageError, match="symbolic link"):
            write(tmp_path / name)
    assert victim.read_text() == "precious"


def test_the_command_line_on_a_full_disk(tmp_path: Path) -> None:
    for name in ("r.npz", "r.png"):
        (tmp_path / name).write_text("earlier")
    command = [sys.executable, "-c", FULL, "run", str(EXAMPLE), "--target", "numpy", "--end", "0.1", "--out"]
    done = subprocess.run([*command, str(tmp_path / "r.npz")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (2, f"{tmp_path / 'r.npz'}: File too large")
    command[-1] = "--plot"
    done = subprocess.run([*command, str(tmp_path / "r.png")], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (2, f"{tmp_path / 'r.png'}: File too large")
    assert names(tmp_path) == ["r.npz", "r.png"]
    assert {(tmp_path / name).read_text() for name in names(tmp_path)} == {"earlier"}


def test_generate_goes_through_no_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    victim = tmp_path / "victim"
    (victim / "runtime").mkdir(parents=True)
    (victim / "runtime" / "bound_model.py").write_text("precious")
    out = tmp_path / "out"
    out.mkdir()
    (out / "pendulum").symlink_to(victim)
    words = ["generate", str(EXAMPLE), "--out", str(out), "--target", "numpy"]
    assert _exit(words) == 2
    assert "pendulum is a symbolic link to" in capsys.readouterr().err
    (out / "pendulum").unlink()
    assert _exit(words) == 0
    inner = out / "pendulum" / "runtime"
    inner.rename(tmp_path / "aside")
    inner.symlink_to(victim / "runtime")
    assert _exit(words) == 2
    assert "runtime is a symbolic link to" in capsys.readouterr().err
    assert (victim / "runtime" / "bound_model.py").read_text() == "precious"
    assert names(victim) == ["runtime"]
    inner.unlink()
    (out / "pendulum" / "errors.py").unlink()
    (out / "pendulum" / "errors.py").symlink_to(victim / "runtime" / "bound_model.py")
    assert _exit(words) == 0  # the link itself is replaced
    assert (victim / "runtime" / "bound_model.py").read_text() == "precious"
    assert not (out / "pendulum" / "errors.py").is_symlink()


def _exit(words: list[str]) -> int:
    try:
        return run_command(words)
    except SystemExit as left:
        return int(str(left.code))


def test_a_link_is_refused_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "r.npz").symlink_to(tmp_path / "victim")
    assert _exit(["run", str(EXAMPLE), "--out", str(tmp_path / "r.npz")]) == 2
    said = capsys.readouterr().err
    assert "symbolic link" in said
    assert "integrate" not in said
    refuse_link(tmp_path / "victim")
