"""Compilers that are missing, hang, print without end, lie or fail; options of the compilation."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from command import run
from refusals import refused, refuses


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache for each test, and the compiler that is found without CC."""
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)


@pytest.fixture
def shell(tmp_path: Path) -> Callable[[str], str]:
    """A compiler that is a shell script."""

    def make(text: str) -> str:
        path = tmp_path / f"cc{len(list(tmp_path.iterdir()))}"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o755)
        return str(path)

    return make


VERSION = 'case "$*" in *--version*) exec gcc --version;; esac\n'


def write_unit(folder: Path) -> Path:
    return models.build("pendulum").derive().write_fmu(folder / "pendulum.fmu")


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


def test_a_compiler_that_hangs_is_killed_with_its_children(
    shell: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(
        "CC", shell(VERSION + f"(sleep 100; touch {tmp_path}/lived) & echo $! > {tmp_path}/child; echo said; wait")
    )
    monkeypatch.setenv("EOMGEN_COMPILER_SECONDS", "2")
    refuses("EG-COMPILER-FAILED 2 EOMGEN_COMPILER_SECONDS", write_unit, tmp_path)
    children = (tmp_path / "child").read_text().split()
    while any(alive(int(pid)) for pid in children):
        time.sleep(0.01)
    assert not (tmp_path / "lived").exists()
    assert not (tmp_path / "pendulum.fmu").exists()


@pytest.mark.parametrize("nonsense", ["soon", "-1", "0", "nan", "inf"])
def test_seconds_are_a_positive_number(nonsense: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EOMGEN_COMPILER_SECONDS", nonsense)
    refuses(f"EG-RANGE EOMGEN_COMPILER_SECONDS '{nonsense}'", write_unit, tmp_path)


@pytest.mark.thorough
def test_output_has_a_bound(shell: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", shell(VERSION + "exec yes"))
    with refused("EG-COMPILER-FAILED MB") as raised:
        write_unit(tmp_path)
    assert len(str(raised.value)) < 10_000


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("gcc 'x", "is not a command"), ("/nowhere/cc", "not found"), ("{folder}", "a directory"),
        ("{folder}/plain", "not executable"), ("{folder}/elf", "cannot be started"),
        ("/bin/sh -c :", "prints nothing for --version"), ("/bin/sh -c 'exit 7'", "exit status 7"),
    ],
)  # fmt: skip
def test_a_wished_compiler_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, words: str
) -> None:
    (tmp_path / "plain").write_text("")
    (tmp_path / "elf").write_bytes(b"\x7fELF nonsense")
    (tmp_path / "elf").chmod(0o755)
    monkeypatch.setenv("CC", command.format(folder=tmp_path))
    with refused("EG-COMPILER-MISSING CC") as raised:
        write_unit(tmp_path)
    assert words in str(raised.value)
    call = models.build("pendulum").compile
    refuses("EG-COMPILER-MISSING compiler nothing-like-it:", call, compiler="nothing-like-it")


def test_a_compiler_may_have_a_relative_name_and_a_blank_one_is_none(
    shell: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = Path(shell('exec gcc "$@"')).name
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", f"./{name}")
    assert write_unit(tmp_path).is_file()
    monkeypatch.setenv("CC", " ")
    assert run("doctor").code == 0


def test_no_compiler(tmp_path: Path) -> None:
    """In a process whose path has none: what was looked for, and what to install."""
    code = (
        "import importlib.util as u; find = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'ziglang' else find(name, *rest)\n"
        "import eomgen as eg; eg.load_example('pendulum').derive().write_fmu('x.fmu')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={"PATH": str(tmp_path), "EOMGEN_CACHE_DIR": str(tmp_path / "cache"), "HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode != 0
    for words in ("No C compiler", "gcc: not found", "clang: not found", "apt install", "ziglang", 'target="numpy"'):
        assert words in done.stderr


def test_what_fails_is_quoted_and_kept_to_be_looked_at(
    shell: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", shell(VERSION + 'case "$*" in *" -c "*) echo not today >&2; exit 1;; esac\nexec gcc "$@"'))
    with refused("EG-COMPILER-FAILED today -ffp-contract=off") as raised:
        write_unit(tmp_path)
    attempt = next(path for path in (tmp_path / "cache" / "attempts").iterdir() if str(path) in str(raised.value))
    assert list(attempt.rglob("*.c"))
    assert list((tmp_path / "cache" / "entries").iterdir()) == []


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('case "$*" in *-shared*) exit 0;; esac', "was not made"),
        ('case "$*" in *-shared*) out=$(echo "$*" | sed "s/.*-o \\([^ ]*\\).*/\\1/"); echo lie > $out; exit 0;; esac',
         "not a library for this machine"),
        ('case "$*" in *" -c "*) exit 0;; esac', "was not made"),
    ],
)  # fmt: skip
def test_products_are_looked_at(
    shell: Callable[[str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: str, words: str
) -> None:
    """Of a compiler that reports success."""
    monkeypatch.setenv("CC", shell(f'{VERSION}{lines}\nexec gcc "$@"'))
    with refused("EG-COMPILER-FAILED success") as raised:
        write_unit(tmp_path)
    assert words in str(raised.value)


def test_a_model_needs_no_headers_of_python_and_no_cython(shell: Callable[[str], str], tmp_path: Path) -> None:
    code = (
        "import sys, sysconfig; sysconfig.get_path = lambda name, *rest: '/nowhere'\n"
        "sys.modules['Cython'] = None\n"
        "import eomgen as eg; print(eg.load_example('pendulum').compile().rhs(0.0, [0.0, 2.0])[0])"
    )
    given = {"CC": shell('exec gcc "$@"'), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False,
        env=given | {"EOMGEN_CACHE_DIR": str(tmp_path / "cache")},
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("2.0\n", "")


@pytest.mark.parametrize(
    ("options", "demand"),
    [
        ({"optimize": 7}, "EG-CHOICE optimize 0 3 7"), ({"extra": "-g"}, "EG-TYPE extra '-g'"),
        ({"lanes": 3}, "EG-CHOICE lanes 8 3"), ({"compiler": 3}, "EG-TYPE compiler 3"),
        ({"extra": ["-fno-such-flag"]}, "EG-COMPILER-FAILED -fno-such-flag"), ({"jobs": 0}, "EG-RANGE jobs 0"),
        ({"kernels": ["motion"]}, "EG-NAME-UNKNOWN 'motion' 'motion_axes'?"),
        ({"optimise": 1}, "EG-NAME-UNKNOWN optimise"),
    ],
)  # fmt: skip
def test_wrong_options_are_named(options: dict[str, Any], demand: str) -> None:
    refuses(demand, models.build("pendulum").compile, **options)


@pytest.mark.quick
def test_kernels_that_were_not_requested_are_named() -> None:
    module = models.build("slider_crank").compile(target="numpy", kernels=["rhs", "project"])
    x = np.array([0.3, -0.4, 0.4, 1.0, -1.2, 0.0])
    assert module.rhs(0.0, x).shape == (6,)
    refuses("EG-UNSUPPORTED 'energy' kernels", module.energy, x)
