"""Four-bars without mass, the branch nearest to a guess, and angles that wind up, against closed forms."""

from math import acos, atan2, cos, hypot, pi, radians, sin, sqrt

import models
import numpy as np
import pytest
from refusals import refuses
from sweeps import TARGETS, part_of

import eomgen as eg

# -- Without mass ------------------------------------------------------------------------------------------------------
LED = {"theta": np.linspace(1.0, 1.0 + 2 * np.pi, 25), "theta_dot": 10.0, "theta_ddot": 3.0}


def light_four_bar(mass: float, second: str = "ax") -> eg.Model:
    m = eg.Model("light_four_bar")
    inertia = {"inertia": {"zz": mass}} if mass else {}
    a, b, c = (m.body(name, mass=mass, **inertia) for name in ("crank", "coupler", "rocker"))
    models.join_four_bar(m, (a, b, c), (0.04, 0.12, 0.08, 0.1), "theta bend psi")
    m.output("px", b.at(0.05, 0, 0).position[0])
    point = b.at(0.05, 0, 0)
    m.output(second, point.acceleration[0] if second == "ax" else point.velocity[0])
    m.guess(theta=1.0, bend=-0.7, psi=1.1)
    m.initial(theta=1.0)
    return m


def freudenstein(theta: np.ndarray) -> np.ndarray:
    """The rocker's angle of a four-bar (Freudenstein, Trans. ASME 76, 1954) with the tangent of half the angle."""
    a, b, c, d = 0.04, 0.12, 0.08, 0.1
    A, B = a * np.sin(theta), a * np.cos(theta) - d
    C = (c**2 - b**2 + A**2 + B**2) / (2 * c)  # B cos(psi) + A sin(psi) = C, by the coupler's length
    return 2 * np.arctan2(A - np.sqrt(A**2 + B**2 - C**2), B + C)


@pytest.mark.parametrize("target", TARGETS)
def test_a_mechanism_without_mass_is_driven(target: str) -> None:
    mod = light_four_bar(0).compile(target=target)
    motion = mod.kinematic_analysis(**LED)
    psi = freudenstein(LED["theta"])
    np.testing.assert_allclose(np.cos(motion["psi"]), np.cos(psi), atol=1e-9)
    np.testing.assert_allclose(np.sin(motion["psi"]), np.sin(psi), atol=1e-9)
    heavy = light_four_bar(1).compile(target="numpy").kinematic_analysis(**LED)
    for name in ("psi", "psi_dot", "psi_ddot", "px", "ax"):
        np.testing.assert_allclose(motion[name], heavy[name], rtol=1e-9, atol=1e-9)
    assert mod.motion_range("theta").unlimited
    assert mod.assemble(theta=1.2)[0] == 1.2
    assert mod.kinematics([1.2], [1.0])[1][0] == 1.0
    x = mod.x0()
    for call in (lambda: mod.rhs(0.0, x), lambda: mod.jacobian(0.0, x), lambda: mod.simulate(0.1), mod.linearize):
        refuses("EG-SINGULAR crank coupler rocker", call)


@pytest.mark.parametrize("method", ["recursive", "newton_euler"])
def test_by_every_method(method: str) -> None:
    motion = light_four_bar(0).compile(method=method, target="numpy").kinematic_analysis(**LED)
    np.testing.assert_allclose(np.cos(motion["psi"]), np.cos(freudenstein(LED["theta"])), atol=1e-9)


def test_a_forgotten_mass_is_still_reported() -> None:
    """Where something else has mass, or a force acts, a motion without inertia is a slip of the pen."""
    m = light_four_bar(0)
    m.torque("motor", "A", 1.0)
    refuses("EG-NO-INERTIA joints.B check_inertia", m.check)
    m.check_inertia = "note"
    m.check()
    m.compile(target="numpy").kinematic_analysis(**LED)
    two = eg.Model("two")
    two.revolute("A", two.ground, two.body("a", mass=1, inertia={"zz": 1}))
    two.revolute("B", two.ground, two.body("b", mass=0))
    refuses("EG-NO-INERTIA joints.B", two.compile, target="numpy")


# -- The nearest branch ------------------------------------------------------------------------------------------------
THIN = (1e-3, 1e-3, 1e-3)
#: Of three times as many random mechanisms the first always run.
SEEDS = pytest.mark.parametrize("seed", part_of(range(3), lambda seed: seed == 0))


def closes(model: eg.Model) -> dict[str, float]:
    return model.check().reference


