"""What counts as closed, as a freedom and as inertia, on both sides of the limits; sources follow from the model."""

import hashlib
import inspect
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused

import eomgen as eg


def slides(*equations: Any, **parameters: float) -> eg.Model:
    """Three sliders x, y, z side by side, coupled by equations or by factors of their coordinates."""
    m = eg.Model("slides")
    for name, value in parameters.items():
        m.parameter(name, value)
    for name in "xyz":
        m.prismatic(name, m.ground, m.body(f"body_{name}", mass=1))
    for k, equation in enumerate(equations):
        m.coupling(f"c{k}", **({"equation": equation} if isinstance(equation, str) else {"coordinates": equation}))
    return m


def test_rows_that_agree_to_ten_digits_are_met_halfway_and_no_others() -> None:
    """Lengths written with ten digits need not agree better; a larger gap is never passed over."""
    mod = slides("x", "x - gap", gap=0.0).compile(target="numpy", kernels=["rhs", "project", "constraints"])
    start = np.array([0.3, 0.7, 0.0, 0.0, 0.0, 0.0])
    for gap in (1e-11, 1e-10):
        assert mod.bind(p={"gap": gap}).project(start)[0] == pytest.approx(gap / 2, abs=1e-15)
    for gap in (1e-9, 1e-6, 0.1):
        with refused("EG-PROJECTION residual"):
            mod.bind(p={"gap": gap}).project(start)


@pytest.mark.parametrize(("weak", "rank"), [(1e-7, 2), (3e-9, 1)])
def test_the_rank_of_a_mechanism(weak: float, rank: int) -> None:
    """Loops are closed to 1e-10 where rank is judged: rows that depend on each other may look so different."""
    report = slides({"x": 0.8, "y": -0.6}, {"x": 0.8 + weak, "y": -0.6}).check()
    assert (report.rank, report.degrees_of_freedom) == (rank, 3 - rank)


def test_chosen_coordinates_may_move_others_fast() -> None:
    """Half of the digits are left where the dependent one moves 1e8 times as fast."""
    kernels = ["rhs", "project", "mass_matrix", "kinematics", "constraint_jacobian", "constraints"]
    mod = slides({"x": 1, "y": 1e-7}).compile(target="numpy", independent=["x", "z"], kernels=kernels)
    np.testing.assert_allclose(mod.kinematics([0.0, 0.2], [1.0, 0.0])[1], [1.0, -1e7, 0.0], rtol=1e-9)
    with refused("EG-PARTITION independent x"):
        slides({"x": 1, "y": 3e-9}).compile(target="numpy", independent=["x", "z"], kernels=kernels)


@pytest.mark.quick
def test_rows_that_repeat_earlier_ones_are_redundant() -> None:
    a, b = {"x": 1, "z": 2}, {"x": 0.3, "y": 0.2, "z": 0.6}
    report = slides(a, {"x": 3, "z": 6}, b, "x + 2*z - 2*(0.3*x + 0.2*y + 0.6*z)").check()
    assert report.redundant == ["c1.relation", "c3.equation"]


@pytest.mark.parametrize("left", [1e-11, 3e-12])
@pytest.mark.parametrize("method", ["embedding", "recursive"])
def test_inertia_that_is_left_of_a_large_one(left: float, method: str) -> None:
    """A light carriage under a heavy body: what is left of the mass matrix is a difference of terms 1e12 as large."""
    m = eg.Model("carts")
    a, b = m.body("a", mass=m.parameter("light", 1.0)), m.body("b", mass=1.0)
    m.prismatic("x", m.ground, a)
    m.prismatic("y", a, b)
    m.force("push", b, (0, 0, 1.0))
    mod = m.compile(method, target="numpy", kernels=["rhs"]).bind(p={"light": left})
    np.testing.assert_allclose(mod.rhs(0.0, np.zeros(4)), [0, 0, 0, 1], atol=1e-3)


