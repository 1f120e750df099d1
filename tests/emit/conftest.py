"""Hand-written systems and the compiler, shared by the tests of this folder and of tests/program."""

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


def load(name):
    full = f"eomgen_test_emit_{name}"
    if full not in sys.modules:
        spec = importlib.util.spec_from_file_location(full, HERE / f"{name}.py")
        sys.modules[full] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[full]


@pytest.fixture(scope="session")
def systems():
    return load("systems")


@pytest.fixture(scope="session")
def libraries(pytestconfig):
    found = load("library")
    found.LEVEL = "-O1" if pytestconfig.getoption("--thorough") else "-O0"
    return found


@pytest.fixture(scope="session")
def compiled(libraries, tmp_path_factory):
    """``compiled(system, **options)`` -> Library with the system's numbers; the same text is compiled once."""
    from eomgen.emit import emit_c

    cache = {}

    def make(system, *flags, **options):
        sources = emit_c(system.program(**options))
        key = (hash(tuple(sources.items())), flags)
        if key not in cache:
            cache[key] = libraries.compile_library(sources, tmp_path_factory.mktemp("c"), *flags)
        return libraries.Library(cache[key], system.p, system.u)

    return make
