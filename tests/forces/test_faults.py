"""What is wrong with a force element is told by its place, before a run and in it; files and schema know every key."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from jsonschema import Draft202012Validator

import eomgen as eg
from eomgen.describe import model_schema
from eomgen.describe.yaml_nodes import Document
from eomgen.errors import ModelError, NonFiniteError
from eomgen.forces.muscle import active_force_length, force_velocity, passive_force_length
from eomgen.graph import Graph, evaluate


def slider() -> tuple[eg.Model, Any]:
    m = eg.Model("slider")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b, axis="x")
    return m, b


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_force_that_is_undefined_is_named(target: str) -> None:
    m, b = slider()
    m.damper("oil", m.ground, b, damping=1)
    m.spring("strut", m.ground.at(1, 0, 0), b, stiffness=2, length=1)
    m.sphere_sphere("balls", m.ground.at(2, 0, 0), b, radii=(0.1, 0.1), stiffness=10)
    m.element("root", "s", law="sqrt(length + 5)")
    m.spring("soft", m.ground.at(3, 0, 0), b, stiffness=2)  # without a free length its ends may meet
    m.friction("rub", "s", viscous=1)
    mod = m.compile(target=target)
    for s, name in ((0.0, "oil"), (1.0, "strut"), (2.0, "balls"), (-6.0, "root")):
        for call in (mod.rhs, mod.jacobian):
            with pytest.raises(NonFiniteError, match=f"the loads of {name} are not"):
                call(0.0, np.array([s, 0.5]))
    assert np.isfinite(mod.rhs(0.0, np.array([3.0, 0.5]))).all()
    with pytest.raises(NonFiniteError, match="the loads of oil are not"):
        mod.simulate((0, 1), initial={"s": 0.0, "s_dot": 1.0})


def test_faults_of_laws_are_told_all_at_once() -> None:
    m, b = slider()
    m.parameter("small", -0.1)
    m.friction("f2", "s", coulomb=1)
    m.friction("f3", "s", coulomb=1, smoothing="small")
    m.friction("f4", "s", coulomb=1, smoothing=0.1, static=2)
    m.stop("s1", "s", stiffness=1)
    m.stop("s2", "s", stiffness=-1, lower=1, upper=0, exponent=0.5)
    m.point_plane("c1", m.ground, b, stiffness=1, restitution=0.5)
    m.point_plane("c2", m.ground, b, stiffness=1, restitution=1.5, velocity=1)
    m.point_plane("c3", m.ground, b, stiffness=1, dissipation=1, formula="flores")
    m.point_plane("c4", m.ground, b, stiffness=1, smoothing=0.1)
    m.sphere_plane("c5", m.ground, b, radius=0, stiffness=1)
    m.sphere_sphere("c6", m.ground, b, radii=(1, 2, 3), stiffness=1)
    m.bushing("b1", m.ground, b, stiffness=[1, 2, 3])
    m.bushing("b2", m.ground, b, stiffness=np.triu(np.ones((6, 6))).tolist())
    m.point_gravity("g1", b, "b", mu=1)
    m.point_gravity("g2", m.ground, "c", mu=1)
    m.muscle("m1", m.ground, b, activation=2, force_max=1, fiber_length=0, slack_length=1)
    with pytest.raises(ModelError) as error:
        m.mechanism()
    told = {p.path.removeprefix("forces."): f"{p.message}; {p.remedy}" for p in error.value.problems}
    expected = {
        "f2.smoothing": "is missing", "f3.smoothing": "is -0.1", "f4.stribeck": "is missing",
        "s1": "has no limit", "s2.stiffness": "is -1", "s2.upper": "this is upper - lower", "s2.exponent": "is 0.5",
        "c1.velocity": "give restitution and velocity together", "c2.restitution": "is 1.5",
        "c3.formula": "dissipation is given too", "c4.smoothing": "is given without friction",
        "c5.radius": "is 0", "c6.radii": "two numbers", "b1.stiffness": "six numbers",
        "b2.stiffness[1][0]": "not symmetric", "g1.center": "lies on 'b' itself", "g2.body": "no body 'c'",
        "m1.activation": "is 2", "m1.fiber_length": "is 0",
    }  # fmt: skip
    for path, words in expected.items():
        assert words in told.get(path, f"nothing at {path}: {told}") or "is " + words in told[path]
    assert {path for path in told if not path.startswith("b2")} == set(expected) - {"b2.stiffness[1][0]"}


def test_the_schema_and_files_know_every_element(tmp_path: Path) -> None:
    m, b = slider()
    drum = {"around": m.ground.at(0.5, 1, 0), "radius": 0.1, "sense": "negative"}
    m.parameter("k", 3.0)
    m.input("a", 0.5)
    far = m.ground.at(0, 2, 0)
    m.spring("e1", far, b, stiffness="k", length=1, via=[drum, m.ground.at(1, 1, 0), b.at(0, 0.1, 0)])
    m.damper("e2", far, b, damping=1, via=[drum])
    m.actuator("e3", far, b, "a*t", via=[drum])
    m.element("e4", "s", law="-k*length", potential="k*length**4")
    m.bushing("e5", far, b, stiffness=[1, 1, 1, 1, 1, "k"], damping=(0.1 * np.eye(6)).tolist())
    m.point_gravity("e6", far, b, mu="k", extent="maccullagh")
    m.stop("e7", "s", lower=-1, stiffness=10, restitution=0.5, velocity="k", formula="lankarani")
    m.friction("e8", "s", coulomb=1, static="k", stribeck=1, smoothing=0.1)
    m.point_plane("e9", m.ground, b, stiffness=1, friction="a", smoothing=0.1)
    m.sphere_plane("e10", m.ground, b, radius="k/100", stiffness=1, exponent=1)
    m.sphere_sphere("e11", far, b, radii=("k", 0.1), stiffness=1)
    m.muscle("e12", far, b, activation="a", force_max=1, fiber_length=1, slack_length=1, via=[drum])
    text = m.to_yaml()
    schema = Draft202012Validator(model_schema())
    assert [e.message for e in schema.iter_errors(Document(text, "m.yaml").value)] == []
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    again = eg.load(tmp_path / "m.yaml")
    assert again.to_yaml() == text
    x = np.array([0.3, 0.7])
    np.testing.assert_array_equal(again.compile(target="numpy").rhs(0.2, x), m.compile(target="numpy").rhs(0.2, x))


def test_the_curves_of_the_muscle() -> None:
    """Against published values and SymPy's classes over their whole range."""
    import sympy
    from sympy.physics import biomechanics

    given = models.reference("muscle_lever_sympy")["curve_values"]
    g = Graph()
    x = g.symbol("x")
    for ours, key, name in (
        (active_force_length, "fl_act", "ForceLengthActive"),
        (passive_force_length, "fl_pas", "ForceLengthPassive"),
        (force_velocity, "fv", "ForceVelocity"),
    ):
        for at, value in given[key].items():
            assert float(evaluate([ours(x)], {"x": float(at)})[0]) == pytest.approx(value, abs=6e-10)
        y = sympy.Symbol("y")
        curve = getattr(biomechanics, f"Fiber{name}DeGroote2016").with_defaults(y).doit()
        points = np.linspace(-1.2 if key == "fv" else 0.3, 1.7, 60)
        np.testing.assert_allclose(
            evaluate([ours(x)], {"x": points})[0], sympy.lambdify(y, curve, "numpy")(points), rtol=1e-12, atol=1e-14
        )


