"""Force laws and events that depend on the motion of markers and on outputs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
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


def test_the_law_of_a_closed_loop_whichever_joint_is_cut() -> None:
    found = []
    for named in ({"coordinate": "s"}, {}):
        m = eg.Model("crank_with_law")
        m.gravity = (0, -9.81, 0)
        m.body("crank", mass=0.4, com=(0.1, 0, 0), inertia={"zz": 0.002})
        m.body("rod", mass=0.6, com=(0.3, 0, 0), inertia={"zz": 0.02})
        m.body("slider", mass=0.5)
        m.bodies["crank"].marker("pin", at=(0.2, 0, 0))
        m.bodies["rod"].marker("tip", at=(0.6, 0, 0))
        m.bodies["slider"].marker("face", at=(0.05, 0.02, 0))
        m.revolute("A", "ground", "crank", coordinate="theta")
        m.revolute("B", "crank.pin", "rod", **({} if named else {"coordinate": "beta"}))
        m.revolute("C", "rod.tip", "slider")
        m.prismatic("D", "ground", "slider", axis="x", **named)
        m.output("stretch", "x(slider.face) - 0.5")
        m.torque("M", "A", "-30*stretch - 0.2*vx(slider.face) + wz(rod, from=crank)")
        m.independent("theta")
        mod = m.compile(target="numpy")
        x = mod.x0({"theta": 0.7, "theta_dot": 3.0})
        v = mod.rhs(0.0, x)
        found.append([v[mod.x_names.index("theta_dot")], mod.outputs(0.0, x)[0]])
    assert found[0] == pytest.approx(found[1], rel=1e-10)


@pytest.mark.parametrize(
    ("outputs", "law", "message"),
    [
        ({"h": "ax(b.tip)"}, "-h", "the output 'h' depends on the acceleration 'ax(b.tip)'"),
        ({"h": "2*q1_ddot"}, "-h", "the output 'h' depends on the acceleration 'q1_ddot'"),
        ({"h": "total_energy"}, "-h", "the output 'h' depends on 'total_energy'"),
        ({"h": "2*g", "g": "h + 1"}, "-h", "depends on itself: h -> g -> h"),
        ({}, "ax(b.tip)", "the acceleration of a marker 'ax(b.tip)' cannot be used here"),
        ({}, "angle(a, b.tip)", "the z axes of the two markers of angle(a, b.tip) do not stay in line"),
        ({}, "distance(a)", "distance() takes two markers"),
        ({}, "x(a, b)", "x() takes one marker"),
        ({}, "x(a, in=c)", "no body 'c'"),
        ({}, "x(a, at=b)", "x() takes no at="),
        ({}, "wx_body(a, in=b)", "wx_body() takes no in="),
        ({}, "x(a, from=com)", "the centre of mass of all bodies is no marker"),
        ({}, "sin(q1, in=b)", "sin() takes no keywords"),
    ],
)
def test_what_a_law_cannot_know(outputs: dict[str, str], law: str, message: str) -> None:
    m = arm("refused")
    for name, text in outputs.items():
        m.output(name, text)
    m.torque("M", "A", law)
    with pytest.raises(eg.ModelError, match=".*") as told:
        m.derive()
    assert message in str(told.value)


def test_names_that_outputs_shared_before_stay_free() -> None:
    """An output may be called as a sum of all bodies that it is, or as the variable of an element's law."""
    m = arm("shared_names")
    m.output("total_energy", "total_energy")
    m.output("length", "q1")
    m.element("e", "ground.road", "b.tip", law="-k*(length - l0)")
    m.torque("M", "A", "-momentum_x")
    assert m.compile(target="numpy").y_names == ("total_energy", "length")


def test_every_other_description_agrees() -> None:
    m = written_out(arm("verified"))
    m.output("ahead", "x(b.tip, from=a, in=ground.road)")
    m.torque("M", "A", "-3*ahead - 0.2*wz(b, from=a, in=a.tip)")
    result = m.compile().verify()
    assert result.ok, str(result)
