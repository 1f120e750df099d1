"""Laws, outputs and events that depend on motions of markers, on outputs and on forces of elements; roots at rest."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from force_judges import read_back
from judges import differences
from models import IN_C
from refusals import refuses
from scipy.spatial.transform import Rotation

import eomgen as eg


def arm(name: str, **values: Any) -> eg.Model:
    """Two links in space on a turned support: a universal motion, so that no axes stay in line."""
    m = eg.Model(name, **values)
    m.gravity = (0.3, -9.0, 1.0)
    for parameter, value in (("k", 70.0), ("c", 3.0), ("l0", 0.4)):
        m.parameter(parameter, value)
    m.ground.marker("road", at=(0.3, -0.2, 0.1), rpy=(0.3, 0.2, 0.5))
    for link, mass in (("a", 1.2), ("b", 0.7)):
        m.body(link, mass=mass, com=(0.2, 0, 0), inertia=(0.01, 0.03, 0.02))
    m.bodies["a"].marker("tip", at=(0.5, 0, 0), rpy=(0.1, 0.7, -0.4))
    m.bodies["b"].marker("tip", at=(0.4, 0.1, -0.05), rpy=(-0.6, 0.2, 0.9))
    m.revolute("A", "ground", "a", coordinate="q1")
    m.spherical("B", "a.tip", "b", rotation="euler_parameters")
    return m


def frame(poses: np.ndarray, body: int, at: tuple[float, ...], rpy: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Position and axes of a marker, from a body's pose (None: ground)."""
    pose = poses[body] if body >= 0 else np.eye(4)
    return pose[:3, :3] @ np.array(at) + pose[:3, 3], pose[:3, :3] @ Rotation.from_euler("xyz", rpy).as_matrix()


START = {"q1": 0.4, "B_e0": 0.8, "B_e1": 0.2, "B_e2": -0.4, "B_e3": 0.4, "q1_dot": 1.1, "B_wx": 0.7, "B_wy": -0.9}
ROAD = (-1, (0.3, -0.2, 0.1), (0.3, 0.2, 0.5))
A_TIP, B_TIP = (0, (0.5, 0, 0), (0.1, 0.7, -0.4)), (1, (0.4, 0.1, -0.05), (-0.6, 0.2, 0.9))


def along(mod: Any, x: np.ndarray, of: Callable[[np.ndarray], Any]) -> Any:
    """The rate of a function of poses along the motion, by differences of the fourth order."""
    rates = mod.rhs(0.0, x)[: len(mod.q_names)]

    def at(h: float) -> Any:
        moved = x.copy()
        moved[: len(rates)] += h * rates
        return np.asarray(of(mod.poses(moved[: len(rates)])))

    h = 2e-4
    return (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)


def turning(mod: Any, x: np.ndarray, marker: tuple[Any, ...]) -> np.ndarray:
    """Angular velocity of a marker in ground axes, from R' R^T."""
    spin = along(mod, x, lambda poses: frame(poses, *marker)[1]) @ frame(mod.poses(x[: len(mod.q_names)]), *marker)[1].T
    return np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2


