"""What every test run shares: slow tests last, and ``--no-skips`` for the run that counts."""

from __future__ import annotations

import os
import shutil
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from outside_programs import PROGRAMS, missing

CACHE = pytest.StashKey[str]()
#: Scripts that made reference numbers with other programs, which need not be installed.
collect_ignore_glob = ["reference/*.py"]
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
    config.stash[CACHE] = os.environ["EOMGEN_CACHE_DIR"]
    lacking = [name for name in (*PROGRAMS, "NVRTC") if not is_there(name)]
    if config.getoption("--programs") and lacking:
        raise pytest.UsageError(f"--programs was given, and there is no {', no '.join(lacking)}")


def pytest_unconfigure(config: pytest.Config) -> None:
    if not is_worker(config):
        shutil.rmtree(config.stash[CACHE], ignore_errors=True)


def is_worker(config: pytest.Config) -> bool:
    """Whether this process runs a part of the tests for another, whose cache it shares."""
    return hasattr(config, "workerinput")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skips", action="store_true", help="fail the run when a test was skipped or expected to fail")
    parser.addoption("--programs", action="store_true", help="fail where what some tests need is missing, a GPU apart")
    parser.addoption("--thorough", action="store_true", help="run also what is marked thorough, as make thorough does")


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
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
    items[:] = [item for item in items if item not in left_out]
    items.sort(key=lambda item: (item.get_closest_marker("slow") is not None, "acceptance" in item.path.parts))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
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
    if left_out and exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
        reporter.write_line(f"{len(left_out)} skipped or expected to fail, and --no-skips was given", red=True)


@pytest.fixture
def warm_cache(tmp_path: Path, pytestconfig: pytest.Config) -> Path:
    """A cache of the test's own that holds the Cython layer, which takes half a minute to build, and nothing else."""
    from eomgen.compilation import Cache

    root = tmp_path / "cache"
    entries = root / "entries"
    entries.mkdir(parents=True, mode=0o700)
    root.chmod(0o700)
    for entry in Cache(Path(pytestconfig.stash[CACHE])).entries():
        if entry.kind == "layer":
            shutil.copytree(entry.directory, entries / entry.directory.name)
    return root
