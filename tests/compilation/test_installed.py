"""The layer as the build of the package makes it: found where it fits, and made anew where anything differs."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import pytest

from eomgen.compilation import Cache, compile_sources, cython_layer, find_compiler, install, installed, load_core
from eomgen.compilation.cython_layer import CONTACTS, ENSEMBLES, FIRST
from eomgen.compilation.translation import choose_translation, translation_key
from eomgen.errors import MissingDependencyError
from eomgen.layer import read_layer


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the build of the package makes."""
    made = tmp_path_factory.mktemp("package") / "built"
    install.install_layer(made, compiled=True)
    return made


@pytest.fixture
def package(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(installed, "FOLDER", folder)
    return folder


@pytest.fixture
def no_cython(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] == "Cython":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", refuse)


def built(sources: dict[str, str], cache: Cache) -> list[str]:
    """Kinds of what a first model of an empty cache leaves there."""
    artifact = compile_sources(sources, "pendulum")
    assert load_core(artifact).names[0] == "rhs"
    return sorted(entry.kind for entry in cache.entries())


def test_a_first_model_takes_the_layer_of_the_package(
    sources: dict[str, str], package: Path, fresh_cache: Cache, no_cython: None
) -> None:
    assert built({**sources, "a.h": "/* first */"}, fresh_cache) == ["extension"]


def test_other_flags_compile_the_same_translation(
    sources: dict[str, str], package: Path, fresh_cache: Cache, no_cython: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    flags = cython_layer.layer_flags(find_compiler())
    monkeypatch.setattr(cython_layer, "layer_flags", lambda compiler: [*flags, "-O0"])
    monkeypatch.setattr(cython_layer, "stepper_flags", lambda compiler, wide: ["-O0", "-fPIC"])
    assert built({**sources, "a.h": "/* flags */"}, fresh_cache) == ["extension", "layer"]


def test_without_the_package_s_cython_must_be_there(
    sources: dict[str, str], tmp_path: Path, fresh_cache: Cache, no_cython: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(installed, "FOLDER", tmp_path)
    with pytest.raises(MissingDependencyError, match="pip install cython"):
        built({**sources, "a.h": "/* none */"}, fresh_cache)


@pytest.mark.parametrize("share", [FIRST, ENSEMBLES, CONTACTS])
def test_a_translation_is_of_its_text_and_of_no_older_cython(
    share: cython_layer.Share, package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from Cython import Shadow

    texts = share.choose(read_layer())
    ready = choose_translation(texts).ready
    assert ready is not None
    text = ready.read_text()
    assert '  "_core.pyx",' in text  # no folder of the computer that it was made on
    assert str(package) not in text
    changed = {**texts, "_core.pyx": texts["_core.pyx"] + "\n"}
    assert choose_translation(changed) == (Shadow.__version__, None)
    other_c = {name: text + "\n" if name.endswith((".c", ".h")) else text for name, text in texts.items()}
    assert translation_key(other_c) == translation_key(texts)
    monkeypatch.setattr(Shadow, "__version__", "2.9.12")
    assert choose_translation(texts).ready == ready
    monkeypatch.setattr(Shadow, "__version__", "3.100.0")
    assert choose_translation(texts) == ("3.100.0", None)


@pytest.mark.parametrize("harm", ["changed", "cut", "gone", "renamed", "no manifest", "nonsense"])
def test_what_is_not_whole_is_not_found(harm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installed, "FOLDER", tmp_path)
    installed.write_installed(tmp_path, "k", {"_core.o": b"object", "other.o": b""}, {"for": "runs"})
    found = installed.find_installed("k")
    assert found == (tmp_path / "k", {"for": "runs"})
    assert installed.find_installed("other") is None
    file, manifest, key = found.directory / "_core.o", found.directory / "manifest.json", "k"
    match harm:
        case "changed":
            file.write_bytes(b"Object")
        case "cut":
            file.write_bytes(b"")
        case "gone":
            file.unlink()
        case "renamed":
            found.directory.rename(tmp_path / "other")
            key = "other"
        case "no manifest":
            manifest.unlink()
        case "nonsense":
            manifest.write_text("[1, 2]")
    assert installed.find_installed(key) is None
