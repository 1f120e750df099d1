"""Steps with rigid contact in compiled code: the same steps in Python, the same bits again, a drive on chains."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_scenes import G, rigid

import eomgen as eg
from eomgen.simulation import rigid_steps


def linkage() -> Any:
    """A four-bar that falls on balls between its cranks and the floor, driven by a torque."""
    m = eg.Model("linkage", gravity=(0, -G, 0))
    crank = m.body("crank", mass=1.0, com=(0.1, 0, 0), inertia={"zz": 0.01})
    rod = m.body("rod", mass=2.0, com=(0.25, 0, 0), inertia={"zz": 0.05})
    rocker = m.body("rocker", mass=1.5, com=(0.15, 0, 0), inertia={"zz": 0.02})
    m.revolute("A", m.ground, crank, coordinate="a")
    m.revolute("B", crank.at(0.2, 0, 0), rod, coordinate="b")
    m.revolute("C", m.ground.at(0.5, 0, 0), rocker, coordinate="c")
    m.revolute("D", rod.at(0.5, 0, 0), rocker.at(0.3, 0, 0))
    m.torque("motor", "A", m.input("u", 0.0))
    m.initial(a=1.2), m.guess(b=-1.0, c=1.5)
    ends = [{"shape": "circle", "radius": 0.05, "on": rod.at(x, 0.0, 0)} for x in (0.0, 0.25, 0.5)]
    floor = {"shape": "half_plane", "on": m.ground.at(0, 0.1, 0)}
    m.contacts("floor", ends, floor, rigid(friction=0.3, restitution=0.2))
    return m.compile()


def tumblers() -> Any:
    """Three bodies in space by Euler parameters, on a floor and each other."""
    m = eg.Model("tumblers", gravity=(0, 0, -G))
    shapes = []
    for k in range(3):
        body = m.body(f"b{k}", mass=1.0 + k, com=(0.02, 0, 0.01), inertia=(0.01, 0.02 + 0.01 * k, 0.025 + 0.01 * k))
        m.free(f"j{k}", m.ground, body, rotation="euler_parameters")
        m.initial(**{f"j{k}_x": 0.15 * k, f"j{k}_z": 0.2 + 0.25 * k, f"j{k}_x_dot": 0.5 - 0.5 * k})
        shapes += [{"shape": "sphere", "radius": 0.07, "on": body.at(x, 0.02 * k, 0)} for x in (-0.08, 0.08)]
    m.contacts("floor", shapes, {"shape": "half_space", "on": m.ground}, rigid(friction=0.4))
    m.contacts("among", shapes, law=rigid(friction=0.2, restitution=0.5))
    return m.compile()


def run_both(monkeypatch: pytest.MonkeyPatch, mod: Any, **options: Any) -> tuple[Any, Any]:
    quick = mod.simulate(method="moreau", contact_forces=True, **options)
    again = mod.simulate(method="moreau", contact_forces=True, **options)
    np.testing.assert_array_equal(quick.x, again.x)
    with monkeypatch.context() as patch:
        patch.setattr(rigid_steps, "rigid_stepper", lambda *_: None)
        return quick, mod.simulate(method="moreau", contact_forces=True, **options)


@pytest.mark.parametrize("inputs", [{}, {"u": ([0.0, 0.2, 0.4], [0.0, -3.0, 3.0])}, {"u": "-2*sin(9*t) - a_dot"}])
def test_a_loop_with_inputs(monkeypatch: pytest.MonkeyPatch, inputs: dict[str, Any]) -> None:
    c, python = run_both(monkeypatch, linkage(), span=0.4, step=1e-3, inputs=inputs)
    assert c.metadata["contacts"] >= 1
    assert c["normal(floor)"].max() > 10.0
    np.testing.assert_allclose(c.x, python.x, atol=1e-6)
    np.testing.assert_allclose(c["normal(floor)"], python["normal(floor)"], atol=1e-4 * c["normal(floor)"].max())
    assert c.residuals.raw_position < 1e-6
    for key in ("steps", "contacts", "missed_steps"):
        assert c.metadata[key] == python.metadata[key]
    assert c.metadata["penetration"] == pytest.approx(python.metadata["penetration"], abs=1e-7)


def test_an_input_that_is_a_function() -> None:
    """As the same input by an expression; what it raises is told."""
    mod, options = linkage(), {"method": "moreau", "step": 1e-3}
    at = mod.v_names.index("a_dot") + mod.n_q
    text = mod.simulate(0.3, inputs={"u": "2*sin(9*t) - a_dot"}, **options)
    called = mod.simulate(0.3, inputs={"u": lambda t, x: 2.0 * np.sin(9.0 * t) - x[at]}, **options)
    np.testing.assert_allclose(called.x, text.x, atol=1e-9)

    def bad(t: float, x: Any) -> float:
        raise ZeroDivisionError("no such torque")

    with pytest.raises(ZeroDivisionError, match="no such torque"):
        mod.simulate(0.3, inputs={"u": bad}, **options)


def test_quaternions_and_two_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    mod = tumblers()
    c, python = run_both(monkeypatch, mod, span=0.35, step=1e-3)
    assert c["normal(among)"].max() > 0.0
    assert c["normal(floor)"].max() > 0.0
    np.testing.assert_allclose(c.x, python.x, atol=1e-5)
    wrench = sum(c.contact_forces.on(f"b{k}") for k in range(3))
    np.testing.assert_allclose(wrench, -c.contact_forces.on("ground"), atol=1e-8)


def test_parameters_given_late() -> None:
    """Coefficients and masses of a run are those that it is given, in compiled code too."""
    m = eg.Model("late", gravity=(0, -G, 0))
    m.parameter("mu", 0.0), m.parameter("mass", 1.0)
    body = m.body("b", mass="mass", inertia={"zz": 0.01})
    m.planar("j", m.ground, body)
    box = {"shape": "box", "size": (0.4, 0.2), "on": body}
    m.contacts("c", box, {"shape": "half_plane", "on": m.ground}, rigid(friction="mu"))
    mod = m.compile()
    start = {"j_y": 0.1, "j_x_dot": 1.0}
    options = {"method": "moreau", "step": 1e-3}
    for mu, mass in ((0.0, 1.0), (0.2, 3.0)):
        run = mod.simulate(0.3, start, parameters={"mu": mu, "mass": mass}, **options)
        np.testing.assert_allclose(run["j_x_dot"][-1], 1.0 - mu * G * 0.3, rtol=1e-8)
        np.testing.assert_allclose(run["normal(c)"][-1], mass * G, rtol=1e-6)  # 1e-9 of 1 m/s over g h


@pytest.mark.thorough
def test_a_drive_loses_no_link() -> None:
    """Two seconds of benchmarks/long_drive.py, which drives for a minute."""
    sys.path.insert(0, str(Path(__file__).parents[2]))
    from benchmarks import long_drive

    module = long_drive.build().compile()
    run, _ = long_drive.drive(module, 2.0, long_drive.SHORT)
    found = long_drive.judge(module, run)
    assert run["x"][-1] > 0.8
    assert found["turns"] > 0.999
    assert found["farthest"] < 1.0
    assert found["open"] < 1e-3
    assert found["gained"] < 0.01
    assert run.metadata["penetration"] < 0.01
    assert run.metadata["missed_steps"] < 0.04 * run.metadata["steps"]  # of a tolerance of 1e-3
    assert run.metadata["contact_residual"] < 0.01
