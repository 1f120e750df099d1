"""What every test run shares: slow tests last, and ``--no-skips`` for the run that counts."""

import os
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from outside_programs import PROGRAMS, missing

from eomgen.toolchain.native import find_native

CACHE = pytest.StashKey[str]()
#: Most builds in C in the shared cache by ``make test``, beside the 20 of tests that have caches of their own.
BUILDS = 150
QUICK = pytest.StashKey[set[str]]()
#: What ``--quick`` runs a folder of tests for: the packages of eomgen that it guards.
ROOMS = {
    "mechanics": "elements mechanics",
    "forces": "contact elements",
    "runs": "analysis runtime",
    "model": "api base importers model",
    "code": "api base codegen toolchain",
    "shown": "base cli explain reading show",
    "core": "base expr pipeline verify",
    "attack": "base importers model",
}
#: What some tests need beside the programs of outside_programs: a mark ``needs(name)`` leaves a test out where there is
#: none, and the end of the run says so.  Libraries of Python: name -> its module, and how it is installed.
LIBRARIES = {
    "PyDy": ("pydy", "pip install pydy"),
    "NVRTC": ("cuda.bindings.nvrtc", "pip install '.[cuda]'"),
    "CuPy": ("cupy", "pip install cupy-cuda13x"),
    "PyTorch": ("torch", "pip install torch"),
    "Numba": ("numba.cuda", "pip install numba-cuda"),
}
#: The same for instructions of the processor: name -> what Linux calls them.
INSTRUCTIONS = {"x86-64": "lm", "AVX2": "avx2", "AVX-512": "avx512dq"}
#: The same for a GPU of NVIDIA: name -> where Linux has it.
DEVICES = {"a GPU": "/dev/nvidiactl"}


def pytest_configure(config: pytest.Config) -> None:
    """Compiled modules go to a cache of this run: every test shares it, and the user's own stays as it is."""
    # a busy machine is slow, not wrong
    settings.register_profile("eomgen", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile("eomgen")
    if not is_worker(config):
        os.environ["EOMGEN_CACHE_DIR"] = tempfile.mkdtemp(prefix="eomgen-tests-")
        if not config.getoption("--quick"):
            find_native()  # built anew if its sources were changed, once for all tests
    config.stash[CACHE] = os.environ["EOMGEN_CACHE_DIR"]
    lacking = [name for name in (*PROGRAMS, "NVRTC") if not is_there(name)]
    if config.getoption("--programs") and lacking:
        raise pytest.UsageError(f"--programs was given, and there is no {', no '.join(lacking)}")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not is_worker(config):
        shutil.rmtree(config.stash[CACHE], ignore_errors=True)


def count_builds(config: pytest.Config) -> int:
    """Models, lanes, libraries and objects in C in the cache of this run; entries of target numpy have no object."""
    return sum(any(entry.glob("*.*o")) for entry in Path(config.stash[CACHE], "entries").glob("*"))


def is_worker(config: pytest.Config) -> bool:
    """Whether this process runs a part of the tests for another, whose cache it shares."""
    return hasattr(config, "workerinput")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="fail the run when a test was skipped or expected to fail")
    parser.addoption("--programs", action="store_true", help="fail where what some tests need is missing, a GPU apart")
    parser.addoption("--quick", action="store_true", help="tests marked quick, for what differs from the last commit")
    parser.addoption("--thorough", action="store_true", help="run also what is marked thorough, as make thorough does")


def rooms_touched() -> set[str]:
    """Folders of tests for what differs from the last commit; all of them where that is nothing, or shared by all."""
    chosen: set[str] = set()
    for words in (["diff", "--name-only", "HEAD"], ["ls-files", "--others", "--exclude-standard"]):
        command = ["git", "-C", str(Path(__file__).parents[1]), *words]
        for path in subprocess.run(command, capture_output=True, text=True).stdout.splitlines():
            top, _, rest = path.partition("/")
            part = rest.partition("/")[0].removesuffix(".py")
            if top in ("docs", "notebooks", "benchmarks") or top.endswith(".md"):
                continue
            if top == "tests" and part in ROOMS:
                chosen.add(part)
            elif top == "eomgen" and (rooms := {room for room, parts in ROOMS.items() if part in parts.split()}):
                chosen |= rooms
            else:
                return set(ROOMS)
    return chosen or set(ROOMS)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With ``--quick`` only files of the rooms touched are read, and of these the ones that have a test so marked."""
    if not config.getoption("--quick") or collection_path.is_dir():
        return None
    if QUICK not in config.stash:
        config.stash[QUICK] = rooms_touched()
    inside = collection_path.relative_to(Path(__file__).parent).parts
    return inside[0] not in config.stash[QUICK] or "mark.quick" not in collection_path.read_text(encoding="utf-8")


def is_there(program: str) -> bool:
    """Whether it is on the path, installed, in the processor or in the computer; by the table that names it."""
    if program in PROGRAMS:
        return program not in missing()
    if program in DEVICES:
        return Path(DEVICES[program]).exists()
    if program in INSTRUCTIONS:
        info = Path("/proc/cpuinfo")
        return info.exists() and INSTRUCTIONS[program] in info.read_text().split()
    try:
        return find_spec(LIBRARIES[program][0]) is not None
    except ModuleNotFoundError:  # a package above it
        return False


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    needs = {item: [name for mark in item.iter_markers("needs") for name in mark.args] for item in items}
    left_out = {item for item in items if not all(map(is_there, needs[item]))}
    if not config.getoption("--thorough"):
        left_out |= {item for item in items if item.get_closest_marker("thorough") is not None}
    if config.getoption("--quick"):
        left_out |= {item for item in items if item.get_closest_marker("quick") is None}
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
    items[:] = [item for item in items if item not in left_out]
    items.sort(key=lambda item: item.get_closest_marker("slow") is not None)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    terminalreporter.write_line(f"builds in C: {count_builds(terminalreporter.config)}")
    if terminalreporter.config.getoption("--quick"):
        chosen = [room for room in ROOMS if room in terminalreporter.config.stash.get(QUICK, ROOMS)]
        terminalreporter.write_line(f"for what differs from the last commit: quick tests of {', '.join(chosen)}")
        return
    told = {name: f"apt install {package}" for name, (_, package) in PROGRAMS.items()}
    told |= {name: command for name, (_, command) in LIBRARIES.items()}
    told |= dict.fromkeys(INSTRUCTIONS, "take a processor that has them")
    told |= dict.fromkeys(DEVICES, "take a computer with one of NVIDIA and pip install '.[cuda]'")
    if not terminalreporter.config.getoption("--thorough"):
        terminalreporter.write_line("tests marked thorough were left out; to run them: make thorough")
    for name, command in told.items():
        if not is_there(name):
            terminalreporter.write_line(f"tests that need {name} were left out; to run them: {command}")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    if not session.config.getoption("--no-skips"):
        return
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    left_out = [r for kind in ("skipped", "xfailed") for r in reporter.stats.get(kind, [])]
    wrong = [f"{len(left_out)} skipped or expected to fail, and --no-skips was given"] if left_out else []
    if not session.config.getoption("--thorough") and (builds := count_builds(session.config)) > BUILDS:
        wrong.append(f"{builds} builds in C, of at most {BUILDS}")
    if wrong and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        reporter.write_line("; ".join(wrong), red=True)
