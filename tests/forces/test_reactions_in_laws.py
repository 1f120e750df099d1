"""Reactions of joints and multipliers of equations in laws, outputs and events, against closed forms."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from force_judges import read_back
from judges import differences
from refusals import refuses
from scipy.spatial.transform import Rotation
from sweeps import TARGETS

import eomgen as eg

G = 9.81
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


@pytest.mark.parametrize(("kind", "late"), [*((kind, True) for kind in KINDS), ("revolute", False), ("screw", False)])
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
    options = {} if target == "numpy" else {"optimize": 0}
    mod, other = m.compile(target=target, **options), engine(text=False).compile(target="numpy")
    x = mod.x0()
    assert mod.constraint_labels == ("C.r_x", "C.r_y")
    assert mod.rhs(0.0, x) == pytest.approx(other.rhs(0.0, other.x0()), rel=1e-12)
    y = mod.outputs(0.0, x)
    assert y[:24].reshape(4, 6) == pytest.approx(mod.reactions(0.0, x), abs=1e-11)
    assert y[24:] == pytest.approx(mod.multipliers(0.0, x), rel=1e-11)


def test_jacobian_sees_the_reaction() -> None:
    mod = engine(text=True).compile(target="numpy")
    x = mod.x0()
    assert mod.jacobian(0.0, x) == pytest.approx(differences(mod, x, 1e-5), rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("lead_angle", [0.1, 0.4])
def test_worm_gear_efficiency(lead_angle: float) -> None:
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
    mod = m.compile(target="numpy")
    torque = r * load * np.tan(lead_angle + phi)
    turning = np.array([0.0, 0.0, 5.0, 5.0 * lead])
    assert np.abs(mod.rhs(0.0, turning, u=[torque])[2:]).max() < 1e-6  # it goes on at its speed
    assert abs(mod.outputs(0.0, turning, u=[torque])[0]) == pytest.approx(load, rel=1e-9)
    efficiency = load * lead / torque
    assert efficiency == pytest.approx(np.tan(lead_angle) / np.tan(lead_angle + phi), rel=1e-12)
    sinking = -np.array([0.0, 0.0, 5.0, 5.0 * lead])
    brakes = mod.rhs(0.0, sinking)[2] > 0.0  # the load alone cannot turn the screw
    assert brakes == (phi > lead_angle)


def test_bead_leaves_a_sphere() -> None:
    """A particle that slides down a sphere from rest leaves it where the cosine is 2/3."""
    m = eg.Model("bead", gravity=(0, -G, 0))
    bead = m.body("bead", mass=0.3)
    m.revolute("A", m.ground, bead.at(0, -1.2, 0), coordinate="phi")  # the bead above the centre
    m.event("off", "reaction(A, in=bead).y", direction=-1, terminal=True)
    m.initial(phi=1e-6)
    mod = m.compile(target="numpy")
    run = mod.simulate(20.0)
    assert np.cos(run.x_events["off"][0][0]) == pytest.approx(2 / 3, rel=1e-7)


def test_file_components_and_states(tmp_path: Path) -> None:
    """The same from a file, in an instance of a component, and in the rate of a state."""
    m = eg.Model("leg", gravity=(0, -G, 0))
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0), markers={"end": (0.4, 0, 0)})
    m.revolute("A", m.ground, rod)
    m.torque("rub", "A", "-0.01*reaction(A, in=rod.end).x*tanh(A_dot/0.01)")
    m.state("worn", "abs(A_dot)*reaction(A).normal")
    m.output("N", "reaction(A).normal")
    x = [0.7, 1.3, 0.0]
    again = read_back(m, tmp_path)
    mod, read = m.compile(target="numpy"), again.compile(target="numpy")
    found = mod.rhs(0.0, x)
    assert found[2] == pytest.approx(1.3 * np.linalg.norm(mod.reactions(0.0, x)[0, :2]), rel=1e-12)
    assert read.rhs(0.0, x) == pytest.approx(found, rel=1e-15)
    whole = eg.Model("whole", gravity=(0, -G, 0))
    whole.add(again, prefix="left_")
    whole.output("left", "reaction(left.A).normal")
    both = whole.compile(target="numpy")
    assert both.rhs(0.0, x) == pytest.approx(found, rel=1e-14)
    assert both.outputs(0.0, x)[-1] == pytest.approx(mod.outputs(0.0, x)[0], rel=1e-14)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("reaction(B).x", "EG-NAME-UNKNOWN outputs.N.expression B A"),
        ("reaction(A)", "EG-EXPRESSION outputs.N.expression reaction(joint).part"),
        ("reaction(A).q", "EG-EXPRESSION outputs.N.expression q part"),
        ("reaction(A, in=rod).size", "EG-EXPRESSION outputs.N.expression size"),
        ("multiplier(C)", "EG-NAME-UNKNOWN outputs.N.expression C"),
        ("multiplier(A)", "EG-NAME-UNKNOWN outputs.N.expression A"),
    ],
)
def test_what_is_wrong_is_reported(text: str, told: str) -> None:
    m = eg.Model("pin")
    rod = m.body("rod", mass=2.0, inertia={"zz": 0.3}, com=(0.4, 0, 0))
    m.revolute("A", m.ground, rod)
    m.output("N", text)
    refuses(told, m.compile, target="numpy")


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
    refuses("EG-NOT-FINITE Painleve", mod.rhs, 0.0, np.array([1.5, 0.0, 0.0, 0.0]))


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
    for part in ("x", "z", "my", "size"):
        m = door()
        m.output("o", f"reaction({joint}).{part}")
        refuses(f"EG-UNDETERMINED outputs.o {joint} {part}", m.derive)
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
    refuses("EG-UNDETERMINED h2", m.compile, target="numpy")


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


def sliders(order: tuple[int, ...], turned: bool = False) -> eg.Module:
    """Bodies in guides along x, pressed along y by sums of their reactions: N = 1 + K N, in any order of laws."""
    m = eg.Model("sliders", gravity=(0, -1, 0))
    n = len(order)
    for i in range(n):
        for j in range(n):
            m.parameter(f"k{i}{j}", 0.0)
    bodies = [m.body(f"b{i}", mass=1.0, inertia={"zz": 0.1}) for i in range(n)]
    for i, body in enumerate(bodies):
        m.prismatic(f"P{i}", m.ground, body, axis="x")
        m.output(f"N{i}", f"reaction(P{i}).y")
    for i in order:
        terms = [f"k{i}{j}*reaction(P{j}).y" for j in (order[::-1] if turned else order)]
        m.force(f"f{i}", bodies[i], (0, f"-({' + '.join(terms)})", 0))
    return m.compile(target="numpy")


def found(mod: eg.Module, K: np.ndarray) -> np.ndarray | None:
    """The reactions, None where they are refused."""
    try:
        return mod.outputs(0.0, np.zeros(mod.n_x), p=K.ravel())
    except eg.NonFiniteError as error:
        assert "f0" in str(error)
        assert "depend on reactions" in str(error)
        return None


def has_solution_on_the_way(K: np.ndarray) -> bool:
    values = np.linalg.eigvals(K)
    return not any(abs(z.imag) < 1e-12 and z.real >= 1.0 for z in values)


@pytest.mark.parametrize("n", [2, pytest.param(3, marks=pytest.mark.thorough)])
def test_linear_laws_beside_their_eigenvalues(n: int) -> None:
    orders = list(permutations(range(n)))
    modules = [sliders(order) for order in (orders if n == 2 else [orders[0], orders[3], orders[5]])]
    random, seen = np.random.default_rng(11), {True: 0, False: 0, "turning": 0}
    for _ in range(150):
        K = random.normal(size=(n, n)) * random.choice([0.5, 1.0, 3.0])
        answers = [found(mod, K) for mod in modules]
        accepted = answers[0] is not None
        assert all((a is not None) == accepted for a in answers)
        values = np.linalg.eigvals(K)
        seen[accepted] += 1
        if accepted:
            assert has_solution_on_the_way(K)
            N = np.linalg.solve(np.eye(n) - K, np.ones(n))
            for a in answers:
                assert a == pytest.approx(N, rel=1e-9, abs=1e-9 * np.abs(N).max())
        if np.abs(values).max() < 0.9:
            assert accepted
        if n == 2 and (np.abs(values.imag) > np.abs(values) / 8).all():
            assert accepted
            seen["turning"] += int(np.trace(K) > 2.0)
    assert min(seen[True], seen[False]) > 20
    assert n == 3 or seen["turning"]  # found by cutting the way


#: Law of N -> the same in Python.
LAWS = {
    "{c}*max(0, {N})": lambda N, c: c * np.maximum(0, N),
    "{c}*{N}*({N} > 0)": lambda N, c: c * N * (N > 0),
    "({N} > 0)*{c}*{N}**2/{N}": lambda N, c: c * N * (N > 0),
    "{c}*({N} if {N} > 0 else 0)": lambda N, c: c * N * (N > 0),
    "{c}*({N} + abs({N}))/2*(2 - exp(-{N}**2))/2": lambda N, c: c * np.maximum(0, N) * (2 - np.exp(-(N**2))) / 2,
    "{c}*max(0, {N})*1.0000001**{N}": lambda N, c: c * np.maximum(0, N) * 1.0000001**N,
    "{c}*max(0, min({N}, 3))*(1 if {N} < 3 else {N}/3)": lambda N, c: c * np.maximum(0, N),
    "{c}*sqrt(max(0, {N})**2)": lambda N, c: c * np.maximum(0, N),
}


@pytest.mark.parametrize("law", LAWS)
def test_pieces_count_however_they_are_written(law: str) -> None:
    """N = law - w: where a grid finds several solutions or none the call is refused, elsewhere it finds the one."""
    grid = np.linspace(-20.0, 20.0, 400_002)
    m = eg.Model("law", gravity=(0, "w", 0))
    m.parameter("c", 0.1)
    m.parameter("w", 1.0)
    m.prismatic("A", m.ground, m.body("b", mass=1.0, inertia={"zz": 0.1}), axis="x")
    m.force("f", "b", (0, f"-({law.format(N='reaction(A).y', c='c')})", 0))
    m.output("N", "reaction(A).y")
    mod, accepted = m.compile(target="numpy"), 0
    for c in (0.4, 0.9, 2.0):
        for w in (1.0, -0.7):
            gap = grid + w - LAWS[law](grid, c)
            roots = grid[np.flatnonzero(np.diff(np.sign(gap)))]
            try:
                N = mod.outputs(0.0, np.zeros(2), p={"c": c, "w": w})[0]
            except eg.NonFiniteError as error:
                assert "the forces of f depend on reactions" in str(error)
                assert c > 0.8
                continue
            accepted += 1
            assert len(roots) == 1
            assert pytest.approx(roots[0], abs=1e-3) == N
    assert accepted >= 2


def test_a_law_of_too_many_pieces_is_named() -> None:
    m = eg.Model("many", gravity=(0, 1, 0))
    m.prismatic("A", m.ground, m.body("b", mass=1.0, inertia={"zz": 0.1}), axis="x")
    product = "*".join(f"max({k}, reaction(A).y)" for k in range(1, 8))
    m.force("f", "b", (0, f"0.001*{product}", 0))
    refuses("EG-TOO-LARGE forces.f 64", m.compile, target="numpy")