def test_the_active_curve_differs_from_that_of_opensim_as_the_page_says() -> None:
    """DeGrooteFregly2016Muscle: constants of the authors' programs, the first height raised until the curve meets 1."""
    bells = (
        (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
        (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
        (0.1, 1.0, 0.5 * np.sqrt(0.5), 0.0),
    )
    l = np.linspace(0.5, 1.5, 1001)
    theirs = sum(b1 * np.exp(-0.5 * ((l - b2) / (b3 + b4 * l)) ** 2) for b1, b2, b3, b4 in bells)
    assert theirs[500] == pytest.approx(1.0, abs=1e-15)
    x = Graph().symbol("x")
    ours = evaluate([active_force_length(x)], {"x": l})[0]
    assert ours[500] == pytest.approx(0.994, abs=5e-4)
    assert np.abs(ours - theirs).max() == pytest.approx(0.013, abs=5e-4)


def test_an_angle_between_axes_that_do_not_stay_in_line_is_refused() -> None:
    m = eg.Model("skew")
    b = m.body("b", mass=1, inertia=(1, 1, 1))
    m.spherical("ball", m.ground, b)
    m.torsional_element("motor", m.ground, b, law="-rate")
    with pytest.raises(ModelError, match=r"forces.motor: the z axes of its two markers do not stay in line"):
        m.compile(target="numpy")


def test_friction_without_a_law_in_a_file(tmp_path: Path) -> None:
    text = """\
name: dry
bodies: {b: {mass: 1}}
joints: {s: {type: prismatic, between: [ground, b]}}
forces:
  rub: {type: friction, joint: s}
  oil: {type: element, joint: s, law: -rate, potential: rate**2}
"""
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(ModelError) as error:
        eg.load(tmp_path / "m.yaml").mechanism()
    told = [str(p) for p in error.value.problems]
    assert any("m.yaml:5: forces.rub: has no friction law" in line for line in told)
    assert any("m.yaml:6: forces.oil.potential: unknown name 'rate'" in line for line in told)


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_torque_on_a_length_is_a_force_in_newton(target: str) -> None:
    """6 N on a coordinate s along (0, 3, 4) / 5 do what the force of 6 N along that line does: 3 m/s^2 of 2 kg."""
    rates = []
    for kind in ("torque", "actuator", "force"):
        m = eg.Model("pushed")
        m.prismatic("s", m.ground, b := m.body("b", mass=2), axis=(0, 3, 4))
        where = b if kind == "force" else "s"
        getattr(m, kind)("push", where, value=(0, 3.6, 4.8) if kind == "force" else 6)
        rates.append(m.compile(target=target).rhs(0.0, [0.0, 0.0])[1])
    np.testing.assert_allclose(rates, 3.0, rtol=1e-14)


def test_a_force_on_a_joint_is_refused_with_the_remedy(tmp_path: Path) -> None:
    m, _ = slider()
    m.force("push", "s", (1, 0, 0))
    with pytest.raises(
        ModelError, match=r"forces\.push\.marker: a force acts at a marker, and 's' is not a marker; .*torque"
    ):
        m.check()
    m, b = slider()
    handle = m.revolute("r", b, m.body("c", mass=1))
    with pytest.raises(eg.errors.UsageError, match="'push' acts at a marker.*use torque or actuator"):
        m.force("push", handle, (1, 0, 0))
    file = tmp_path / "slider.yaml"
    file.write_text(slider()[0].to_yaml() + "forces: {push: {type: force, joint: s, value: 3}}\n")
    with pytest.raises(ModelError, match=r"forces\.push\.joint: a force acts at a marker") as caught:
        eg.load(file).check()
    assert len(caught.value.problems) == 1


def test_a_body_may_bear_the_name_of_a_joint() -> None:
    m = eg.Model("named")
    m.prismatic("b", m.ground, m.body("b", mass=2), axis="x")
    m.force("push", "b", (4, 0, 0))
    assert m.compile(target="numpy").rhs(0.0, [0.0, 0.0])[1] == pytest.approx(2.0)
