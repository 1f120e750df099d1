"""Exported packages have the runs of their models and, where asked for, the analyses, with NumPy alone but for runs."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run
from packages import built

import eomgen as eg

#: Calls of a package as of a module; the last three integrate, by SciPy.
CRANK = {
    "equilibrium": "m.equilibrium({'theta': -1.5})['theta']",
    "linearize": "m.linearize(m.equilibrium({'theta': -1.5}).x).A",
    "modes": "m.modes(m.equilibrium({'theta': -1.5}).x).frequencies",
    "preload": "m.equilibrium(hold={'theta': -1.0}, unknowns=['tau'])['tau']",
    "parameter_jacobian": "m.parameter_jacobian(0.0, m.x0())",
    "reactions": "m.reactions(0.0, m.x0())",
    "multipliers": "m.multipliers(0.0, m.x0())",
    "inverse dynamics": "m.actuator_forces(0.0, m.x0()).forces",
    "impact": "m.impact(0.0, m.x0(), lock=['s']).impulses",
    "consistent": "m.consistent(m.x0() + 0.05)",
    "kinematic_analysis": "m.kinematic_analysis(theta=[0.3, 0.9, 1.2])['s']",
    "motion_range": "m.motion_range('s', initial={'theta': 0.5}).upper",
    "regressor": "m.regressor(m.x0()[:3], m.x0()[3:], [1.0, 2.0, 3.0])",
    "simulate": "m.simulate(0.2, t_eval=[0.0, 0.2]).x",
    "sensitivities": "m.sensitivities(['l'], 0.1)['theta', 'l'][-1]",
    "times of impacts": "m.sensitivities(['l'], 0.3, {'theta': 1.3, 'theta_dot': 10.0}).event_times['wall']",
}
SERVO = {"states": "m.rhs(0.0, m.x0())", "samples": "m.simulate((0.035, 0.1), t_eval=[0.1]).x"}
SCRIPT = """
import importlib, json, sys
gone = {"eomgen", "sympy", "scipy"}
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in gone:
            raise ImportError(f"a package must not need {name}")
sys.meta_path.insert(0, Refuse())
import numpy as np
m = importlib.import_module(sys.argv[1])
found = {}
for name, call in json.loads(sys.stdin.read()).items():
    if name == "simulate" or sys.argv[1] == "servo":
        gone.discard("scipy")
    found[name] = np.asarray(eval(call)).tolist()
print(json.dumps(found))
"""


def crank() -> eg.Model:
    """A slider-crank with a wall that it strikes and an input with a signal."""
    m = eg.load_example("slider_crank")
    m.input("push", signal="0.1*l*sin(3*t)")
    m.torque("drive", "theta", "push")
    m.event("wall", "s - 0.3", restitution=0.5)
    return m


def servo() -> eg.Model:
    """A mass with a state and a sampled one."""
    m = eg.Model("servo")
    m.prismatic("slide", m.ground, m.body("sledge", mass=2.0), axis="x", coordinate="s")
    m.state("lag", "(1 - s - lag)/0.1", initial=0.3)
    m.sampled("held", "1 - s", 0.02)
    m.actuator("motor", "s", value="held + lag")
    return m


@pytest.mark.parametrize(("build", "calls"), [(crank, CRANK), (servo, SERVO)])
def test_a_package_finds_what_the_module_finds(build: Any, calls: dict[str, str], tmp_path: Path) -> None:
    model = build()
    model.save(tmp_path / "model.yaml")
    done = run("generate", tmp_path / "model.yaml", "--analyses", "--out", tmp_path / "out")
    assert done.code == 0, done.err
    built(tmp_path / "out" / model.name)
    words = [sys.executable, "-c", SCRIPT, model.name]
    child = subprocess.run(words, input=json.dumps(calls), cwd=tmp_path / "out", capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    found = json.loads(child.stdout)
    m = model.compile(target="numpy")
    for name, call in calls.items():
        expected = eval(call, {"m": m})  # noqa: S307 - the calls above
        size = max(1.0, float(np.abs(expected).max()))
        np.testing.assert_allclose(found[name], expected, rtol=0, atol=1e-9 * size, err_msg=name)


OF_PACKAGE = """
import json
import numpy as np
import servo, slider_crank
import eomgen as eg

told = []
for name in ("linearize", "kinematic_analysis", "verify"):
    try:
        getattr(slider_crank, name)
    except slider_crank.EomgenError as error:
        told.append(str(error))
from slider_crank.runtime.plotting import printed_names
from slider_crank.runtime.trajectory import load_trajectory
read = load_trajectory("run.npz")
label = read.plot("theta").get_ylabel()
labels = [label, printed_names(read.metadata, "html")("theta<1"), printed_names(slider_crank.metadata)("theta")]
ANALYSES = ("linearize", "equilibrium", "impact", "simulate_impacts", "sensitivities", "kinematic_analysis", "fit")
assert not any(hasattr(one, name) for one in (slider_crank, slider_crank.module) for name in ANALYSES)
m = eg.Module.of(slider_crank)
try:
    m.x0({"theta": 0.3, "s": 9.0})
except eg.AssemblyError as error:
    open_loop = str(error)
numbers = [m.linearize().A, m.equilibrium({"theta": -1.5}).x, eg.Module.of(slider_crank.bind(p={"r": 0.12})).p]
still = eg.Module.of(slider_crank.bind(u={"push": 0.1})).simulate(0.1).metadata["inputs"]["push"]
assert (still, m.simulate(0.1).metadata["inputs"]["push"]) == (0.1, "declared by the model")
try:
    eg.Module.of(np)
except eg.UsageError as error:
    refused = str(error)
numbers = [np.asarray(one).tolist() for one in numbers]
print(json.dumps([numbers, m.verify(states=2).ok, told, open_loop, refused, labels]))
"""


def test_a_package_without_analyses_has_them_where_eomgen_is(tmp_path: Path) -> None:
    for model in (crank(), servo()):
        model.save(tmp_path / "model.yaml")
        done = run("generate", tmp_path / "model.yaml", "--out", tmp_path)
        assert done.code == 0, done.err
        built(tmp_path / model.name)
    m = crank().compile(target="numpy")
    m.simulate(0.1).save(tmp_path / "run.npz")
    words = [sys.executable, "-c", OF_PACKAGE]
    child = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert child.returncode == 0, child.stderr
    (A, x, p), ok, told, open_loop, refused, labels = json.loads(child.stdout.splitlines()[-1])
    np.testing.assert_allclose(A, m.linearize().A, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(x, m.equilibrium({"theta": -1.5}).x, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(p, m.bind(p={"r": 0.12}).p)
    assert ok
    assert ["--analyses" in one for one in told] == [True, True, False]
    assert all("Module.of(slider_crank)" in one for one in told)
    assert labels == ["theta (rad)", "theta&lt;1", "$\\theta$"]
    assert "s" in open_loop
    assert "no package" in refused


@pytest.mark.parametrize("target", ["c", "cuda", "jax"])
def test_analyses_are_for_packages_of_python(target: str, tmp_path: Path) -> None:
    servo().save(tmp_path / "model.yaml")
    found = run("generate", tmp_path / "model.yaml", "--target", target, "--analyses", "--out", tmp_path)
    assert found.code != 0
    assert "analyses are for" in found.err
