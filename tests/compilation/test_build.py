"""Builds and their cache: what changes a key, what is found again, how failures are told."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.compilation import (
    Cache,
    Options,
    cache_directory,
    compile_c_library,
    compile_sources,
    find_compiler,
    installed,
    load_core,
)
from eomgen.compilation import options as options_module
from eomgen.compilation.compiler import CompilerInfo
from eomgen.compilation.options import compile_flags
from eomgen.errors import MissingDependencyError, ToolchainError, UsageError


def script(path: Path, text: str) -> str:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


def test_found_again_and_told(sources: dict[str, str]) -> None:
    sources["pendulum.h"] += "/* told */\n"
    said: list[str] = []
    first = compile_sources(sources, "pendulum", progress=said.append)
    assert not first.from_cache
    assert "compiling pendulum.c" in said
    assert said[-1] == "linking pendulum"
    said.clear()
    second = compile_sources(sources, "pendulum", progress=said.append)
    assert second.from_cache
    assert (second.path, second.key, said) == (first.path, first.key, [])
    assert first.path.parent == first.directory
    assert (first.directory / "sources" / "pendulum.c").read_text() == sources["pendulum.c"]


def test_everything_that_matters_changes_the_key(
    sources: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gcc = shutil.which("gcc")
    other = script(
        tmp_path / "other-gcc", f'[ "$1" = --version ] && echo "gcc 99, Free Software Foundation" || {gcc} "$@"'
    )
    variants: list[tuple[dict[str, str], str, Options]] = [
        (sources, "pendulum", Options()),
        (sources, "swing", Options()),
        (sources, "pendulum", Options(optimize=0)),
        (sources, "pendulum", Options(optimize=2)),
        (sources, "pendulum", Options(native=True)),
        (sources, "pendulum", Options(warnings=True)),
        (sources, "pendulum", Options(extra=["-DEXTRA"])),
        (sources, "pendulum", Options(compiler=other)),
        ({**sources, "pendulum.h": sources["pendulum.h"] + "\n"}, "pendulum", Options()),
        ({**sources, "unused.h": ""}, "pendulum", Options()),
    ]
    keys = [compile_c_library(*variant).key for variant in variants]
    assert len(set(keys)) == len(keys)
    assert compile_c_library(sources, "pendulum", Options(jobs=1)).key == keys[0]
    monkeypatch.setattr(options_module, "GCC_LEVEL", 2)
    assert compile_c_library(sources, "pendulum").key == keys[3]


def test_flags_are_those_measured_to_be_best(monkeypatch: pytest.MonkeyPatch) -> None:
    gcc, clang = (CompilerInfo(kind, (kind,), kind, "") for kind in ("gcc", "clang"))
    for compiler, size, level in ((gcc, 1, 1), (gcc, 10**7, 1), (clang, 1, 2), (clang, 10**7, 1)):
        flags = compile_flags(Options(), compiler, size, hidden=True)
        assert f"-O{level}" in flags
        assert "-ffp-contract=off" in flags
        assert "-ffast-math" not in flags
        assert "-mavx" not in compile_flags(Options(), compiler, size, hidden=True, portable=True)
        for width, wanted in ((2, False), (4, True), (8, True)):
            monkeypatch.setattr(options_module, "lane_width", lambda width=width: width)
            assert ("-mavx" in compile_flags(Options(), compiler, size, hidden=True)) is wanted
            assert "-mavx" not in compile_flags(Options(native=True), compiler, size, hidden=True)
    native = compile_flags(Options(native=True), gcc, 1, hidden=True)
    assert {"-march=native", "-ffp-contract=fast"} <= set(native)


@pytest.mark.needs("x86-64")
def test_a_library_for_others_has_no_instructions_of_this_processor_alone(sources: dict[str, str]) -> None:
    library = compile_c_library(sources, "pendulum").path
    text = subprocess.run(["objdump", "-d", str(library)], capture_output=True, text=True, check=True).stdout
    assert "mulsd" in text
    assert "vmulsd" not in text


@pytest.mark.needs("AVX2")
@pytest.mark.parametrize("name", ["slider_crank", "satellite"])
def test_a_third_register_changes_no_bit(name: str) -> None:
    model = eg.load(models.EXAMPLES / f"{name}.yaml")
    one, other = model.compile(), model.compile(extra=("-mno-avx",))
    x = one.project(one.x0() + 0.01 * np.random.default_rng(0).normal(size=one.n_x))
    found = [(m.rhs(0.0, x), m.jacobian(0.0, x), m.simulate(0.3, x).x) for m in (one, other)]
    assert one.core.__file__ != other.core.__file__
    for own, without in zip(*found, strict=True):
        np.testing.assert_array_equal(own, without)


@pytest.mark.parametrize("options", [Options(optimize=0), Options(native=True, warnings=True)])
def test_options_build_the_same_model(sources: dict[str, str], options: Options) -> None:
    core = load_core(compile_sources(sources, "pendulum", options))
    f = core.state("energy", core.context(), (2,), None)
    np.testing.assert_allclose(f([0.0, 2.0]), [1.0, -9.81])


def test_several_c_files(sources: dict[str, str]) -> None:
    sources["pendulum.h"] += "\ndouble half(double x);\n"
    sources["half.c"] = '#include "pendulum.h"\ndouble half(double x)\n{\n    return 0.5 * x;\n}\n'
    sources["pendulum.c"] = sources["pendulum.c"].replace("out[0] = 0.5 * c[3]", "out[0] = half(c[3])")
    core = load_core(compile_sources(sources, "pendulum"))
    np.testing.assert_allclose(core.state("energy", core.context(), (2,), None)([0.0, 2.0]), [1.0, -9.81])


def test_failed_compilation_is_quoted(sources: dict[str, str], fresh_cache: Cache) -> None:
    sources["pendulum.c"] += "\nint broken(void) { return undeclared_thing; }\n"
    with pytest.raises(ToolchainError) as raised:
        compile_c_library(sources, "pendulum")
    error = raised.value
    assert "undeclared_thing" in error.output
    assert "-ffp-contract=off" in error.command
    assert error.output in str(error)
    assert error.command in str(error)
    (attempt,) = (fresh_cache.root / "attempts").iterdir()
    assert str(attempt / "sources" / "pendulum.c") in str(error)
    assert (attempt / "sources" / "pendulum.c").is_file()  # kept to be looked at
    assert fresh_cache.entries() == []


def test_broken_layer_is_quoted(sources: dict[str, str], fresh_cache: Cache, capsys: Any) -> None:
    with pytest.raises(ToolchainError, match="undeclared name not builtin: nonsense"):
        compile_sources({**sources, "_core.pyx": "x = nonsense\n"}, "pendulum")
    assert fresh_cache.entries() == []
    assert capsys.readouterr().err == ""


def test_no_compiler(sources: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ToolchainError) as raised:
        compile_sources(sources, "pendulum")
    for words in (
        "No C compiler",
        "gcc: not found",
        "clang: not found",
        "apt install",
        "xcode-select",
        "ziglang",
        '"numpy"',
    ):
        assert words in str(raised.value)


@pytest.mark.parametrize("wish", ["/nowhere/cc", "false"])
def test_wished_compiler_is_not_replaced(sources: dict[str, str], monkeypatch: pytest.MonkeyPatch, wish: str) -> None:
    monkeypatch.setenv("CC", wish)
    with pytest.raises(ToolchainError, match=f"environment variable CC does not work(.|\n)*{wish}"):
        compile_sources(sources, "pendulum")
    with pytest.raises(ToolchainError, match="option compiler does not work"):
        compile_sources(sources, "pendulum", Options(compiler="nothing-like-it"))
    assert compile_sources(sources, "pendulum", Options(compiler="gcc")).path.is_file()


def test_kinds_of_compilers(tmp_path: Path) -> None:
    assert find_compiler("gcc").kind == "gcc"
    clang = script(tmp_path / "cc-18", "echo Debian clang version 18.1")
    assert find_compiler(f"{clang} -m64").command == (clang, "-m64")
    assert find_compiler(clang).kind == "clang"
    zig = find_compiler(script(tmp_path / "zig", '[ $1 = version ] && echo 0.17 || echo "clang version 20"') + " cc")
    assert (zig.kind, zig.version) == ("zig", "clang version 20\nzig 0.17")
    assert {"-mcpu=baseline", "-fno-sanitize=undefined"} <= set(options_module.layer_flags(zig))
    assert "-mcpu=native" in options_module.machine_flags(Options(native=True), zig)


def test_zig_from_its_package_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ziglang").mkdir()
    (tmp_path / "ziglang" / "__init__.py").touch()
    script(tmp_path / "ziglang" / "zig", "echo clang version 20")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PATH", "/nowhere")
    assert find_compiler().command == (str(tmp_path / "ziglang" / "zig"), "cc")


def test_no_python_headers(
    sources: dict[str, str], fresh_cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.setattr(installed, "FOLDER", tmp_path)  # nothing came with the package
    with pytest.raises(ToolchainError, match=r"no .*Python\.h(.|\n)*python3-dev"):
        compile_sources(sources, "pendulum")


def test_no_cython(
    sources: dict[str, str], fresh_cache: Cache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installed, "FOLDER", tmp_path)  # nothing came with the package
    for name in [name for name in sys.modules if name.split(".")[0] == "Cython"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "Cython", None)
    with pytest.raises(MissingDependencyError, match="pip install cython"):
        compile_sources(sources, "pendulum")
    assert compile_c_library(sources, "pendulum").path.is_file()


@pytest.mark.parametrize("name", ["../up.c", "sub/file.c", "/etc/file.c", ".hidden.c", ""])
def test_names_are_plain(sources: dict[str, str], name: str) -> None:
    with pytest.raises(UsageError, match="not a plain file name"):
        compile_sources({**sources, name: ""}, "pendulum")


def test_usage(sources: dict[str, str]) -> None:
    with pytest.raises(UsageError, match="not a C identifier"):
        compile_sources(sources, "a-b")
    with pytest.raises(UsageError, match=r"lack eomgen\.h"):
        compile_sources({"pendulum.c": ""}, "pendulum")
    with pytest.raises(UsageError, match="no C file"):
        compile_c_library({"eomgen.h": ""}, "pendulum")
    with pytest.raises(UsageError, match="optimize must be"):
        Options(optimize=7)
    with pytest.raises(UsageError, match="extra must be"):
        Options(extra="-g")


@pytest.mark.parametrize("damage", ["truncate", "remove", "source", "manifest", "empty"])
def test_damaged_entries_are_built_again(sources: dict[str, str], fresh_cache: Cache, damage: str) -> None:
    first = compile_c_library(sources, "pendulum")
    content = first.path.read_bytes()
    if damage == "truncate":
        first.path.write_bytes(content[: len(content) // 2])
    elif damage == "remove":
        first.path.unlink()
    elif damage == "source":
        (first.directory / "sources" / "pendulum.c").write_text("something else")
    elif damage == "manifest":
        (first.directory / "manifest.json").write_text('{"key": ')
    else:
        shutil.rmtree(first.directory)
        first.directory.mkdir()
    again = compile_c_library(sources, "pendulum")
    assert not again.from_cache
    assert again.path == first.path
    assert again.path.read_bytes() == content
    assert compile_c_library(sources, "pendulum").from_cache
    assert list((fresh_cache.root / "attempts").iterdir()) == []


def test_list_prune_clear(sources: dict[str, str], fresh_cache: Cache) -> None:
    assert fresh_cache.entries() == []
    assert fresh_cache.clear() == 0
    artifacts = [compile_c_library(sources, name) for name in ("one", "two", "three")]
    for age, artifact in zip((300, 200, 100), artifacts, strict=True):
        os.utime(artifact.directory / "manifest.json", (time.time() - age,) * 2)
    entries = fresh_cache.entries()
    assert [(entry.name, entry.kind) for entry in entries] == [(n, "library") for n in ("three", "two", "one")]
    files = [path for path in artifacts[0].directory.rglob("*") if path.is_file() and path.name != "manifest.json"]
    assert entries[2].size == sum(path.stat().st_size for path in files)
    compile_c_library(sources, "one")  # used again
    assert [entry.name for entry in fresh_cache.entries()] == ["one", "three", "two"]
    assert [entry.name for entry in fresh_cache.prune(older_than=150)] == ["two"]
    assert [entry.name for entry in fresh_cache.prune(max_size=int(1.5 * entries[0].size))] == ["three"]
    assert fresh_cache.clear() == 1
    assert fresh_cache.entries() == []


def test_cache_is_private(sources: dict[str, str], fresh_cache: Cache) -> None:
    artifact = compile_c_library(sources, "pendulum")
    for directory in (fresh_cache.root, artifact.directory.parent, artifact.directory):
        assert directory.stat().st_mode & 0o777 == 0o700
    fresh_cache.root.chmod(0o777)
    with pytest.raises(ToolchainError, match="can be written by other users; run: chmod go-w"):
        compile_c_library(sources, "pendulum")


def test_cache_that_cannot_be_written(sources: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("EOMGEN_CACHE_DIR", str(tmp_path / "file" / "cache"))
    with pytest.raises(ToolchainError, match=r"cannot be written: .*Set EOMGEN_CACHE_DIR"):
        compile_c_library(sources, "pendulum")


def test_cache_directory_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("EOMGEN_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_directory().name == "eomgen"
    if sys.platform == "linux":
        assert cache_directory() == tmp_path / "eomgen"
    monkeypatch.setenv("EOMGEN_CACHE_DIR", "~/elsewhere")
    assert cache_directory() == Path.home() / "elsewhere"
