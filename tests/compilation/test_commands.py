"""Compilers that hang, print without end, lie or cannot be started, and words of CC that are no command."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from eomgen.compilation import (
    Cache,
    Options,
    cache_directory,
    compile_c_library,
    compile_sources,
    find_compiler,
    load_core,
)
from eomgen.compilation import commands as commands_module
from eomgen.compilation.commands import Running, run
from eomgen.compilation.products import require_library, require_object, stamp
from eomgen.errors import ToolchainError, UsageError


@pytest.fixture
def shell(tmp_path: Path) -> Callable[[str], str]:
    def make(text: str) -> str:
        path = tmp_path / f"cc{len(list(tmp_path.iterdir()))}"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return str(path)

    return make


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def test_what_a_command_says(shell: Callable[[str], str]) -> None:
    done = run([shell("echo out; echo err >&2; echo $LC_ALL; exit 3")])
    assert (done.stdout, done.stderr, done.returncode) == ("out\nC\n", "err\n", 3)
    assert run([shell("kill -SEGV $$")]).returncode == -signal.SIGSEGV
    assert len(run([shell("head -c 1000000 /dev/zero")]).stdout) == 1_000_000


def test_a_command_that_hangs_is_killed_with_its_children(shell: Callable[[str], str], tmp_path: Path) -> None:
    start = time.monotonic()
    with pytest.raises(ToolchainError, match=r"did not finish.* 0\.5 s \(EOMGEN_COMPILER_SECONDS sets") as raised:
        run([shell(f"sleep 600 & echo $! > {tmp_path}/child; echo said; wait")], seconds=0.5)
    assert time.monotonic() - start < 10
    assert "said" in raised.value.output
    child = int((tmp_path / "child").read_text())
    deadline = time.monotonic() + 10
    while alive(child) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not alive(child)


def test_a_command_that_closes_its_streams_and_hangs_is_killed(shell: Callable[[str], str]) -> None:
    with pytest.raises(ToolchainError, match="did not finish"):
        run([shell("exec >&- 2>&-; sleep 600")], seconds=0.5)


def test_what_a_command_leaves_running_is_not_waited_for(shell: Callable[[str], str], tmp_path: Path) -> None:
    start = time.monotonic()
    assert run([shell(f"sleep 600 & echo $! > {tmp_path}/child; echo done")], seconds=60).stdout == "done\n"
    assert time.monotonic() - start < 20


def test_output_has_a_bound(shell: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands_module, "OUTPUT", 100_000)
    with pytest.raises(ToolchainError, match="stopped after 0.1 MB of output") as raised:
        run([shell("exec yes")], seconds=60)
    assert len(raised.value.output) <= 2000


def test_seconds_from_the_environment(shell: Callable[[str], str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EOMGEN_COMPILER_SECONDS", "0.3")
    with pytest.raises(ToolchainError, match=r"after 0\.3 s"):
        run([shell("sleep 600")], seconds=60)
    for nonsense in ("soon", "-1", "0", "nan", "inf"):
        monkeypatch.setenv("EOMGEN_COMPILER_SECONDS", nonsense)
        with pytest.raises(ToolchainError, match="positive number of seconds"):
            run(["true"])


def test_work_that_is_given_up_ends_its_own_commands_only(shell: Callable[[str], str]) -> None:
    sleeping, mine, others = shell("sleep 600"), Running(), Running()
    found: list[object] = []

    def wait(group: Running, command: str) -> None:
        found.append(group.run([command], seconds=60).returncode)

    threads = [
        threading.Thread(target=wait, args=(mine, sleeping)),
        threading.Thread(target=wait, args=(others, shell("sleep 1"))),
    ]
    for thread in threads:
        thread.start()
    time.sleep(0.3)
    mine.stop()
    for thread in threads:
        thread.join(20)
    assert found == [-signal.SIGKILL, 0]
    with pytest.raises(ToolchainError, match="was cancelled"):
        mine.run(["true"])


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("gcc 'x", "is not a command: No closing quotation: gcc 'x"),
        ("/nowhere/cc", "not found"),
        ("{folder}", "a directory"),
        ("{folder}/plain", "not executable"),
        ("{folder}/elf", "cannot be started"),
        ("/bin/sh -c :", "prints nothing for --version"),
        ("/bin/sh -c 'exit 7'", "exit status 7"),
        ("''", "not found"),
    ],
)
def test_words_of_cc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, words: str) -> None:
    (tmp_path / "plain").write_text("")
    (tmp_path / "elf").write_bytes(b"\x7fELF nonsense")
    (tmp_path / "elf").chmod(0o755)
    monkeypatch.setenv("CC", command.format(folder=tmp_path))
    with pytest.raises(ToolchainError, match="environment variable CC(.|\n)*") as raised:
        find_compiler()
    assert words in str(raised.value)


@pytest.mark.parametrize("blank", ["", " ", "\t\n"])
def test_a_blank_cc_is_none(monkeypatch: pytest.MonkeyPatch, blank: str) -> None:
    monkeypatch.setenv("CC", blank)
    assert find_compiler().kind in ("gcc", "clang", "zig", "other")


def test_a_compiler_may_have_a_relative_name(
    sources: dict[str, str], fresh_cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cc").write_text('#!/bin/sh\nexec gcc "$@"\n')
    (tmp_path / "cc").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", "./cc")
    assert compile_c_library(sources, "pendulum").path.is_file()


def test_a_nul_in_the_command() -> None:
    with pytest.raises(ToolchainError, match="does not work"):
        find_compiler("gcc\0")
    with pytest.raises(ToolchainError, match="cannot be started"):
        run(["true", "a\0b"])
    with pytest.raises(UsageError, match="compiler must be a text"):
        Options(compiler=3)  # type: ignore[arg-type]


def test_products_are_looked_at(sources: dict[str, str], fresh_cache: Cache, tmp_path: Path) -> None:
    artifact = compile_c_library(sources, "pendulum")
    good = artifact.path.read_bytes()
    mark = stamp(artifact.key, "pendulum.c.o")
    require_library(artifact.path, [mark], ["cc"])
    assert sorted(path.name for path in artifact.directory.iterdir()) == ["libpendulum.so", "manifest.json", "sources"]
    for data, words in (
        (b"", "was not made"),
        (b"garbage", "not a library for this machine"),
        (good[:18] + b"\xff\xff" + good[20:], "not a library for this machine"),
        (good[:16] + b"\x02\x00" + good[18:], "not a library for this machine"),
        (good.replace(mark, b"?" * len(mark)), "lacks the mark"),
    ):
        (tmp_path / "made").write_bytes(data)
        with pytest.raises(ToolchainError, match=f"reports success, but .*made.*{words}"):
            require_library(tmp_path / "made", [mark], ["cc"])
    with pytest.raises(ToolchainError, match="was not made"):
        require_object(tmp_path / "nothing", mark, ["cc"])
    with pytest.raises(ToolchainError, match="is not what was compiled"):
        require_object(tmp_path / "made", mark, ["cc"])
    (tmp_path / "made").write_bytes(b"\x7fELF .gnu.lto_main")  # tells nothing before it is linked
    require_object(tmp_path / "made", mark, ["cc"])


def test_link_time_optimisation_keeps_the_marks(sources: dict[str, str], fresh_cache: Cache) -> None:
    flags = ["-flto", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections"]
    assert compile_c_library(sources, "pendulum", Options(extra=flags)).path.is_file()
    assert compile_c_library(sources, "pendulum", Options(warnings=True, extra=["-Wpedantic"])).path.is_file()


def test_a_library_that_cannot_be_loaded_is_not_kept(sources: dict[str, str]) -> None:
    cache = Cache(cache_directory())
    text = sources["pendulum.c"].replace("#include <math.h>", "#include <math.h>\ndouble missing(double);", 1)
    broken = {**sources, "pendulum.c": text.replace("-c[4] * cos(x[0])", "missing(x[0])")}
    artifact = compile_sources(broken, "pendulum")
    with pytest.raises(ToolchainError, match="missing.*removed from the cache; compile the model again"):
        load_core(artifact)
    assert cache.find(artifact.key) is None
