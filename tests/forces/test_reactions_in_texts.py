"""Reactions of joints and multipliers of equations in laws, outputs and events, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.errors import ModelError, NonFiniteError

G = 9.81
TARGETS = ("numpy", "cython")
PARTS = ("x", "y", "z", "mx", "my", "mz")


def with_all_reactions(m: eg.Model, joints: str | list[str]) -> eg.Model:
    for name in joints:
        for part in PARTS:
            m.output(f"{name}_r{part}", f"reaction({name}).{part}")
    return m


KINDS = ("revolute", "prismatic", "cylindrical", "universal", "spherical", "screw", "planar", "weld", "free")


def spatial_tree(kind: str, late: bool = True) -> eg.Model:
    """A joint on another, with drives along coordinates; with ``late`` only outputs speak of reactions."""
    m = eg.Model("tree", gravity=(0.3, -1.0, -G))
    base = m.body("base", mass=1.4, com=(0.2, 0, 0.1), inertia=(0.02, 0.03, 0.04))
    m.revolute("A", m.ground.at(0, 0.2, 0, rpy=(0.4, 0.1, 0)), base)
    body = m.body("body", mass=1.1, com=(0.1, 0.05, -0.02), inertia=(0.02, 0.03, 0.04))
    body.marker("edge", at=(0.1, 0, 0), rpy=(0.3, 0.5, -0.2))
    more = {"pitch": 0.1} if kind == "screw" else {}
    made = m.joint(kind, "B", base.at(0.3, 0.1, 0.05, rpy=(0.2, -0.3, 0.1)), body, **more)
    m.torque("motor", "A", 1.3)
    for k, name in enumerate(made.coordinate_names[-2:]):
        m.torque(f"drive{k}", name, f"2*sin(t + {k})")
    if not late:
        m.event("turns", "reaction(B).x")
    return with_all_reactions(m, "AB")


@pytest.mark.parametrize(
    ("kind", "late"),
    [(kind, late) for kind in KINDS for late in (True, False) if late or kind != "free"],  # free carries nothing to see
)
def test_outputs_are_the_reactions_of_every_kind_of_joint(kind: str, late: bool) -> None:
    """Those of ``reactions`` of the module are summed up from numbers, and without what acts along coordinates."""
    mod = spatial_tree(kind, late).compile(target="numpy")
    random = np.random.default_rng(5)
    for _ in range(2):
        x = random.uniform(-0.6, 0.6, mod.n_x)
        found, expected = mod.outputs(0.4, x).reshape(-1, 6), mod.reactions(0.4, x)
        assert found == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


def test_components_along_the_axes_of_a_marker() -> None:
    m = spatial_tree("cylindrical")
    for part in PARTS:
        m.output(f"seen_{part}", f"reaction(B, in=body.edge).{part}")
    m.output("size", "reaction(B).size")
    mod = m.compile(target="numpy")
    x = np.random.default_rng(6).uniform(-0.6, 0.6, mod.n_x)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    turned = Rotation.from_euler("xyz", (0.3, 0.5, -0.2)).as_matrix()  # about fixed axes, as rpy
    R, wrench = mod.poses(x[: mod.n_q])[1, :3, :3] @ turned, mod.reactions(0.0, x)[1]
    assert [y[f"seen_{part}"] for part in PARTS] == pytest.approx([*(R.T @ wrench[:3]), *(R.T @ wrench[3:])], abs=1e-9)
    assert y["size"] == pytest.approx(np.linalg.norm(wrench[:3]), rel=1e-12)


def engine(text: bool) -> eg.Model:
    m = eg.Model("engine", gravity=(0, -G, 0))
    m.parameter("mu", 0.1)
    crank = m.body("crank", mass=1.0, inertia={"zz": 0.01}, com=(0.05, 0, 0))
    rod = m.body("rod", mass=0.8, inertia={"zz": 0.02}, com=(0.15, 0, 0))
    piston = m.body("piston", mass=0.5, inertia={"zz": 0.001})
    pin = m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.1, 0, 0), rod)
    m.revolute("C", rod.at(0.3, 0, 0), piston)
    slide = m.prismatic("S", m.ground, piston, axis="x", coordinate="s")
    m.initial(theta=0.8, theta_dot=20.0)
    m.guess(s=0.35)
    if text:
        m.torque("wall", slide, "-mu*reaction(S).normal*tanh(s_dot/0.01)")
        m.torque("pin", pin, -0.002 * pin.reaction.normal * sp.tanh(sp.Symbol("theta_dot") / 0.01))
    else:
        m.friction("wall", joint="S", coefficient="mu", smoothing=0.01)
        m.friction("pin", joint="A", coefficient="mu", radius=0.02, smoothing=0.01)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_loop_with_friction_as_texts(target: str) -> None:
    """The same as the element, which is held against free bodies elsewhere; multipliers are those of the module."""
    m = with_all_reactions(engine(text=True), "ABCS")
    for row in ("C.r_x", "C.r_y"):
        m.output(row.replace(".", "_"), f"multiplier({row})")
    mod, other = m.compile(target=target), engine(text=False).compile(target="numpy")
    x = mod.x0()
    assert mod.constraint_labels == ("C.r_x", "C.r_y")
    assert mod.rhs(0.0, x) == pytest.approx(other.rhs(0.0, other.x0()), rel=1e-12)
    y = mod.outputs(0.0, x)
    assert y[:24].reshape(4, 6) == pytest.approx(mod.reactions(0.0, x), abs=1e-11)
    assert y[24:] == pytest.approx(mod.multipliers(0.0, x), rel=1e-11)


@pytest.mark.parametrize("target", TARGETS)
def test_jacobian_and_sensitivities_see_the_reaction(target: str) -> None:
    mod = engine(text=True).compile(target=target)
    x, h = mod.x0(), 1e-5
    steps = [(mod.rhs(0, x + h * e) - mod.rhs(0, x - h * e)) / (2 * h) for e in np.eye(6)]
    assert mod.jacobian(0.0, x) == pytest.approx(np.array(steps).T, rel=1e-5, abs=1e-3)


def ladder(mu_wall: float, mu_floor: float, mass: float = 5.0, length: float = 3.0) -> eg.Model:
    """A ladder that slides down a wall: two equations, and friction at both ends by their multipliers."""
    m = eg.Model("ladder", gravity=(0, -G, 0))
    rod = m.body("rod", mass=mass, inertia={"zz": mass * length**2 / 12})
    foot, top = rod.marker("foot", at=(length / 2, 0, 0)), rod.marker("top", at=(-length / 2, 0, 0))
    m.planar("fly", m.ground, rod)
    m.coupling("wall", equation="x(rod.top)")
    m.coupling("floor", equation="y(rod.foot)")
    m.force("on_foot", foot, value=(f"-{mu_floor}*abs(multiplier(floor))*tanh(vx(rod.foot)/1e-3)", 0, 0))
    m.force("on_top", top, value=(0, f"-{mu_wall}*abs(multiplier(wall))*tanh(vy(rod.top)/1e-3)", 0))
    m.output("floor_force", "-multiplier(floor)")
    m.output("wall_force", "-multiplier(wall)")
    m.initial(fly_3=-1.0, fly_x=1.5 * np.cos(1.0), fly_y=1.5 * np.sin(1.0), fly_3_dot=0.5)
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_sliding_ladder(target: str) -> None:
    """The friction of each end changes the force at the other: five equations of one free body (a textbook's)."""
    mass, length, mu_w, mu_f = 5.0, 3.0, 0.25, 0.3
    mod = ladder(mu_w, mu_f).compile(target=target)
    x = mod.x0()
    angle, rate, a = 1.0, -0.5, length / 2  # of the ladder over the floor: centre at a (cos, sin)
    # unknown: angular acceleration of the angle, N_wall, N_floor; foot slides out (+x), top down (-y)
    c, s = np.cos(angle), np.sin(angle)
    ax = (-a * s, -a * c * rate**2)  # = first * alpha + second
    ay = (a * c, -a * s * rate**2)
    # foot at a (c, -s) from the centre with (-mu N, N), top at a (-c, s) with (N, mu N); the angle grows clockwise
    moment = -np.array([-a * c * mu_w - a * s, a * c - a * s * mu_f])
    A = np.array([[mass * ax[0], -1.0, mu_f], [mass * ay[0], -mu_w, -1.0], [mass * length**2 / 12, *-moment]])
    b = np.array([-mass * ax[1], -mass * ay[1] - mass * G, 0.0])
    alpha, wall, floor = np.linalg.solve(A, b)
    y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
    rates = dict(zip(mod.v_names, mod.rhs(0.0, x)[mod.n_q :], strict=True))
    assert [y["wall_force"], y["floor_force"], -rates["fly_3_dot"]] == pytest.approx([wall, floor, alpha], rel=1e-9)


@pytest.mark.parametrize("lead_angle", [0.1, 0.4])
@pytest.mark.parametrize("target", TARGETS)
def test_worm_gear_efficiency(target: str, lead_angle: float) -> None:
    """Raising needs the torque r F tan(l + p); lowering holds by itself where the angle of friction p exceeds l."""
    r, phi, load = 0.02, 0.25, 300.0
    lead = r * np.tan(lead_angle)  # of the nut for one radian
    m = eg.Model("jack", gravity=(0, 0, 0))
    screw, nut = m.body("screw", mass=1, inertia=(1e-3,) * 3), m.body("nut", mass=2, inertia=(1e-3,) * 3)
    m.revolute("turn", m.ground, screw)
    m.prismatic("lift", m.ground, nut)
    thread = m.rack("thread", "turn", "lift", radius=lead)  # lift = lead * turn
    m.torque("load", "lift", -load)
    m.torque("drive", "turn", m.input("tau", 0.0))
    m.parameter("up", r * (np.tan(lead_angle + phi) - np.tan(lead_angle)))
    m.parameter("down", r * (np.tan(lead_angle) - np.tan(lead_angle - phi)))
    rubbing = "-abs(multiplier(thread))*tanh(turn_dot/1e-4)*(up if turn_dot > 0 else down)"
    m.torque("loss", "turn", rubbing)
    m.output("F", thread.multiplier())
    mod = m.compile(target=target)
    torque = r * load * np.tan(lead_angle + phi)
    turning = np.array([0.0, 0.0, 5.0, 5.0 * lead])
    assert np.abs(mod.rhs(0.0, turning, u=[torque])[2:]).max() < 1e-6  # it goes on at its speed
    assert abs(mod.outputs(0.0, turning, u=[torque])[0]) == pytest.approx(load, rel=1e-9)
    efficiency = load * lead / torque
    assert efficiency == pytest.approx(np.tan(lead_angle) / np.tan(lead_angle + phi), rel=1e-12)
    sinking = -np.array([0.0, 0.0, 5.0, 5.0 * lead])
    brakes = mod.rhs(0.0, sinking)[2] > 0.0  # the load alone cannot turn the screw
    assert brakes == (phi > lead_angle)


@pytest.mark.parametrize("target", TARGETS)
def test_bead_leaves_a_sphere(target: str) -> None:
    """A particle that slides down a sphere from rest leaves it where the cosine is 2/3."""
    m = eg.Model("bead", gravity=(0, -G, 0))
    bead = m.body("bead", mass=0.3)
    m.revolute("A", m.ground, bead.at(0, -1.2, 0), coordinate="phi")  # the bead above the centre
    m.event("off", "reaction(A, in=bead).y", direction=-1, terminal=True)
    m.initial(phi=1e-6)
    mod = m.compile(target=target)
    run = mod.simulate(20.0)
    assert np.cos(run.x_events["off"][0][0]) == pytest.approx(2 / 3, rel=1e-7)


def test_weight_on_a_rolling_ball() -> None:
    m = eg.Model("ball", gravity=(0, 0, -G))
    ball = m.body("ball", mass=2.0, inertia=(0.01,) * 3)
    m.free("fly", m.ground, ball)
    roll = m.rolling("roll", ball, radius=0.1, shape="sphere")
    m.output("normal", -roll.multiplier("height"))
    m.output("slip", "multiplier(roll.slip_x)")
    m.initial(fly_z=0.1, fly_x_dot=1.0)
    mod = m.compile(target="numpy")
    assert mod.outputs(0.0, mod.x0()) == pytest.approx([2.0 * G, 0.0], abs=1e-9)


def jammed(mu: float) -> eg.Model:
    """A law that is linear in the reaction: the rod's own pin presses with mu times its force."""
    m = eg.Model("linear", gravity=(0, -G, 0))
    cart, mass = m.body("cart", mass=2.0), m.body("mass", mass=1.0)
    m.prismatic("x", m.ground, cart, axis="x")
    m.prismatic("y", cart, mass, axis="y")
    m.torque("side", "y", f"{mu}*reaction(y).x")  # the lift follows the side force
    m.torque("pull", "x", 3.0)
    return m


def test_linear_law_and_where_it_has_no_solution() -> None:
    """reaction(y).x is 1 kg times the cart's acceleration, 3/3, whatever mu is; the lift is mu times that less g."""
    mod = jammed(0.7).compile(target="numpy")
    assert mod.rhs(0.0, np.zeros(4))[2:] == pytest.approx([1.0, 0.7 - G], rel=1e-13)
    m = jammed(0.7)
    m.torque("back", "x", "c*x*reaction(y).x")  # (2 + 1 - c x) a = 3
    m.parameter("c", 2.0)
    mod = m.compile(target="numpy")
    state = np.array([1.0, 0.0, 0.0, 0.0])
    assert mod.rhs(0.0, state)[2] == pytest.approx(3.0, rel=1e-13)
    with pytest.raises(NonFiniteError, match="side and back depend on reactions"):
        mod.rhs(0.0, 2 * state)


def test_file_components_and_states(tmp_path: Path) -> None:
    """The same from a file, in an instance of a component, and in the rate of a state."""
    m = eg.Model("leg", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0), markers={"end": (0.4, 0, 0)})
    m.revolute("A", m.ground, rod)
    m.torque("rub", "A", "-0.01*reaction(A, in=rod.end).x*tanh(A_dot/0.01)")
    m.state("worn", "abs(A_dot)*reaction(A).normal")
    m.output("N", "reaction(A).normal")
    m.save(tmp_path / "leg.yaml")
    x = [0.7, 1.3, 0.0]
    mod, read = m.compile(target="numpy"), eg.load(tmp_path / "leg.yaml").compile(target="numpy")
    found = mod.rhs(0.0, x)
    assert found[2] == pytest.approx(1.3 * np.linalg.norm(mod.reactions(0.0, x)[0, :2]), rel=1e-12)
    assert read.rhs(0.0, x) == pytest.approx(found, rel=1e-15)
    whole = eg.Model("whole", gravity=(0, -G, 0))
    whole.add(eg.load(tmp_path / "leg.yaml"), prefix="left_")
    whole.output("left", "reaction(left.A).normal")
    both = whole.compile(target="numpy")
    assert both.rhs(0.0, x) == pytest.approx(found, rel=1e-14)
    assert both.outputs(0.0, x)[-1] == pytest.approx(mod.outputs(0.0, x)[0], rel=1e-14)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("reaction(B).x", "no joint 'B'.*known: A"),
        ("reaction(A)", r"a reaction has several parts.*write reaction\(joint\).part"),
        ("reaction(A).q", "a reaction has no part 'q'"),
        ("reaction(A, in=rod.tap).x", "'rod' has no marker 'tap'"),
        ("reaction(A, in=rod).size", "the part size does not depend on axes"),
        ("multiplier(C)", "no constraint or joint 'C'"),
        ("multiplier(A)", "'A' has no equation.*joints have equations where they close a loop"),
        ("sin(A).x", "a dot can be used only for markers"),
    ],
)
def test_what_is_wrong_is_told(text: str, told: str) -> None:
    m = eg.Model("pin")
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0))
    m.revolute("A", m.ground, rod)
    m.output("N", text)
    with pytest.raises(ModelError, match=told):
        m.compile(target="numpy")