def test_quantities_are_those_of_the_poses() -> None:
    m = arm("seen_markers")
    texts = {
        "d": "distance(ground.road, b.tip)",
        "d_com": "distance(a.tip, com)",
        "from_com": "distance(com, a.tip) + distance_rate(com, a.tip) - distance_rate(a.tip, com)",
        "d_rate": "distance_rate(a, b.tip)",
        **{f"p{k}": f"{k}(b.tip, from=a.tip, in=ground.road)" for k in "xyz"},
        **{f"v{k}": f"v{k}(b.tip, in=a.tip, from=ground.road)" for k in "xyz"},
        **{f"w{k}": f"w{k}(b, from = a, in = b.tip)" for k in "xyz"},
        **{f"r{k}": f"{k}(b.tip,in=a.tip)" for k in "xyz"},
        "turned": "angle(ground.road, a)",
        "turning": "angle_rate(a, ground.road)",
    }
    for name, text in texts.items():
        m.output(name, text)
    mod = m.compile(target="numpy")
    x = mod.x0(START)
    poses, y = mod.poses(x[: len(mod.q_names)]), dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    road, a_tip, b_tip = (frame(poses, *marker) for marker in (ROAD, A_TIP, B_TIP))
    a = (0, (0, 0, 0), (0, 0, 0))

    def place(marker: tuple[Any, ...]) -> Callable[[np.ndarray], np.ndarray]:
        return lambda poses: frame(poses, *marker)[0]

    def gap(poses: np.ndarray) -> float:
        return float(np.linalg.norm(place(B_TIP)(poses) - place(a)(poses)))

    com = [poses[k][:3, :3] @ [0.2, 0, 0] + poses[k][:3, 3] for k in (0, 1)]
    assert y["d"] == pytest.approx(np.linalg.norm(b_tip[0] - road[0]), rel=1e-14)
    assert y["d_com"] == pytest.approx(np.linalg.norm(np.average(com, 0, [1.2, 0.7]) - a_tip[0]), rel=1e-14)
    assert y["from_com"] == pytest.approx(y["d_com"], rel=1e-14)
    assert y["d_rate"] == pytest.approx(along(mod, x, gap), rel=1e-9)
    velocity = along(mod, x, place(B_TIP))
    spin = turning(mod, x, B_TIP) - turning(mod, x, A_TIP)
    for stem, expected in (
        ("p", road[1].T @ (b_tip[0] - a_tip[0])),
        ("v", a_tip[1].T @ velocity),
        ("w", b_tip[1].T @ spin),
        ("r", a_tip[1].T @ b_tip[0]),
    ):
        assert [y[stem + k] for k in "xyz"] == pytest.approx(expected, abs=2e-10)
    assert y["turning"] == pytest.approx(-turning(mod, x, A_TIP)[2], abs=1e-10)
    between = road[1].T @ poses[0][:3, :3]
    assert y["turned"] == pytest.approx(np.arctan2(between[1, 0], between[0, 0]), abs=1e-14)


SPRING = "-(k*(distance(ground.road, b.tip) - l0) + c*distance_rate(ground.road, b.tip))"


def written_out(m: eg.Model) -> eg.Model:
    """A spring and damper between two markers as a law of their motion."""
    pull = f"({SPRING})/distance(ground.road, b.tip)"
    m.force("pull", "b.tip", value=[f"{pull}*{k}(b.tip, from=ground.road)" for k in "xyz"])
    return m


@pytest.mark.parametrize("method", ["recursive", "embedding", "lagrange"])
def test_a_law_of_markers_is_the_spring_that_it_says(method: str) -> None:
    spring = arm("with_spring")
    spring.spring("s", "ground.road", "b.tip", stiffness="k", length="l0")
    spring.damper("d", "ground.road", "b.tip", damping="c")
    one = spring.compile(method=method, target="numpy")
    other = written_out(arm("with_law")).compile(method=method, target="numpy")
    x = one.x0(START)
    assert other.rhs(0.0, x) == pytest.approx(one.rhs(0.0, x), rel=1e-12, abs=1e-12)
    assert other.jacobian(0.0, x) == pytest.approx(one.jacobian(0.0, x), rel=1e-11, abs=1e-10)
    assert other.parameter_jacobian(0.0, x) == pytest.approx(one.parameter_jacobian(0.0, x), rel=1e-11, abs=1e-11)


def test_outputs_stand_for_what_they_are() -> None:
    """In any order, of outputs of outputs, whatever their unit: as if their expressions were written in their place."""
    m = arm("with_outputs")
    m.output("pull", "reach*stretch")
    m.output("stretch", "-(k*(gap - l0) + c*rate)", unit="N")
    m.output("reach", "1/gap")
    m.output("gap", "distance(ground.road, b.tip)", unit="mm")
    m.output("rate", "distance_rate(ground.road, b.tip)")
    m.force("pull_b", "b.tip", value=[f"pull*{k}(b.tip, from=ground.road)" for k in "xyz"])
    m.parameter("unused", 1.0, unit="m")
    m.event("far", "gap - 0.7")
    mod, plain = m.compile(target="numpy"), written_out(arm("without_outputs")).compile(target="numpy")
    x = mod.x0(START)
    assert mod.rhs(0.0, x) == pytest.approx(plain.rhs(0.0, x), rel=1e-13)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    assert y["pull"] == pytest.approx(y["stretch"] / (y["gap"] / 1000.0), rel=1e-13)
    traj = mod.simulate((0, 2), initial={"q1": 0.4, "q1_dot": 3.0})
    place = mod.y_names.index("gap")
    gaps = [mod.outputs(t, x)[place] for t, x in zip(traj.t_events["far"], traj.x_events["far"].T, strict=True)]
    assert gaps == pytest.approx([700.0] * len(gaps), abs=1e-4)
    assert gaps


