"""``verify`` of modules, models and packages: correct ones pass, broken ones do not."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from children import HANGS
from command import run
from packages import built
from refusals import refuses
from sweeps import COVERING, METHODS, part_of

import eomgen as eg
from eomgen.api.generation import generate

EXAMPLES = models.EXAMPLES


def ball() -> eg.Model:
    model = eg.Model("ball", gravity=(0, -9.81, 0))
    model.prismatic("J", model.ground, model.body("b", mass=1), axis="y", coordinate="h")
    model.initial(h=1.0)
    model.event("floor", "h", restitution=0.9)
    return model


def rotor() -> eg.Model:
    """Without gravity its bias is 0, and only terms that cancel are behind it; sums over all bodies are outputs."""
    model = eg.Model("rotor")
    model.revolute("A", model.ground, model.body("a", mass=1, com=(0.2, 0.1, 0), inertia={"zz": 0.1}))
    model.output("p", "2*momentum_y - 3*A + angular_momentum_z(ground) + inertia_xx(a)")
    return model


def stone() -> eg.Model:
    model = eg.Model("stone", gravity=(0, 0, -9.81))
    model.free("fly", model.ground, model.body("s", mass=1, inertia=(1, 2, 3)), rotation="euler_parameters")
    model.initial(fly_z=1, fly_e0="cos(pi/8)", fly_e1="sin(pi/8)", fly_wx=2, fly_wz=5)
    return model


def orifice() -> eg.Model:
    """A force of infinite slope at the start."""
    model = eg.Model("orifice")
    model.prismatic("X", model.ground, model.body("a", mass=1.0), axis="x", coordinate="x")
    model.actuator("F", "X", "1 - abs(x)**0.5")
    model.initial(x=0.0)
    return model


def lift() -> eg.Model:
    """Two sliders tied by an equation that an input moves."""
    model = eg.Model("lift")
    model.input("l", 0.3, signal="0.3 + 0.2*sin(t)")
    model.prismatic("X", model.ground, model.body("b", mass=1.0), axis="x", coordinate="x")
    model.prismatic("S", model.ground, model.body("c", mass=1.0), axis="x", coordinate="s")
    model.actuator("F", "X", "-4*x")
    model.coupling("flow", equation="s - x*l - x")
    model.initial(x=0.3, x_dot=1.0)
    return model


@pytest.mark.parametrize("make", [ball, rotor, stone, orifice, lift], ids=lambda make: make.__name__)
def test_correct_models_have_no_breach(make: Callable[[], eg.Model]) -> None:
    """Though a figure is zero, nothing moves, or a check does not apply."""
    found = make().compile(target="numpy").verify(states=2, seconds=3.0)
    assert found.ok, str(found)
    assert not found.breaches
    assert any(not f.left_out for f in found.findings)
    if make is ball:  # runs with events that reset are left out, with the reason
        assert all(f.left_out and "reset" in f.note for f in found.findings if f.check.startswith("steppers"))


def test_a_loop_is_compared_with_itself_in_other_frames_cuts_and_methods() -> None:
    module = models.build("four_bar").compile("embedding", target="numpy")
    found = module.verify(states=1, seconds=60.0)
    variants = {f.check.removeprefix("variants: "): f for f in found.findings if f.check.startswith("variants: ")}
    methods = {f"method {name}" for name in METHODS[1:]}
    assert {*variants} == {"body frames turned", "another joint cut", "target numpy", *methods}
    assert {name for name, f in variants.items() if f.left_out} == {"target numpy"}  # which it is itself
    assert all(f.worst <= f.limit < 1e-9 for f in variants.values() if not f.left_out)


@pytest.mark.thorough
@pytest.mark.parametrize("path", part_of(sorted(EXAMPLES.glob("*.yaml")), lambda path: path.stem in COVERING),
                         ids=lambda path: path.stem)  # fmt: skip
def test_every_example_keeps_all_limits(path: Path) -> None:
    found = eg.load(path).derive().compile().verify()
    assert found.ok, str(found)
    assert sum(not f.left_out for f in found.findings) >= 30


@pytest.mark.parametrize(
    ("call", "change", "checks"),
    [
        ("jacobian", lambda J: J * (1 + 1e-6), "jacobian: "),
        ("project", lambda x: x + 1e-5, "project: "),
        ("energy", lambda E: 1.001 * E, "energy: "),
    ],
)
def test_a_wrong_call_is_a_breach(
    monkeypatch: pytest.MonkeyPatch, call: str, change: Callable[[Any], Any], checks: str
) -> None:
    module = models.build("double_pendulum").compile(target="numpy")
    right = getattr(module, call)
    monkeypatch.setattr(module, call, lambda *given, **keys: change(np.asarray(right(*given, **keys))))
    found = module.verify(states=2, seconds=0.0)
    assert not found.ok
    assert any(f.check.startswith(checks) for f in found.breaches), found.breaches


@pytest.mark.parametrize("given", [{"states": 0}, {"states": 1.5}, {"states": True}, {"seed": -1}, {"seconds": -1.0},
                                   {"seconds": float("nan")}])  # fmt: skip
def test_odd_arguments_are_named(given: dict[str, Any]) -> None:
    refuses(f"EG-RANGE {next(iter(given))}", models.build("pendulum").compile(target="numpy").verify, **given)


def test_the_command(tmp_path: Path) -> None:
    words = ("verify", EXAMPLES / "pendulum.yaml", "--target", "numpy", "--states", 2, "--seconds", 0)
    written = run(*words)
    assert written.code == 0
    assert "bias: free bodies" in written.out
    result = run(*words, "--json").json
    assert list(result) == ["name", "method", "ok", "not_reached", "findings", "seconds"]
    assert {*result["findings"][0]} == {"check", "ok", "left_out", "worst", "limit", "where", "cases", "note"}
    assert run("verify", "nothing.yaml").code == 2
    file = tmp_path / "massless.yaml"
    file.write_text("name: massless\nbodies: {a: {mass: 0}}\njoints: {A: {type: revolute, between: [ground, a]}}\n")
    written = run("verify", file, "--target", "numpy")
    assert written.code == 0
    assert "kinematics only" in written.out
    assert "BREACH" not in written.out


# -- packages ----------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(generate(models.build("four_bar"), tmp_path_factory.mktemp("package")))


def selftest(package: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-B", "-m", f"{package.name}.selftest", *words]
    env = {**os.environ, "PYTHONPATH": str(package.parent)}
    return subprocess.run(
        command, cwd=package.parent, env=env, capture_output=True, text=True, check=False, timeout=HANGS
    )


def test_a_package_tests_itself_and_finds_what_is_broken(package: Path) -> None:
    fine = selftest(package)
    assert fine.returncode == 0, fine.stdout + fine.stderr
    assert "mass_matrix: recorded figures" in fine.stdout
    assert selftest(package, "--json").returncode == 2  # it takes no arguments
    code = package / "four_bar.c"
    figures = package / "tests" / "recorded.json"
    for file, begin, told in (
        (code, "flag bias_block(", "BREACH  bias: recorded figures"),
        (code, "flag residual_jacobian_block(", "BREACH  jacobian: recorded figures"),
        (figures, "", "recorded.json"),
    ):
        text = file.read_text()
        place = text.index("c[0]*", text.index(begin)) if begin else 0
        file.write_text(f"{text[:place]}2.0*{text[place:]}" if begin else '{"name": "other"}')
        broken = selftest(built(package))
        file.write_text(text)
        assert broken.returncode == 5, broken.stdout + broken.stderr
        assert told in broken.stdout


def recorded(package: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((package / "tests" / "recorded.json").read_text())["cases"]
    return found


@pytest.mark.quick
def test_recorded_figures_are_those_of_the_pendulum(tmp_path: Path) -> None:
    """By its formulas, at the declared parameters and at others."""
    moved = 0
    for case in recorded(generate(models.build("pendulum"), tmp_path)):
        if case["call"] not in ("rhs", "energy", "mass_matrix"):
            continue
        m, l, g = case["given"]["p"]
        theta, omega = (*case["arguments"][-1], 0.0)[:2]
        expected = {
            "rhs": [omega, -g / l * np.sin(theta)],
            "energy": [m * (l * omega) ** 2 / 2, -m * g * l * np.cos(theta)],
            "mass_matrix": [[m * l**2]],
        }[case["call"]]
        np.testing.assert_allclose(case["value"], expected, rtol=1e-14, atol=1e-14)
        assert case["bound"] < 1e-8
        moved += (m, l, g) != (1.0, 1.0, 9.81)
    assert moved >= 3


@pytest.mark.parametrize("name", ["slider_crank", "bricard"])
def test_c_is_within_the_recorded_bounds(name: str, tmp_path: Path) -> None:
    model = models.build(name)
    cases, module = recorded(generate(model, tmp_path)), model.compile()
    assert len(cases) >= 15
    for case in cases:
        found = getattr(module, case["call"])(*case["arguments"], **case["given"])
        np.testing.assert_allclose(found, case["value"], rtol=0.0, atol=case["bound"], err_msg=case["id"])
        assert case["bound"] > 1e-12  # where the result is zero, another build may leave rounding
