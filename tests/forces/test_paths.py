"""Paths over via points and around cylinders, with friction or not; judged by closed forms, SymPy and a search."""

from pathlib import Path
from typing import Any

import force_judges as bench
import judges
import numpy as np
import pytest
from force_judges import Seen, Wrench, problems
from judges import differences
from refusals import refuses
from scipy.optimize import minimize
from sweeps import TARGETS
from sympy.physics.mechanics import Point, ReferenceFrame
from sympy.physics.mechanics.wrapping_geometry import WrappingCylinder

import eomgen as eg


def test_a_spring_over_a_via_point_of_a_third_place(tmp_path: Path) -> None:
    """The middle point slides freely: it bears the sum of the pulls of both pieces."""
    at = np.array([0.3, 0.8, -0.2])

    def add(m: Any, p: Any, q: Any) -> None:
        m.spring("cord", p, q, stiffness="k", length=0.5, via=[m.ground.at(*at)])

    def loads(p: Seen, q: Seen, *_: Any) -> list[Wrench]:
        a, b = at - p.r, q.r - at
        la, lb = np.linalg.norm(a), np.linalg.norm(b)
        pull = 30.0 * (la + lb - 0.5)
        return [Wrench(0, p.r, pull * a / la), Wrench(1, q.r, -pull * b / lb)]

    bench.judge(add, loads, lambda *_: [], bench.states(11, 3), tmp_path)


def planar_length(a: np.ndarray, b: np.ndarray, r: float, sense: int) -> float:
    """A string around a circle by elementary geometry: two tangents and an arc, or straight."""
    ra, rb = np.hypot(*a), np.hypot(*b)
    between = (sense * (np.arctan2(b[1], b[0]) - np.arctan2(a[1], a[0]))) % (2 * np.pi)
    arc = between - np.arccos(r / ra) - np.arccos(r / rb)
    if arc <= 0:
        return float(np.hypot(*(b - a)))
    return float(np.sqrt(ra**2 - r**2) + r * arc + np.sqrt(rb**2 - r**2))


def spatial_length(a: np.ndarray, b: np.ndarray, r: float, sense: int) -> float:
    """The shortest path found by searching over where it touches first and last: straight, helix, straight."""
    start = np.arctan2(a[1], a[0])
    between = (sense * (np.arctan2(b[1], b[0]) - start)) % (2 * np.pi)
    from_a, from_b = np.arccos(r / np.hypot(*a[:2])), np.arccos(r / np.hypot(*b[:2]))

    def length(x: np.ndarray) -> float:
        angles = start + sense * np.array([x[0], x[0] + x[1]])
        p, q = (np.array([r * np.cos(w), r * np.sin(w), z]) for w, z in zip(angles, x[2:], strict=True))
        return float(np.linalg.norm(p - a) + np.hypot(r * x[1], q[2] - p[2]) + np.linalg.norm(b - q))

    # a search along the surface: the straight pieces may touch the cylinder but not enter it
    guess = np.array([from_a, between - from_a - from_b, a[2] + 0.3 * (b[2] - a[2]), a[2] + 0.6 * (b[2] - a[2])])
    bounds = [(None, from_a), (0.0, None), (None, None), (None, None)]
    keep = {"type": "ineq", "fun": lambda x: x[0] + x[1] - (between - from_b)}
    limit = {"type": "ineq", "fun": lambda x: from_a - x[0]}
    found = minimize(length, guess * 1.0, bounds=bounds, constraints=[keep, limit], tol=1e-14, options={"maxiter": 500})
    return float(found.fun)


def string(a: Any, b: Any, r: float, sense: str) -> Any:
    """A probe: a prismatic body carries the end of a string around a cylinder; its energy gives the length."""
    m = eg.Model("probe")
    body = m.body("b", mass=1)
    m.prismatic("s", m.ground, body, axis="x")
    via = [{"around": m.ground, "radius": r, "sense": sense}]
    m.element("probe", m.ground.at(*a), body.at(*b), potential="length", via=via)
    return m.compile(target="numpy")