def test_the_same_in_python_and_in_a_file(tmp_path: Any) -> None:
    m = arm("in_python")
    tip, road = (
        m.bodies["b"].at(0.4, 0.1, -0.05, rpy=(-0.6, 0.2, 0.9)),
        m.ground.at(0.3, -0.2, 0.1, rpy=(0.3, 0.2, 0.5)),
    )
    d = tip.distance(road)
    pull = -(m.coordinate("k") * (d - m.coordinate("l0")) + m.coordinate("c") * tip.distance_rate(road)) / d
    m.force("pull", tip, value=[pull * part for part in tip.seen(road).position])
    m.output("slip", tip.seen(axes=road).velocity[0])
    m.output("spin", tip.seen(m.bodies["a"], tip).angular_velocity[2])
    m.save(tmp_path / "arm.yaml")
    made, plain = m.compile(target="numpy"), written_out(arm("in_texts")).compile(target="numpy")
    read = eg.load(tmp_path / "arm.yaml").compile(target="numpy")
    x = made.x0(START)
    assert made.rhs(0.0, x) == pytest.approx(plain.rhs(0.0, x), rel=1e-13)
    assert read.rhs(0.0, x) == pytest.approx(plain.rhs(0.0, x), rel=1e-13)
    assert read.outputs(0.0, x) == pytest.approx(made.outputs(0.0, x), rel=1e-13)


@pytest.mark.parametrize(
    ("outputs", "law", "message"),
    [
        ({"h": "ax(b.tip)"}, "-h", "EG-REFERENCE forces.M.value h ax(b.tip)"),
        ({"h": "2*g", "g": "h + 1"}, "-h", "EG-CIRCLE outputs.h h -> g -> h"),
        ({}, "ax(b.tip)", "EG-REFERENCE forces.M.value ax(b.tip)"),
        ({}, "angle(a, b.tip)", "EG-UNDEFINED forces.M b.tip"),
        ({}, "distance(a)", "EG-EXPRESSION forces.M.value"),
        ({}, "x(a, in=c)", "EG-NAME-UNKNOWN forces.M.value c"),
        ({}, "x(a, at=b)", "EG-EXPRESSION forces.M.value at="),
        ({}, "x(a, from=com)", "EG-EXPRESSION forces.M.value"),
    ],
)
def test_what_a_law_cannot_know(outputs: dict[str, str], law: str, message: str) -> None:
    m = arm("refused")
    for name, text in outputs.items():
        m.output(name, text)
    m.torque("M", "A", law)
    refuses(message, m.derive)


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
    mod = m.compile(target="numpy")
    y = dict(zip(mod.y_names, mod.outputs(0.4, X), strict=True))
    read = read_back(m, tmp_path).compile(target="numpy")
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
    traj = mod.simulate(0.2, initial={"q1": 0.5, "q2": -1.1})
    assert traj.t_events["taut"].size


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ("force(spring2)", "EG-NAME-UNKNOWN forces.extra.value spring2"),
        ("force(load)", "EG-UNSUPPORTED forces.extra.value load"),
        ("force(extra)", "EG-CIRCLE forces.extra"),
        ("force(1 + k)", "EG-EXPRESSION forces.extra.value"),
    ],
)
def test_what_cannot_be_requested(law: str, message: str) -> None:
    m, _ = machine()
    m.torque("extra", "A", law)
    refuses(message, m.derive)


def test_laws_that_use_each_other_are_refused() -> None:
    m, _ = machine()
    m.torque("one", "A", "force(two)")
    m.torque("two", "B", "0.5*force(one)")
    refuses("EG-CIRCLE forces.two", m.derive)


