"""Faults of machines: a run of the pendulum under a fault, and the run after it, each in a process of its own.

A fault is survived if the run gives the right number, or stops with an error of eomgen's own (or was killed by the fault),
and if the run after it, with the fault gone, gives the right number.  Anything else is a breach: another number, a
traceback, a crash, a hang.
"""

import math
import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from children import HANGS

ROOT = Path(__file__).parents[2]
MODEL = ROOT / "examples" / "pendulum.yaml"
VALUE = -9.81 * math.sin(0.5)  #: the acceleration at 0.5 rad
STRANGER = 12345  #: a user id that nobody has
CHILD = """
import os, sys
def tell(text):
    os.write(int(os.environ["EOMGEN_TOLD"]), text.encode("utf-8", "replace"))
{before}
import eomgen as eg
try:
    module = eg.load({model!r}).compile(target={target!r}, kernels=["rhs"])
    tell("VALUE %.17g" % module.rhs(0.0, [0.5, 0.25])[1])
except eg.EomgenError as error:
    tell("NAMED %s: %s" % (type(error).__name__, error))
"""
THOROUGH = pytest.mark.thorough
TARGETS = pytest.mark.parametrize("target", ["numpy", pytest.param("cython", marks=THOROUGH)])
Changes = dict[str, str | None]  #: of the environment; None removes


def run(cache: Path | str, target: str, before: str = "", changes: Changes | None = None, home: Path = ROOT,
        value: float = VALUE) -> str:  # fmt: skip
    """What a run came to: ``right``, ``named: ...``, ``killed``, or a breach, in words."""
    environment = {**os.environ, "EOMGEN_CACHE_DIR": str(cache), "PYTHONPATH": str(home), "PYTHONSAFEPATH": "1"}
    environment.pop("CC", None)
    for name, text in (changes or {}).items():
        environment.pop(name, None)
        if text is not None:
            environment[name] = text
    code = CHILD.format(before=before, model=str(MODEL), target=target)
    tell, told = os.pipe()
    with subprocess.Popen(
        [sys.executable, "-c", code], env={**environment, "EOMGEN_TOLD": str(told)}, pass_fds=(told,),
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
    ) as process, open(tell, "rb") as stream:  # fmt: skip
        os.close(told)
        try:
            err = process.communicate(timeout=HANGS)[1].decode("utf-8", "replace")
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs"
        said = stream.read().decode("utf-8", "replace")
    if process.returncode == -signal.SIGKILL:
        return "killed"
    if "Traceback" in err or process.returncode != 0:
        return f"exit {process.returncode}: {err.strip()[-900:]}"
    word, _, rest = said.partition(" ")
    if word == "NAMED":
        return f"named: {rest}"
    return "right" if word == "VALUE" and abs(float(rest) - value) <= 1e-12 else f"wrong: {said}"


def survived(fault: str, outcome: str, *, after: str) -> str:
    assert outcome.startswith(("right", "named", "killed")), f"{fault}: {outcome}"
    assert after == "right", f"after {fault}: {outcome}, then {after}"
    return outcome


# -- builds that are killed, that meet, whose files are damaged ---------------------------------------------------------
#: Kills the process when it changes the cache for the n-th time.
AT_CHANGE = """
import signal
root, left = os.environ["EOMGEN_CACHE_DIR"], [{n}]
CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.chmod", "os.utime", "subprocess.Popen")
def hook(event, args):
    writes = event == "open" and isinstance(args[2], int) and args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
    if (writes or event in CHANGES) and root in repr(args):
        left[0] -= 1
        if left[0] == 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(hook)
"""


@pytest.mark.parametrize(
    ("target", "step"),
    [("numpy", 9), pytest.param("numpy", 1, marks=THOROUGH), pytest.param("cython", 3, marks=THOROUGH)],
)
def test_a_build_that_is_killed_at_a_change_of_the_cache(target: str, step: int, tmp_path: Path) -> None:
    """In a new cache, for every change until the build is through; what was left behind is no hindrance."""
    outcome, n = "killed", 1 - step
    while outcome == "killed":
        n += step
        cache = tmp_path / f"cache{n}"
        outcome = run(cache, target, AT_CHANGE.format(n=n))
        survived(f"kill -9 at change {n}", outcome, after=run(cache, target))
    assert outcome == "right"
    assert n > step