def test_a_mass_cannot_be_a_reaction() -> None:
    m = eg.Model("mass")
    m.revolute("A", m.ground, m.body("rod", mass="reaction(A).x", inertia={"zz": 0.3}))
    with pytest.raises(ModelError, match=r"bodies.rod.mass: reaction\(...\) cannot be used here"):
        m.compile(target="numpy")


def test_a_force_that_can_let_go_is_judged_while_it_has_let_go() -> None:
    """Painleve's rod: a law max(0, N) has a second solution where m dN/df exceeds 1, also at a state without force."""
    m = eg.Model("second", gravity=(0, 0, 0))
    cart, mass = m.body("cart", mass=1.0), m.body("mass", mass=1.0)
    m.prismatic("x", m.ground, cart, axis="x")
    m.prismatic("y", cart, mass, axis="y")
    m.parameter("c", 1.0)
    m.torque("back", "x", "c*(1 + x)*max(0, reaction(y).x)")  # 2 a = f - 1, N = a
    m.torque("pull", "x", m.input("pull", -1.0))
    mod = m.compile(target="numpy")
    assert mod.rhs(0.0, np.zeros(4))[2] == pytest.approx(-0.5, rel=1e-14)
    with pytest.raises(NonFiniteError, match="Painleve"):
        mod.rhs(0.0, np.array([1.5, 0.0, 0.0, 0.0]))