def test_forces_in_components() -> None:
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
    mod = m.compile(target="numpy")
    x = np.array([0.4, -0.3, 0.2, 0.1])
    assert mod.outputs(0.0, x) == pytest.approx([-20.0, 15.0], rel=1e-14)


THOROUGH = pytest.mark.thorough
SQUARES = "(vx(b)**2 + vy(b)**2 + vz(b)**2)"
SPEED = f"sqrt({SQUARES})"
G = 9.81


def falling(*force: str, c: float = 1.0) -> eg.Model:
    m = eg.Model("drag", gravity=(0, 0, "-g"))
    m.parameter("g", G)
    m.parameter("c", c)
    b = m.body("b", mass=1)
    m.translational("t", m.ground, b)
    m.force("d", b, list(force) if len(force) == 3 else [f"-c*v{k}(b)*{force[0]}" for k in "xyz"])
    return m


DIFFERENTIABLE = {
    "sqrt": SPEED,
    "hypot": "hypot(hypot(vx(b), vy(b)), vz(b))",
    "a power of squares": f"{SQUARES}**0.3",
    "a root of a root": f"sqrt({SPEED})",
    "abs": "abs(vz(b))**0.7",
    "saturated": f"tanh({SPEED})/(1 + {SPEED})",
    "squared": "hypot(vx(b), vz(b))**2",
}


@pytest.mark.parametrize("law", DIFFERENTIABLE)
def test_the_derivative_of_drag_at_rest_is_zero(law: str) -> None:
    mod = falling(DIFFERENTIABLE[law]).compile(target="numpy")
    J = mod.jacobian(0.0, np.zeros(6))
    assert (J[3:] == 0.0).all()
    assert (np.asarray(mod.linearize(np.zeros(6)).A) == J).all()
    x = np.array([0.0, 0.0, 0.0, 0.3, -0.4, 0.8])
    np.testing.assert_allclose(mod.jacobian(0.0, x), differences(mod, x, 1e-6), atol=1e-8)


@pytest.mark.parametrize(
    "force",
    [
        ("0", "0", f"-{SPEED}"),
        ("0", "0", "-sign(vz(b))*sqrt(abs(vz(b)))"),
        ("0", "0", "-sqrt(vz(b) + x(b))*sqrt(2*vz(b) + 2*x(b))*(1 + x(b))"),
        ("0", "0", "cos(sqrt(vz(b)))"),
    ],
)
def test_what_has_no_derivative_is_refused_by_the_call_that_takes_it(force: tuple[str, str, str]) -> None:
    mod = falling(*force).compile(target="numpy")
    refuses("EG-NOT-FINITE jacobian 0", mod.jacobian, 0.0, np.zeros(6))
    if "vz(b) +" not in force[2] and "cos" not in force[2]:
        for method in ("Radau", "BDF"):
            refuses("EG-STALLED jacobian 0", mod.simulate, 1.0, method=method)
        assert np.isfinite(mod.simulate(0.5).x).all()


@pytest.mark.parametrize("law", ["hypot", *(pytest.param(x, marks=THOROUGH) for x in ("sqrt", "a power of squares"))])
def test_compiled_runs_from_rest(law: str) -> None:
    """v' = -g + v^2 has v = -sqrt(g) tanh(sqrt(g) t); other powers against DOP853."""
    mod = falling(DIFFERENTIABLE[law]).compile(**IN_C)
    assert (mod.jacobian(0.0, np.zeros(6))[3:] == 0.0).all()
    exact = -np.sqrt(G) * np.tanh(5 * np.sqrt(G))
    expected = mod.simulate(5.0, rtol=1e-12, atol=1e-14)["t_z_dot"][-1] if law == "a power of squares" else exact
    for method in ("Radau", "BDF", "Taylor"):
        assert mod.simulate(5.0, method=method)["t_z_dot"][-1] == pytest.approx(expected, abs=1e-7)
    starts = {"t_x_dot": [0.0, 0.0, 1.0, 0.0], "t_z_dot": [0.0, -1.0, 0.0, 0.5]}
    runs = [mod.simulate_many(2.0, starts, method=method) for method in ("Taylor", "DOP853")]
    np.testing.assert_allclose(runs[0].x, runs[1].x, atol=1e-6)