@pytest.mark.parametrize(
    ("target", "processes"),
    [("numpy", 3), pytest.param("numpy", 20, marks=THOROUGH), pytest.param("cython", 12, marks=THOROUGH)],
)
def test_many_processes_at_once(target: str, processes: int, tmp_path: Path) -> None:
    """Nothing there yet, some of them killed meanwhile."""
    chance = random.Random(1)
    deaths = [chance.randrange(1, 20) if k % 3 == 2 else 0 for k in range(processes)]
    with ThreadPoolExecutor(processes) as pool:
        found = list(pool.map(lambda n: run(tmp_path / "cache", target, AT_CHANGE.format(n=n) if n else ""), deaths))
    assert {outcome for outcome, n in zip(found, deaths, strict=True) if not n} == {"right"}, found
    assert set(found) <= {"right", "killed"}
    assert run(tmp_path / "cache", target) == "right"


def flip(path: Path, where: float) -> None:
    data = bytearray(path.read_bytes())
    data[int(where * (len(data) - 1))] ^= 16
    path.write_bytes(data)


def replace(path: Path, make: Callable[[Path], object]) -> None:
    path.unlink()
    make(path)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut to half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "a bit flipped in the middle": lambda path: flip(path, 0.5),
    "cut to nothing": lambda path: path.write_bytes(b""),
    "cut by 1 byte": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "a bit flipped at the end": lambda path: flip(path, 1.0),
    "a byte longer": lambda path: path.write_bytes(path.read_bytes() + b"x"),
    "removed": Path.unlink,
    "made a folder": lambda path: replace(path, Path.mkdir),
    "made a link": lambda path: replace(path, lambda path: path.symlink_to("/etc/passwd")),
    "made a pipe": lambda path: replace(path, lambda path: os.mkfifo(path, 0o600)),
}


@TARGETS
@pytest.mark.parametrize(
    "damage", [*list(DAMAGES)[:1], *(pytest.param(name, marks=THOROUGH) for name in list(DAMAGES)[1:])]
)
def test_damaged_files_of_a_build(damage: str, target: str, tmp_path: Path) -> None:
    """Every file of the cache under the damage, one after the other."""
    assert run(tmp_path / "cache", target) == "right"
    files = sorted(path for path in (tmp_path / "cache").rglob("*") if path.is_file() and path.stat().st_size)
    assert files
    for file in files:
        if file.is_file():  # what was made again may go by another name
            DAMAGES[damage](file)
            outcome = run(tmp_path / "cache", target)
            assert outcome == "right", f"{file.relative_to(tmp_path)} {damage}: {outcome}"
    assert run(tmp_path / "cache", target) == "right"


@pytest.mark.thorough
def test_files_that_are_open_to_others_are_never_loaded(tmp_path: Path) -> None:
    """Every folder and file of a cache, and a folder above, given to another user or opened to all."""
    above, cache = tmp_path / "above", tmp_path / "above" / "cache"
    above.mkdir(mode=0o700)
    assert run(cache, "cython") == "right"
    entries = [path for path in cache.rglob("*") if path.is_dir() or path.suffix in (".so", ".json", ".c")]
    for path in [above, cache, *entries]:
        status = path.stat()
        if os.geteuid() == 0:  # only root can give files away
            os.chown(path, STRANGER, -1)
            outcome = run(cache, "cython")
            os.chown(path, status.st_uid, -1)
            survived(f"{path.name} of another user", outcome, after=run(cache, "cython"))
        for mode in (0o777, 0o722):
            path.chmod(mode)
            outcome = run(cache, "cython")
            path.chmod(status.st_mode & 0o7777)
            survived(f"{path.name} with mode {mode:o}", outcome, after=run(cache, "cython"))
            assert outcome.startswith("named") and "EOMGEN_CACHE_DIR" in outcome, (path, outcome)  # noqa: PT018