@pytest.mark.parametrize("sense", ["positive", "negative"])
def test_lengths_against_geometry_and_a_search(sense: str) -> None:
    random = np.random.default_rng(12)
    wrapped = 0
    s = 1 if sense == "positive" else -1
    for _ in range(12):
        a, b = random.uniform(0.4, 1.2, (2, 1)) * np.array([np.cos(w := random.uniform(0, 6.3, 2)), np.sin(w)]).T
        r = random.uniform(0.1, 0.38)
        flat = string((*a, 0), (*b, 0), r, sense).energy(np.zeros(2))[1]
        assert flat == pytest.approx(planar_length(a, b, r, s), rel=1e-13)
        rise = np.hypot(flat, 0.7)
        up_a, up_b = np.array([*a, 0.1]), np.array([*b, 0.8])
        length = string(up_a, up_b, r, sense).energy(np.zeros(2))[1]
        assert length == pytest.approx(rise, rel=1e-13)
        if flat > np.hypot(*(b - a)) + 1e-9:
            wrapped += 1
            assert length == pytest.approx(spatial_length(up_a, up_b, r, s), rel=1e-7)
    assert wrapped >= 4


def test_a_geodesic_of_sympy() -> None:
    """Both ends on the cylinder: SymPy's own WrappingCylinder."""
    N, O = ReferenceFrame("N"), Point("O")
    cylinder = WrappingCylinder(0.2, O, N.z)
    ends = []
    for angle, z in ((0.3, -0.1), (2.2, 0.5)):
        point = Point(f"p{z}")
        point.set_pos(O, 0.2 * np.cos(angle) * N.x + 0.2 * np.sin(angle) * N.y + z * N.z)
        ends.append((point, [0.2 * np.cos(angle), 0.2 * np.sin(angle), z]))
    theirs = float(cylinder.geodesic_length(ends[0][0], ends[1][0]))
    lift = 1 + 1e-14  # rounding must not put the ends inside
    a, b = (np.array(x) * [lift, lift, 1] for _, x in ends)
    assert string(a, b, 0.2, "positive").energy(np.zeros(2))[1] == pytest.approx(theirs, rel=1e-7)
    assert theirs == pytest.approx(np.hypot(0.2 * 1.9, 0.6), rel=1e-12)


@pytest.mark.parametrize("sense", ["positive", "negative"])
def test_loads_of_a_wrapped_path_by_virtual_work(sense: str, tmp_path: Path) -> None:
    """Cylinder on one body, ends on the other and on ground: loads against differences of the length.

    The judge of the loads is the energy: Lagrange's equations differentiate it, the embedding uses the loads.
    """
    wrapped = 0

    def add(m: Any, p: Any, q: Any) -> None:
        drum = {"around": p, "radius": 0.12, "sense": sense}
        m.spring("cord", m.ground.at(-0.6, -0.5, 0.3), q, stiffness="k", length=0.2, via=[drum])
        m.damper("oil", m.ground.at(-0.6, -0.5, 0.3), q, damping="c", via=[drum])

    model = bench.flyers(add)
    embedded, lagrange = (model.compile(method=x, target="numpy") for x in ("embedding", "lagrange"))
    bare = bench.flyers().compile(target="numpy")
    for x in bench.states(13, 12, reach=0.9):
        q, n = x[:12], 12

        def length(columns: np.ndarray) -> np.ndarray:
            return 0.2 + np.sqrt(2 * (embedded.energy(np.vstack([columns, 0 * columns]))[1]) / 30.0)[None]

        slope = np.array([judges.first(length, q, e, h=1e-3)[0] for e in np.eye(n)])
        expected = -(30.0 * (length(q[:, None])[0, 0] - 0.2) + 1.5 * slope @ x[n:]) * slope
        bodies = judges.Bodies(bare, q, x[n:])
        p, end = bench.see(bodies, 0, bench.P), bench.see(bodies, 1, bench.Q)
        a, b = (p.R.T @ (y - p.r) for y in (np.array([-0.6, -0.5, 0.3]), end.r))
        s = 1 if sense == "positive" else -1
        flat = planar_length(a[:2], b[:2], 0.12, s)
        assert length(q[:, None])[0, 0] == pytest.approx(np.hypot(flat, b[2] - a[2]), rel=1e-10)
        wrapped += flat > np.hypot(*(b - a)[:2]) + 1e-9
        for mod in (embedded, lagrange):
            found = bare.bias(0.0, x) - mod.bias(0.0, x)
            assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()
            slopes = judges.fine_differences(mod, x, 1e-5)
            assert np.abs(mod.jacobian(0.0, x) - slopes).max() <= 1e-6 * np.abs(slopes).max()
    assert 2 <= wrapped <= 11