def driven_slider_crank() -> eg.Model:
    """A slider-crank on a carriage that is driven along x; the slider closes the loop."""
    m = eg.Model("carried", gravity=(0, -9.81, 0))
    base, crank, rod, slider = (m.body(n, mass=1, inertia={"zz": 0.01}) for n in ("base", "crank", "rod", "slider"))
    m.prismatic("S", m.ground, base, axis="x", coordinate="u")
    m.driver("shake", "u", "0.1*sin(3*t) + 0.05*t")
    m.revolute("A", base, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod, coordinate="bend")
    m.revolute("C", rod.at(0.35, 0, 0), slider, coordinate="turn")
    m.prismatic("D", m.ground, slider, axis="x")
    m.guess(theta=0.8, D=0.4)
    m.independent("theta")
    return m


def test_wanted_rates_of_a_cut_slider_that_moves_by_itself() -> None:
    """s = u(t) + r cos(theta) + l cos(beta): with s' given theta' follows from what the carriage leaves of it."""
    mod = driven_slider_crank().compile(target="numpy")
    assert mod.metadata["loop_names"] == ["D"]
    t, theta, rate = 0.4, 0.8, 0.7
    x = mod.x0({"theta": theta, "D_dot": rate}, t=t)
    found = dict(zip(mod.x_names, x, strict=True))
    beta = -np.arcsin(0.1 * np.sin(theta) / 0.35)
    slope = -0.1 * np.sin(theta) + 0.1 * np.cos(theta) * np.tan(beta)
    u_dot = 0.3 * np.cos(3 * t) + 0.05
    assert found["u_dot"] == pytest.approx(u_dot, abs=1e-12)
    assert found["theta_dot"] == pytest.approx((rate - u_dot) / slope, rel=1e-10)
    # positions, velocities and accelerations of all by the one that is free and the driver
    q, v, a = (dict(zip(mod.q_names, part, strict=True)) for part in mod.kinematics([theta], [2.0], [0.0], t=t))
    assert (q["u"], v["u"], a["u"]) == pytest.approx((0.1 * np.sin(1.2) + 0.02, u_dot, -0.9 * np.sin(1.2)), abs=1e-12)
    assert v["bend"] + 2.0 == pytest.approx(-0.1 * np.cos(theta) * 2.0 / (0.35 * np.cos(beta)), rel=1e-10)


def test_a_wanted_angle_of_a_cut_joint_counts_modulo_full_turns() -> None:
    m = eg.load_example("four_bar")
    mod = m.compile(target="numpy")
    (name,) = mod.metadata["loop_names"]
    x = mod.x0(theta=1.0)
    angle = float(mod.simulate(1e-3, initial={"theta": 1.0, "theta_dot": 0.0})[name][0])
    for turns in (-1, 1):
        again = mod.x0({"theta": 1.0, name: angle + 2 * np.pi * turns})
        np.testing.assert_allclose(again[: mod.n_q], x[: mod.n_q], atol=1e-9)


# -- sources -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("method", ["embedding", "lagrange"])
def test_reading_the_equations_changes_no_source(method: str) -> None:
    untouched = models.build("slider_crank").derive(method).to_casadi()
    equations = models.build("slider_crank").derive(method)
    assert str(equations)
    for name in ("T", "V", "lagrangian", "mass_matrix", "force", "quadratic_velocity", "generalized_forces", "poses"):
        assert getattr(equations, name) is not None
    assert equations.explain(level="full").markdown
    assert inspect.getsource(equations.to_casadi()) == inspect.getsource(untouched)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["slider_crank", "bicycle", "planetary_gear"])
def test_sources_do_not_depend_on_the_hash_seed(name: str, tmp_path: Path) -> None:
    found = []
    for seed in ("1", "20250"):
        out = tmp_path / seed
        command = [sys.executable, "-m", "eomgen", "generate", str(models.EXAMPLES / f"{name}.yaml"), "--out", str(out)]
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, "PYTHONHASHSEED": seed})
        found.append({str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
                      for path in sorted(out.rglob("*")) if path.is_file()})  # fmt: skip
    assert len(found[0]) > 10
    assert found[0] == found[1]
