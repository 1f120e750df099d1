"""The selftest of an exported package: Jacobians, the file of figures, its call."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from eomgen.generation import generate
from eomgen.verification.cases import random_cases
from eomgen.verification.finding import Finding
from eomgen.verification.jacobians import jacobians
from eomgen.verification.recorded import FILE, recorded_findings

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = eg.load(EXAMPLES / "four_bar.yaml")
    return generate(model, tmp_path_factory.mktemp("selftest"), target="numpy")


@pytest.fixture(scope="module")
def module() -> eg.Module:
    return eg.load(EXAMPLES / "four_bar.yaml").compile(target="numpy")


def selftest(package: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-B", "-m", "four_bar.selftest", *words],
        cwd=package.parent,
        env={**os.environ, "PYTHONPATH": str(package.parent)},
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )


def test_a_wrong_sign_in_the_jacobian_alone_is_found(package: Path) -> None:
    file = package / "_core.py"
    text = file.read_text()
    begin = text.index("def residual_jacobian(")
    place = text.rindex(" + ", begin, text.index("\ndef ", begin))
    try:
        file.write_text(text[:place] + " - " + text[place + 3 :])
        broken = selftest(package)
    finally:
        file.write_text(text)
    assert broken.returncode == 5, broken.stdout + broken.stderr
    assert "BREACH  jacobian: extrapolated differences of rhs" in broken.stdout


def test_a_package_without_its_figures_fails(package: Path) -> None:
    file = package / FILE
    text = file.read_text()
    try:
        file.unlink()
        done = selftest(package)
    finally:
        file.write_text(text)
    assert done.returncode == 5, done.stdout + done.stderr
    assert "selftest.json is missing" in done.stdout
    assert "run the package's selftest" not in done.stdout


def test_unknown_arguments_are_refused(package: Path) -> None:
    done = selftest(package, "--json")
    assert done.returncode == 2
    assert "--json" in done.stderr


@pytest.mark.parametrize(
    "content",
    [b"", b"{}", b"[]", b"null", b"\xff\xfe\x00\x80", b'{"name": "four_bar", "states": [', b'{"name": "other"}',
     b'{"name": "four_bar", "states": [{}], "kernels": {"bias": [{"values": [1], "bound": 0}]}}',
     (b'{"name": "four_bar", "states": [{"t": 0, "q": [1], "v": [], "p": [], "u": []}],'
     b' "kernels": {"bias": [{"values": [1], "bound": 0}]}}'),
     (b'{"name": "four_bar", "states": [{"q": [1' + b"0" * 400 + b"]}],"
      b' "kernels": {"bias": [{"values": [1], "bound": 0}]}}'),
     b"[" * 99999,
     b'{"name": "four_bar", "states": 1, "kernels": {"nonsense": 3}}'],
)  # fmt: skip
def test_damaged_figures_are_one_breach_without_a_traceback(module: eg.Module, tmp_path: Path, content: bytes) -> None:
    file = tmp_path / FILE
    file.write_bytes(content)
    (found,) = recorded_findings(module, file)
    assert not found.ok
    assert FILE in found.note


def found_in(module: eg.Module) -> list[Finding]:
    return jacobians(module, random_cases(module, 2))


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "double_pendulum", "peaucellier", "delta_robot"])
def test_jacobians_of_correct_modules_agree(name: str) -> None:
    found = found_in(eg.load(EXAMPLES / f"{name}.yaml").compile(target="numpy"))
    assert found
    assert all(f.ok for f in found), found


def test_a_jacobian_off_by_a_millionth_is_found(module: eg.Module, monkeypatch: pytest.MonkeyPatch) -> None:
    exact = module.jacobian
    monkeypatch.setattr(module, "jacobian", lambda *x, **given: exact(*x, **given) * (1.0 + np.float64(1e-6)))
    assert not found_in(module)[0].ok