def test_the_length_has_no_kink_where_the_string_lifts_off() -> None:
    """Sliding the end past the tangent: the slope is the same on both sides."""
    r = 0.3
    # the end moves along y = const: at x = 1, y = r the string is straight and just touches
    m = eg.Model("lift")
    body = m.body("b", mass=1)
    m.prismatic("s", m.ground.at(1, r, 0), body, axis="y")
    m.element("probe", m.ground.at(-1, r, 0), body, law=1, via=[{"around": m.ground, "radius": r, "sense": "negative"}])
    mod = m.compile(target="numpy")
    force = [float(mod.rhs(0.0, np.array([s, 0.0]))[1]) for s in (-1e-6, 0.0, 1e-6)]
    assert np.ptp(force) < 2e-6
    assert abs(force[1]) < 1e-12


def test_an_end_inside_the_cylinder_is_an_error_that_names_the_element() -> None:
    m = eg.Model("inside")
    body = m.body("b", mass=1)
    m.prismatic("s", m.ground, body, axis="x")
    m.spring("cord", m.ground.at(-1, 0, 0), body, stiffness=1, via=[{"around": m.ground, "radius": 0.3}])
    mod = m.compile(target="numpy")
    assert np.isfinite(mod.rhs(0.0, np.array([0.4, 0.0]))).all()
    refuses("EG-NOT-FINITE cord", mod.rhs, 0.0, np.array([0.2, 0.0]))


def test_faults_of_paths_are_reported_by_place() -> None:
    m = eg.Model("faults")
    b = m.body("b", mass=1)
    m.prismatic("s", m.ground, b)
    drum = {"around": m.ground, "radius": 0.1}
    m.spring("k1", m.ground, b, stiffness=1, via=[drum, drum])
    m.spring("k2", m.ground, b, stiffness=1, via=[{"around": m.ground, "radius": -0.1, "sense": "up"}, "nobody"])
    m.spring("k3", m.ground, b, stiffness=1, via=[{"around": m.ground}])
    m.actuator("a1", "s", 1, via=[b])
    m.element("e1", m.ground, b)
    m.element("e2", m.ground, b, law="k*angle")
    m.parameter("rate", 1)
    m.element("e3", m.ground, b, law="rate")
    told = problems(m)
    assert "follows another cylinder" in told["forces.k1.via[1]"]
    assert told["forces.k2.via[0].radius"].startswith("is -0.1")
    assert "allowed: positive, negative" in told["forces.k2.via[0].sense"]
    assert "no body 'nobody'" in told["forces.k2.via[1]"]
    assert told["forces.k3.via[0].radius"].startswith("is missing")
    assert "a joint's coordinate has no path" in told["forces.a1.via"]
    assert "unknown name 'angle'" in told["forces.e2.law"]
    assert "'rate' is a variable of the element and also the parameter at parameters.rate" in told["forces.e3.law"]


MU, R = 0.25, 0.1


def band(sense: str = "positive", target: str = "numpy", **keys: Any) -> Any:
    """A drum with a band of half a turn about it, whose ends are held by sledges that move along y."""
    m = eg.Model("band", gravity=(0, 0, 0))
    drum = m.body("drum", mass=1, inertia={"zz": 0.01})
    m.revolute("turn", m.ground, drum)
    x = R if sense == "positive" else -R
    for name, at in (("a", x), ("b", -x)):
        m.body(name, mass=2.0)
        m.prismatic(name, m.ground.at(at, -1, 0), name, axis="y")
    rope = {"around": drum, "radius": R, "sense": sense, "friction": MU, "smoothing": 0.001, **keys}
    rope = {key: value for key, value in rope.items() if value is not None}
    m.actuator("rope", "a", "b", value=-50.0, via=[rope])
    return m.compile(target=target)