def gap(a: float, b: float) -> float:
    """The angle between two directions."""
    return abs((a - b + pi) % (2.0 * pi) - pi)


def slide_at_an_angle(turn: float, r: float, rod: float, off: float = 0.0) -> eg.Model:
    """A slide at an angle, its line beside the crank's bearing by ``off``."""
    m = eg.Model("slider_crank")
    crank, bar, slide = (m.body(name, mass=1, inertia=THIN) for name in ("crank", "rod", "slide"))
    m.revolute("A", m.ground, crank, coordinate="phi")
    m.revolute("B", crank.at(r, 0, 0), bar)
    m.revolute("C", bar.at(rod, 0, 0), slide)
    m.prismatic(
        "D", m.ground.at(-off * sin(turn), off * cos(turn), 0), slide, axis=(cos(turn), sin(turn), 0), coordinate="s"
    )
    return m


def places(turn: float, r: float, rod: float, off: float, phi: float) -> tuple[float, float]:
    """s = r cos(phi - turn) +- sqrt(l^2 - (r sin(phi - turn) - e)^2)."""
    along, across = r * cos(phi - turn), r * sin(phi - turn) - off
    root = sqrt(rod * rod - across * across)
    return along + root, along - root


def test_a_slide_at_120_degrees_takes_the_guessed_side() -> None:
    turn, phi = radians(120), radians(10)
    for wanted in places(turn, 0.04, 0.13, 0.0, phi):
        m = slide_at_an_angle(turn, 0.04, 0.13)
        m.initial(phi=phi)
        m.guess(s=wanted + 3e-5)
        report = m.check()
        assert report.reference["s"] == pytest.approx(wanted, abs=1e-12)
        assert report.guessed["s"] == pytest.approx([wanted + 3e-5, wanted], abs=1e-12)
        assert "on the branch nearest to the guess (s = " in str(report)
        assert report.other_branches == []  # the other one is not as near


@SEEDS
def test_slider_cranks_at_random(seed: int) -> None:
    random = np.random.default_rng([0, seed])
    for _ in range(20):
        turn, phi = random.uniform(-pi, pi, 2)
        r = random.uniform(0.02, 0.1)
        rod, off = r * random.uniform(1.5, 4.0), r * random.uniform(-0.3, 0.3)
        wanted = places(turn, r, rod, off, phi)[random.integers(2)]
        m = slide_at_an_angle(turn, r, rod, off)
        m.initial(phi=phi)
        m.guess(s=wanted + 0.04 * rod * random.uniform(-1, 1))
        assert closes(m)["s"] == pytest.approx(wanted, abs=1e-10)


@SEEDS
def test_four_bars_at_random(seed: int) -> None:
    random = np.random.default_rng([1, seed])
    for _ in range(20):
        turn, theta = random.uniform(-pi, pi, 2)
        a, b, c, d = 0.05, random.uniform(0.11, 0.16), random.uniform(0.09, 0.13), random.uniform(0.10, 0.13)
        m = eg.Model("four_bar")
        crank, coupler, rocker = (m.body(name, mass=1, inertia=THIN) for name in ("crank", "coupler", "rocker"))
        m.revolute("A", m.ground, crank, coordinate="theta")
        m.revolute("B", crank.at(a, 0, 0), coupler)
        m.revolute("C", coupler.at(b, 0, 0), rocker.at(c, 0, 0))
        m.revolute("D", m.ground.at(d * cos(turn), d * sin(turn), 0), rocker, coordinate="psi")
        # from the rocker's bearing to the crank's pin, and the angle at the bearing in the triangle with sides b, c
        x, y = a * cos(turn + theta) - d * cos(turn), a * sin(turn + theta) - d * sin(turn)
        f = hypot(x, y)
        inner = acos((f * f + c * c - b * b) / (2.0 * f * c))
        if min(inner, pi - inner) < 0.25:
            continue  # both branches are near there
        psi = atan2(y, x) + inner * random.choice([-1, 1])
        m.initial(theta=turn + theta)
        m.guess(psi=psi + random.uniform(-0.1, 0.1))
        assert gap(closes(m)["psi"], psi) < 1e-9


