"""Forces, lengths, rates and powers of elements as outputs, and in events and other laws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg


def machine() -> tuple[eg.Model, dict[str, Any]]:
    """Two links with an element of every kind that acts along a path, and some that do not."""
    m = eg.Model("machine", gravity=(0, -9.81, 0))
    m.parameter("k", 120.0)
    m.body("a", mass=1.2, com=(0.2, 0, 0), inertia={"zz": 0.02}, markers={"tip": (0.5, 0, 0)})
    m.body("b", mass=0.7, com=(0.2, 0, 0), inertia={"zz": 0.01}, markers={"tip": (0.4, 0, 0)})
    m.ground.marker("post", at=(0.3, 0.6, 0))
    m.ground.marker("floor", at=(0, -0.2, 0), rpy=("-pi/2", 0, 0))
    m.revolute("A", m.ground, "a", coordinate="q1")
    m.revolute("B", "a.tip", "b", coordinate="q2")
    made = {
        "spring": m.spring("spring", "ground.post", "b.tip", stiffness="k", length=0.4),
        "slack": m.spring("slack", "ground.post", "a.tip", stiffness=30.0),
        "damper": m.damper("damper", "ground.post", "b.tip", damping=4.0),
        "twist": m.torsional_spring("twist", "B", stiffness=3.0, angle=0.2),
        "motor": m.torque("motor", "A", m.input("tau", 1.3)),
        "pusher": m.actuator("pusher", "ground.post", "a.tip", value="2 + sin(t)"),
        "law": m.element("law", "ground.post", "b.tip", law="-3*rate - length**2", potential="5*length**3"),
        "rubbing": m.friction("rubbing", "B", coulomb=0.4, viscous=0.1, smoothing=0.05),
        "stop": m.stop("stop", "A", upper=0.3, stiffness=500.0, dissipation=0.2),
        "ground": m.sphere_plane("ground", "ground.floor", "b.tip", radius=0.3, stiffness=4000.0, dissipation=0.3),
        "load": m.force("load", "b.tip", value=(3.0, -1.0, 0.0)),
        "wind": m.torque("wind", m.bodies["b"], value=(0, 0, 0.7)),
    }
    return m, made


X = np.array([0.5, -1.1, 1.3, -0.8])


def test_values_are_those_of_the_laws_and_powers_balance(tmp_path: Path) -> None:
    """Against formulas on numbers; the sum of all powers is the rate of the kinetic energy."""
    m, made = machine()
    for name, handle in made.items():
        m.output(f"P_{name}", handle.power)
        if name not in ("load", "wind"):
            for quantity in ("force", "length", "rate"):
                m.output(f"{quantity}_{name}", f"{quantity}({name})")
    m.save(tmp_path / "machine.yaml")
    mod = m.compile(target="numpy")
    y = dict(zip(mod.y_names, mod.outputs(0.4, X), strict=True))
    read = eg.load(tmp_path / "machine.yaml").compile(target="numpy")
    assert read.outputs(0.4, X) == pytest.approx(mod.outputs(0.4, X), rel=1e-14)
    poses, h = mod.poses(X[:2]), 1e-6
    post = np.array([0.3, 0.6, 0.0])

    def reach(q: np.ndarray, body: int, at: float) -> float:
        pose = mod.poses(q)[body]
        return float(np.linalg.norm(pose[:3, 3] + pose[:3, 0] * at - post))

    for name, body, at in (("spring", 1, 0.4), ("slack", 0, 0.5), ("pusher", 0, 0.5), ("law", 1, 0.4)):
        assert y[f"length_{name}"] == pytest.approx(reach(X[:2], body, at), rel=1e-14)
        rate = (reach(X[:2] + h * X[2:], body, at) - reach(X[:2] - h * X[2:], body, at)) / (2 * h)
        assert y[f"rate_{name}"] == pytest.approx(rate, rel=1e-8)
    s, v = y["length_spring"], y["rate_spring"]
    depth = 0.3 - (poses[1][1, 3] + 0.4 * poses[1][1, 0] + 0.2)
    assert y["length_ground"] == pytest.approx(depth, rel=1e-13)
    expected = {
        "spring": -120.0 * (s - 0.4),
        "slack": -30.0 * y["length_slack"],
        "damper": -4.0 * v,
        "twist": -3.0 * (X[1] - 0.2),
        "motor": 1.3,
        "pusher": 2.0 + np.sin(0.4),
        "law": -3.0 * v - s**2 - 15.0 * s**2,
        "rubbing": -0.4 * np.tanh(X[3] / 0.05) - 0.1 * X[3],
        "stop": -500.0 * 0.2**1.5 * (1 + 0.2 * X[2]),
        "ground": 4000.0 * max(depth, 0.0) ** 1.5 * max(0.0, 1.0 + 0.3 * y["rate_ground"]),
    }
    for name, force in expected.items():
        assert y[f"force_{name}"] == pytest.approx(force, rel=1e-12)
        if name != "ground":  # of a contact without friction the penetration does the work, with the other sign
            assert y[f"P_{name}"] == pytest.approx(force * y[f"rate_{name}"], rel=1e-12)
    assert y["P_ground"] == pytest.approx(-y["force_ground"] * y["rate_ground"], rel=1e-12)
    assert depth > 0.0
    kinetic = [mod.energy(X + step * h * mod.rhs(0.4, X))[0] for step in (1, -1)]
    heights = [
        sum(mass * 9.81 * (pose[1, 3] + 0.2 * pose[1, 0]) for mass, pose in zip((1.2, 0.7), mod.poses(q), strict=True))
        for q in (X[:2] + h * X[2:], X[:2] - h * X[2:])
    ]
    total = sum(y[f"P_{name}"] for name in made) - (heights[0] - heights[1]) / (2 * h)
    assert total == pytest.approx((kinetic[0] - kinetic[1]) / (2 * h), rel=1e-7)


def test_a_law_may_use_the_force_of_another_element() -> None:
    """A brake whose friction is proportional to the pull of a spring, and an event at a force."""
    m, made = machine()
    m.torque("brake", "A", -0.2 * made["spring"].force * m.coordinate("q1_dot"))
    m.event("taut", "force(spring) + 30")
    other, _ = machine()
    other.torque("brake", "A", "-0.2*(-k*(distance(ground.post, b.tip) - 0.4))*q1_dot")
    mod, plain = (one.compile(target="numpy") for one in (m, other))
    assert mod.rhs(0.4, X) == pytest.approx(plain.rhs(0.4, X), rel=1e-13)
    assert mod.jacobian(0.4, X) == pytest.approx(plain.jacobian(0.4, X), rel=1e-11, abs=1e-11)
    traj = mod.simulate(1.0, initial={"q1": 0.5, "q2": -1.1})
    assert traj.t_events["taut"].size


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("force(spring2)", "no force element 'spring2'"),
        ("force(load)", "'load' does not act along a path; power(load) is known of every element"),
        ("force(extra)", "algebraic loop between laws: force(extra) -> force(extra)"),
        ("power(extra)", "algebraic loop between laws: power(extra) -> power(extra)"),
        ("force(1 + k)", "force() takes the name of one force element"),
        ("force(spring, in=b)", "has several parts"),
    ],
)
def test_what_cannot_be_asked(law: str, message: str) -> None:
    m, _ = machine()
    m.torque("extra", "A", law)
    with pytest.raises(eg.ModelError) as told:
        m.derive()
    assert message in str(told.value)
    m, _ = machine()
    m.torque("one", "A", "force(two)")
    m.torque("two", "B", "0.5*force(one)")
    with pytest.raises(eg.ModelError, match=r"algebraic loop between laws: force\(two\) -> force\(one\)"):
        m.derive()


def test_components_and_other_descriptions() -> None:
    """Of a component, its own element is meant; every other description of the model agrees."""
    leg = eg.Model("leg")
    leg.parameter("k", 50.0)
    leg.body("shank", mass=1.0, inertia={"zz": 0.05}, markers={"foot": (0.3, 0, 0)})
    leg.attachment("hip")
    leg.revolute("J", "hip", "shank", coordinate="bend")
    leg.torsional_spring("elastic", "J", stiffness="k")
    leg.output("pull", "force(elastic)")
    m = eg.Model("two_legs", gravity=(0, -9.81, 0))
    for name, place in (("left", -0.2), ("right", 0.2)):
        m.add(leg, prefix=f"{name}_", at={"hip": m.ground.at(place, 0, 0)})
    m.torque("hold", "left_J", "-0.3*force(right_elastic) - 0.1*power(left_elastic)")
    m.parameter("unused", 1.0)
    mod = m.compile(target="numpy")
    x = np.array([0.4, -0.3, 0.2, 0.1])
    assert mod.outputs(0.0, x) == pytest.approx([-20.0, 15.0], rel=1e-14)
    result = m.compile().verify()
    assert result.ok, str(result)