def door() -> eg.Model:
    """Two hinges on one axis: how they share each load but the moment about it is not determined."""
    m = eg.Model("door", gravity=(0, 0, -G))
    leaf = m.body("leaf", mass=5, com=(0.4, 0, 0.5), inertia=(0.5, 0.6, 0.3))
    m.revolute("h1", m.ground, leaf)
    m.revolute("h2", m.ground.at(0, 0, 1), leaf.at(0, 0, 1))
    m.initial(h1=0.3, h1_dot=2.0)
    return m


@pytest.mark.parametrize("joint", ["h1", "h2"])  # in the tree, and cut
def test_what_two_hinges_share_is_refused_by_name(joint: str) -> None:
    for part in ("x", "y", "z", "mx", "my", "size", "normal"):
        m = door()
        m.output("o", f"reaction({joint}).{part}")
        with pytest.raises(ModelError, match=rf"outputs\.o.*reaction\({joint}\)\.{part} is undetermined.*spherical"):
            m.compile(target="numpy")
    m = door()
    m.output("o", f"reaction({joint}).mz")
    assert m.compile(target="numpy").outputs(0.0, [0.3, 2.0]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("place", ["friction", "law", "event", "state"])
def test_laws_refuse_what_two_hinges_share(place: str) -> None:
    m, load = door(), "reaction(h2).size"
    if place == "friction":
        m.friction("rub", joint="h2", coefficient=0.1, radius=0.02, smoothing=1e-3)
    elif place == "law":
        m.torque("rub", "h1", f"-0.01*{load}*tanh(h1_dot/1e-3)")
    elif place == "event":
        m.event("breaks", f"{load} - 30")
    else:
        m.state("wear", load)
    with pytest.raises(ModelError, match="h2.*undetermined"):
        m.compile(target="numpy")


@pytest.mark.parametrize("gravity", [(0.5, -G, 0), (0.5, -G, 2.0)])
@pytest.mark.parametrize("tilt", [0.0, 0.6])
def test_four_bar_whose_masses_leave_its_plane(gravity: tuple[float, float, float], tilt: float) -> None:
    """What ``undetermined_reactions`` marks is refused, all else is what ``reactions`` gives; in turned axes too."""

    def bar() -> eg.Model:
        m = eg.Model("bar", gravity=gravity)
        made = [
            m.body(name, mass=mass, com=com, inertia=(0.03, 0.03, 0.05), markers={"e": (end, 0, 0)})
            for name, mass, com, end in (
                ("a", 1.2, (0.2, 0.03, 0.05), 0.4), ("b", 1.7, (0.3, 0.1, 0), 0.7), ("c", 0.9, (0.25, 0, 0), 0.6),
            )
        ]  # fmt: skip
        m.revolute("A", m.ground, made[0], coordinate="qa")
        m.revolute("B", "a.e", made[1], coordinate="qb")
        m.revolute("C", "b.e", "c.e")
        m.revolute("D", m.ground.at(0.8, 0.1, 0), made[2], coordinate="qd")
        made[2].marker("tilted", at=(0, 0, 0), rpy=(0, 0, tilt))
        m.guess(qa=0.9, qb=-0.6, qd=1.5)
        m.initial(qa=0.9, qa_dot=2.0)
        return m

    plain = bar().compile(target="numpy")
    x = plain.x0()
    expected, undetermined = plain.reactions(0.0, x), plain.undetermined_reactions(0.0, x)
    assert undetermined[:, 2:5].all()
    assert not undetermined[:, [0, 1, 5]].any()
    for k, joint in enumerate("ABCD"):
        for part in ("z", "mx", "my"):
            m = bar()
            m.output("o", f"reaction({joint}).{part}")
            with pytest.raises(ModelError, match="undetermined"):
                m.compile(target="numpy")
        m = bar()
        for part in ("x", "y", "mz"):
            m.output(part, f"reaction({joint}).{part}")
        m.output("turned", f"reaction({joint}, in=c.tilted).mz")
        found = m.compile(target="numpy").outputs(0.0, x)
        assert found == pytest.approx([*expected[k, [0, 1, 5]], expected[k, 5]], abs=1e-9)


def test_tension_of_a_rope_over_a_massless_pulley():
    """Atwood's double machine: the multiplier of each rope is its force."""
    m1, m2, m3, g = 4.0, 1.0, 2.5, 9.81
    rope = np.linalg.solve(
        [[m1, 0, 0, 2], [0, m2, 0, 1], [0, 0, m3, 1], [1, 0.5, 0.5, 0]], [m1 * g, m2 * g, m3 * g, 0]
    )[3]
    m = eg.Model("atwood", gravity=(0, -g, 0))
    for i, (name, mass) in enumerate((("w1", m1), ("w2", m2), ("w3", m3), ("pulley", 0))):
        m.prismatic(f"{name}_y", m.ground.at(0.5 * i, 0, 0), m.body(name, mass=mass), axis="-y")
    m.coupling("rope1", {"w1_y": 1, "pulley_y": 1}, 2.0)
    m.coupling("rope2", {"w2_y": 1, "w3_y": 1, "pulley_y": -2}, 1.0)
    m.output("upper", "multiplier(rope1)")
    m.output("lower", "multiplier(rope2)")
    m.initial(w1_y=1.0, w2_y=1.2)
    mod = m.compile(target="numpy")
    x = mod.x0()
    assert np.abs(mod.outputs(0.0, x)) == pytest.approx([2 * rope, rope], rel=1e-12)
    assert mod.outputs(0.0, x) == pytest.approx(mod.multipliers(0.0, x), rel=1e-9)