# -- places and environments -------------------------------------------------------------------------------------------
FILE_SIZE = """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))
"""


@TARGETS
@pytest.mark.parametrize(
    "size", [*(pytest.param(n, marks=THOROUGH) for n in (0, 1, 1000, 100, 10_000, 50_000, 200_000))]
)
def test_a_full_disk(size: int, target: str, tmp_path: Path) -> None:
    """Files that cannot grow beyond a size, compilers' included."""
    outcome = run(tmp_path / "cache", target, FILE_SIZE.format(size=size))
    survived(f"no file beyond {size} bytes", outcome, after=run(tmp_path / "cache", target))


PLACES = (
    "l\u00e9 '\"\n*\\", "a*", "$(x);&|`y`%s", "a\\", "#a:b", "-o", "x" * 200, os.fsdecode(b"\xc3\xa9\xff"),
)  # fmt: skip
NO_LOCALE: Changes = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@TARGETS
@pytest.mark.parametrize("place", [PLACES[0], *(pytest.param(name, marks=THOROUGH) for name in PLACES[1:])], ids=ascii)
def test_odd_paths_under_the_poorest_locale(place: str, target: str, tmp_path: Path) -> None:
    (tmp_path / place).mkdir(mode=0o700)
    cache = tmp_path / place / "cache"
    assert run(cache, target, changes=NO_LOCALE) == "right"
    assert run(cache, target, changes={**NO_LOCALE, "LC_ALL": "xx_YY.nothing"}) == "right"


#: What is odd -> lines before the package is imported, and changes of the environment.
ODD: dict[str, tuple[str, Changes]] = {
    "no home at all": (
        "import pwd; os.environ.pop('HOME', None); pwd.getpwuid = lambda uid: {}['nobody']",
        {"EOMGEN_CACHE_DIR": None, "XDG_CACHE_HOME": None},
    ),
    "umask 0": ("os.umask(0)", {}),
    "no TMPDIR": ("", {"TMPDIR": "/nowhere/at/all"}),
    "umask 777": ("os.umask(0o777)", {}),
    "umask 002": ("os.umask(2)", {}),
    "no PATH": ("", {"PATH": ""}),
    "no current folder": ("import tempfile; os.chdir(tempfile.mkdtemp()); os.rmdir(os.getcwd())", {}),
    "closed streams": ("os.close(0); os.close(1); os.close(2)", {}),
    "20 open files": ("import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (20, 20))", {}),
    "a clock 30 years ahead": ("import time; clock = time.time; time.time = lambda: clock() + 1e9", {}),
    "a clock 30 years behind": ("import time; clock = time.time; time.time = lambda: clock() - 1e9", {}),
    "a home that is a file": ("", {"EOMGEN_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": "/etc/passwd"}),
    "a home in /proc": ("", {"EOMGEN_CACHE_DIR": None, "XDG_CACHE_HOME": None, "HOME": "/proc/nowhere"}),
    "a cache of no user": ("", {"EOMGEN_CACHE_DIR": "~nobody_of_this_name/cache"}),
    "a cache in a file": ("", {"EOMGEN_CACHE_DIR": "/etc/passwd/cache"}),
    "a cache in /dev/null": ("", {"EOMGEN_CACHE_DIR": "/dev/null"}),
    "a cache with too long a name": ("", {"EOMGEN_CACHE_DIR": "/tmp/" + "x" * 300}),
    "a cache with too long a path": ("", {"EOMGEN_CACHE_DIR": "/tmp" + "/x" * 3000}),
}


@TARGETS
@pytest.mark.parametrize("name", [pytest.param(name, marks=THOROUGH) for name in ODD])
def test_odd_environments(name: str, target: str, tmp_path: Path) -> None:
    before, changes = ODD[name]
    outcome = run(tmp_path / "cache", target, before, changes)
    survived(name, outcome, after=run(tmp_path / "cache", target))