def test_assemble_takes_the_nearest_branch_too() -> None:
    mod = slide_at_an_angle(radians(120), 0.04, 0.13).compile(target="numpy")
    random = np.random.default_rng(4)
    for _ in range(16):
        phi = random.uniform(-pi, pi)
        wanted = places(radians(120), 0.04, 0.13, 0.0, phi)[random.integers(2)]
        q = mod.assemble(phi=phi, s=wanted + 0.004 * random.uniform(-1, 1))
        assert dict(zip(mod.q_names, q, strict=True))["s"] == pytest.approx(wanted, abs=1e-9)


# -- Angles that wind up -----------------------------------------------------------------------------------------------
def crank_rocker(named: str, element: str = "joint") -> eg.Model:
    """A four-bar whose crank carries a torsional spring; ``named`` decides which joints stay in the tree."""
    m = eg.Model("bars", gravity=(0, 0, 0))
    lengths = {"crank": 0.04, "coupler": 0.12, "rocker": 0.08}
    bars = [m.body(n, mass=1, com=(x / 2, 0, 0), inertia={"zz": 1e-3}) for n, x in lengths.items()]
    c = {j: f"q_{j}" if j in named else None for j in "ABCD"}
    m.revolute("A", m.ground, bars[0], coordinate=c["A"])
    m.revolute("B", bars[0].at(0.04, 0, 0), bars[1], coordinate=c["B"])
    m.revolute("C", bars[1].at(0.12, 0, 0), bars[2].at(0.08, 0, 0), coordinate=c["C"])
    m.revolute("D", m.ground.at(0.10, 0, 0), bars[2], coordinate=c["D"])
    if element == "joint":
        m.torsional_spring("s", joint="A", stiffness=0.02)
    else:
        m.torsional_spring("s", m.ground, bars[0], stiffness=0.02)
    m.output("crank_angle", m.coordinate(c["A"] or "A"))
    return m


@pytest.mark.parametrize(
    ("named", "element"), [("ABD", "joint"), ("BCD", "joint"), ("ABD", "markers"), ("BCD", "markers")]
)
def test_torsional_spring_winds_up_whichever_joint_is_cut(named: str, element: str) -> None:
    """The crank starts fast enough for more than one turn; energy is kept only if the angle does not wrap."""
    m = crank_rocker(named, element)
    crank = "q_A" if "A" in named else "A"
    equations = m.derive()
    assert equations.report.loop_joints == ["C" if "A" in named else "A"]
    module = equations.compile(target="numpy")
    rates = {f"{crank}_dot": 25.0}
    trajectory = module.simulate((0, 1), initial={crank: 0.9} | rates, rtol=1e-9, atol=1e-11)
    angle = trajectory[crank]
    assert np.ptp(angle) > 7.0
    assert np.abs(trajectory["crank_angle"] - angle).max() < 1e-9
    assert np.abs(np.diff(angle)).max() < 1.5
    assert trajectory.energy_drift < 1e-6
    assert np.abs(trajectory["V"] - 0.01 * angle**2).max() < 1e-9


def test_spring_on_an_angle_that_wraps_is_refused() -> None:
    m = eg.Model("rssr", gravity=(0, 0, -9.81))
    crank = m.body("crank", mass=1, inertia=(1, 1, 1))
    rod = m.body("rod", mass=1, inertia=(1, 1, 1))
    rocker = m.body("rocker", mass=1, inertia=(1, 1, 1))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.spherical("B", crank.at(0.3, 0, 0), rod)
    m.spherical("C", rod.at(1, 0, 0), rocker.at(0, 0.5, 0))
    m.revolute("D", m.ground.at(0.8, 0.2, 0.1), rocker, axis="x", coordinate="phi")
    m.torsional_spring("s", joint="C_1", stiffness=1.0)
    refuses("EG-UNDEFINED forces.s C_1", m.derive)


def test_torsional_spring_between_markers_of_a_tree_has_a_potential_and_winds_up() -> None:
    m = eg.Model("shaft")
    disc = m.body("disc", mass=1, inertia=(1, 1, 0.5))
    m.revolute("A", m.ground, disc, coordinate="q")
    m.torsional_spring("k", m.ground.at(0, 0, 0, rpy=(0, 0, 0.3)), disc, stiffness=2.0, angle=0.1)
    for method in ("embedding", "lagrange"):
        module = m.derive(method).compile(target="numpy")
        for q in (3.1, 3.2, 9.0):
            assert module.rhs(0.0, [q, 0.0])[1] == pytest.approx(-2.0 * (q - 0.3 - 0.1) / 0.5, rel=1e-12)
            assert module.energy([q, 0.0])[1] == pytest.approx((q - 0.4) ** 2, rel=1e-12)