@pytest.mark.parametrize("sense", ["positive", "negative"])
@pytest.mark.parametrize("target", TARGETS)
def test_a_band_brake(target: str, sense: str) -> None:
    """T_a / T_b = exp(mu pi) where the drum turns one way, exp(-mu pi) the other; the drum feels the difference."""
    mod = band(sense, target)
    for spin in (3.0, -3.0):
        x = np.array([0.0, 0.0, 0.0, spin, 0.0, 0.0])
        drum, a, b = mod.rhs(0.0, x)[3:]
        assert 2 * a == pytest.approx(50.0, rel=1e-12)  # the pull at the first end is the given one
        along = spin if sense == "positive" else -spin  # the surface runs from a to b, and so drags the rope to b
        assert 2 * b == pytest.approx(50.0 * np.exp(-MU * np.pi * np.sign(along)), rel=1e-9)
        brake = R * abs(2 * a - 2 * b)
        assert 0.01 * drum == pytest.approx(-np.sign(spin) * brake, rel=1e-9)
    rest = mod.rhs(0.0, np.zeros(6))
    np.testing.assert_allclose(rest[3:], [0, 25, 25], atol=1e-12)


def test_the_smoothed_ratio() -> None:
    """exp(mu pi tanh(v / smoothing)) of the slip v, and 1 where the rope runs with the drum."""
    mod = band()
    for c in (-2e-3, -3e-4, 4e-4, 1.5e-3):  # a goes down, b up
        for spin in (0.0, 0.004):
            x = np.array([0.0, 0.0, 0.0, spin, -c, c])
            _, a, b = mod.rhs(0.0, x)[3:]
            slip = c + spin * R  # toward a
            assert np.log(a / b) == pytest.approx(MU * np.pi * np.tanh(slip / 0.001), rel=1e-9)


def test_slopes_and_a_helix() -> None:
    """A rope that climbs turns less: mu w cos(pitch); the Jacobian is that of rhs."""
    m = eg.Model("helix", gravity=(0, 0, 0))
    m.parameter("mu", 0.2)
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1))
    m.translational("j", m.ground.at(-R, -1, 0.7), b)
    drum = {"around": m.ground, "radius": R, "friction": "mu", "smoothing": 0.01}
    m.actuator("rope", m.ground.at(R, -1, 0), b, value=-10.0, via=[drum])
    mod = m.compile(target="numpy")
    pitch = np.arctan2(0.7, 2.0 + np.pi * R)
    x = np.array([0, 0, 0, 0, -1.0, 0.0])
    pull = np.linalg.norm(mod.rhs(0.0, x)[3:])
    slip = 0.5 * np.cos(pitch)  # half of the rate of the end, as the other end stands still
    wanted = 10 * np.exp(0.2 * np.pi * np.cos(pitch) * np.tanh(slip / 0.01))
    assert pull == pytest.approx(wanted, rel=1e-9)
    x = np.array([0.01, 0.02, -0.03, 4e-3, -6e-3, 3e-3])
    found = mod.jacobian(0.0, x)
    np.testing.assert_allclose(found, differences(mod, x), rtol=1e-5, atol=1e-6 * np.abs(found).max())


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"friction": -0.1}, "EG-RANGE forces.rope.via[0].friction -0.1"),
        ({"smoothing": 0}, "EG-RANGE forces.rope.via[0].smoothing"),
        ({"frction": 1}, "EG-NAME-UNKNOWN forces.rope.via[0].frction"),
        ({"smoothing": None}, "EG-MISSING forces.rope.via[0].smoothing"),
    ],
)
def test_what_is_wrong_with_a_rubbing_cylinder_is_reported(keys: dict[str, Any], told: str) -> None:
    refuses(told, band, **keys)