# -- compilers and versions --------------------------------------------------------------------------------------------
VERSION = '[ "$1" = --version ] && exec gcc --version'
OUTPUT = 'out=; last=; for word; do [ "$last" = -o ] && out=$word; last=$word; done'
LINKS = 'case " $* " in *" -c "*) exec gcc "$@";; esac'
COMPILERS = {
    "hangs behind a child": "sleep 900 & wait",
    "prints without end": "exec yes",
    "hangs in compiling": f"{VERSION}\nsleep 600",
    "prints without end in compiling": f"{VERSION}\nexec yes nonsense",
    "dies in compiling": f"{VERSION}\nkill -SEGV $$",
    "leaves a child that holds its output": 'sleep 900 &\nexec gcc "$@"',
    "makes nothing": f"{VERSION}\nexit 0",
    "makes empty files": f'{VERSION}\n{OUTPUT}\n: > "$out"',
    "makes garbage": f'{VERSION}\n{OUTPUT}\necho garbage > "$out"',
    "makes garbage when linking": f'{VERSION}\n{LINKS}\n{OUTPUT}\necho garbage > "$out"',
    "links another model": f'{VERSION}\n{LINKS}\n{OUTPUT}\ncp OTHER "$out"',
    "compiles another source": f'{VERSION}\ncase " $* " in *" -c "*) ;; *) exec gcc "$@";; esac\n{OUTPUT}\n'
    'echo "int other;" | gcc -x c -c - -o "$out"',
    "leaves out a function": f'{VERSION}\n{LINKS}\nexec gcc "$@" -Wl,--wrap=sin',
}  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("name", COMPILERS)
def test_compilers_that_are_broken_and_then_mended(name: str, tmp_path: Path) -> None:
    """Under the same name and version: nothing of a lie is kept."""
    other, compiler, cache = tmp_path / "other", tmp_path / "cc", tmp_path / "cache"
    assert run(other, "cython") == "right"
    product = next(path for path in other.rglob("libpendulum.so"))
    product.write_bytes(product.read_bytes().replace(b"pendulum", b"pendulom"))
    compiler.write_text(f"#!/bin/sh\n{COMPILERS[name]}\n".replace("OTHER", str(product)))
    compiler.chmod(0o755)
    changes: Changes = {"CC": str(compiler), "EOMGEN_COMPILER_SECONDS": "15"}
    outcome = run(cache, "cython", changes=changes)
    compiler.write_text('#!/bin/sh\nexec gcc "$@"\n')
    survived(f"a compiler that {name}", outcome, after=run(cache, "cython", changes={"CC": str(compiler)}))
    assert outcome.startswith("named") or name.startswith("leaves a child"), outcome


@pytest.mark.thorough
@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_two_versions_on_one_cache(target: str, tmp_path: Path) -> None:
    """One takes sines for their negatives: what either made never serves the other, in turns and at once."""
    for name in ("eomgen", "eomgen/templates", "eomgen/examples"):
        source = ROOT / name.removeprefix("eomgen/")
        shutil.copytree(source, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__", "built"))
    for file, old, new in (
        ("eomgen/__init__.py", '__version__ = "', '__version__ = "9.'),
        ("eomgen/native/eomgen_real.h", "*sine = (pack)(", "*sine = -(pack)("),
        ("eomgen/base/operations.py", 'c="sine_of({})"', 'c="sine_of({})", numpy="(-np.sin({}))"'),
    ):
        text = (tmp_path / file).read_text(encoding="utf-8")
        assert old in text, file
        (tmp_path / file).write_text(text.replace(old, new), encoding="utf-8")
    versions = [(ROOT, VALUE), (tmp_path, -VALUE)]
    cache = tmp_path / "cache"
    with ThreadPoolExecutor(8) as pool:
        found = list(
            pool.map(lambda k: run(cache, target, home=versions[k % 2][0], value=versions[k % 2][1]), range(8))
        )
    found += [run(cache, target, home=home, value=value) for home, value in (*versions, *reversed(versions))]
    assert set(found) == {"right"}
