"""Libraries for C compile the integrators once for all models: what is shared, and what must be made anew."""

from __future__ import annotations

import ctypes

import pytest

from eomgen.compilation import Cache, Options, compile_c_library
from eomgen.errors import ToolchainError
from eomgen.layer import read_header, read_layer

HEADERS = ("eomgen_steppers.h", "eomgen_loop.h", "eomgen_methods.h")
SEVEN = """\
#include <stddef.h>
#include "eomgen_steppers.h"
int seven(void);
int seven(void) { return 7; }
"""


@pytest.fixture
def library(sources: dict[str, str]) -> dict[str, str]:
    """The pendulum's sources and the steppers' headers; in the place of the steppers one function, quick to compile."""
    layer = read_layer()
    texts = {**sources, "eomgen_real.h": read_header("eomgen_real.h"), **{name: layer[name] for name in HEADERS}}
    return {**texts, "eomgen_steppers.c": SEVEN}


def shared(cache: Cache) -> set[str]:
    return {entry.key for entry in cache.entries() if entry.kind == "object"}


def test_a_second_model_takes_the_object_of_the_first(library: dict[str, str], fresh_cache: Cache) -> None:
    said: list[str] = []
    first = compile_c_library(library, "pendulum", progress=said.append, steppers=True)
    assert [line for line in said if "eomgen_steppers.c" in line] == ["compiling eomgen_steppers.c (once)"]
    made = shared(fresh_cache)
    assert len(made) == 1
    said.clear()
    other = {**library, "pendulum.h": library["pendulum.h"] + "/* another model */\n"}
    second = compile_c_library(other, "pendulum", progress=said.append, steppers=True)
    assert second.key != first.key
    assert not second.from_cache
    assert not any("eomgen_steppers.c" in line for line in said)
    assert shared(fresh_cache) == made
    for artifact in (first, second):
        assert ctypes.CDLL(str(artifact.path)).seven() == 7


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ("eomgen_steppers.c", Options()),
        ("eomgen_loop.h", Options()),
        ("eomgen.h", Options()),
        (None, Options(optimize=0)),
        (None, Options(extra=("-DEXTRA",))),
    ],
)
def test_texts_and_flags_make_another_object(
    library: dict[str, str], fresh_cache: Cache, file: str | None, options: Options
) -> None:
    compile_c_library(library, "pendulum", steppers=True)
    changed = library if file is None else {**library, file: library[file] + "\n/* changed */\n"}
    compile_c_library(changed, "pendulum", options, steppers=True)
    assert len(shared(fresh_cache)) == 2


def test_without_steppers_nothing_is_shared(library: dict[str, str], fresh_cache: Cache) -> None:
    compile_c_library(library, "pendulum")
    assert shared(fresh_cache) == set()


def test_what_does_not_compile_is_told_and_not_kept(library: dict[str, str], fresh_cache: Cache) -> None:
    library["eomgen_steppers.c"] += "this is no C\n"
    with pytest.raises(ToolchainError, match=r"compiling .*eomgen_steppers\.c failed"):
        compile_c_library(library, "pendulum", steppers=True)
    assert fresh_cache.entries() == []


def test_a_damaged_object_is_made_again(library: dict[str, str], fresh_cache: Cache) -> None:
    compile_c_library(library, "pendulum", steppers=True)
    (entry,) = (entry for entry in fresh_cache.entries() if entry.kind == "object")
    entry.product.chmod(0o600)
    entry.product.write_bytes(entry.product.read_bytes()[:100])
    library["pendulum.h"] += "/* another model */\n"
    artifact = compile_c_library(library, "pendulum", steppers=True)
    assert ctypes.CDLL(str(artifact.path)).seven() == 7
