"""A guess beside a closed-form position selects its branch, however the mechanism is turned; the report says which."""

from __future__ import annotations

from math import acos, asin, atan2, cos, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg

THIN = (1e-3, 1e-3, 1e-3)
#: Of three times as many random mechanisms the first always run.
SEEDS = pytest.mark.parametrize("seed", part_of(range(3), lambda seed: seed == 0))


def closes(model: eg.Model) -> dict[str, float]:
    return model.check().reference


def gap(a: float, b: float) -> float:
    """The angle between two directions."""
    return abs((a - b + pi) % (2.0 * pi) - pi)


def slider_crank(turn: float, r: float, rod: float, off: float = 0.0) -> eg.Model:
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
        m = slider_crank(turn, 0.04, 0.13)
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
        m = slider_crank(turn, r, rod, off)
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


@SEEDS
def test_v_twins_at_random(seed: int) -> None:
    random = np.random.default_rng([2, seed])
    for _ in range(17):
        turn, theta = random.uniform(-pi, pi, 2)
        r, rod = 0.04, random.uniform(0.09, 0.16)
        m = eg.Model("v_twin")
        crank = m.body("crank", mass=1, inertia=THIN)
        m.revolute("A", m.ground, crank, coordinate="theta")
        wanted = []
        for k, axis in enumerate((turn - pi / 4, turn + pi / 4)):
            bar, piston = m.body(f"rod{k}", mass=1, inertia=THIN), m.body(f"piston{k}", mass=1, inertia=THIN)
            m.revolute(f"B{k}", crank.at(r, 0, 0), bar)
            m.revolute(f"C{k}", bar.at(rod, 0, 0), piston)
            m.prismatic(f"D{k}", m.ground, piston, axis=(cos(axis), sin(axis), 0), coordinate=f"s{k}")
            wanted.append(places(axis, r, rod, 0.0, theta)[random.integers(2)])
        m.initial(theta=theta)
        m.guess = {f"s{k}": s + 0.04 * rod * random.uniform(-1, 1) for k, s in enumerate(wanted)}
        found = closes(m)
        assert [found["s0"], found["s1"]] == pytest.approx(wanted, abs=1e-10)


def leg(lift: float, foot: np.ndarray, turn: Rotation) -> eg.Model:
    """A leg of a Stewart platform: a universal joint below, a slide, a ball at a plate that is lifted along z."""
    m = eg.Model("leg")
    rpy = tuple(turn.as_euler("xyz"))
    tube, ram, plate = (m.body(name, mass=1, inertia=THIN) for name in ("tube", "ram", "plate"))
    base = m.ground.at(0, 0, 0, rpy=rpy)
    m.prismatic("lift", base, plate, axis="z", coordinate="h")
    m.universal("foot", m.ground.at(*turn.apply(foot), rpy=rpy), tube)
    m.prismatic("leg", tube, ram, axis="z", coordinate="length")
    m.spherical("hip", ram, plate)
    m.initial(h=lift)
    return m


@SEEDS
def test_legs_of_a_stewart_platform_at_random(seed: int) -> None:
    """Tube's axis after R_x(a) R_y(b): (sin b, -sin a cos b, cos a cos b); the leg may point up, or down with l < 0."""
    random = np.random.default_rng([3, seed])
    for _ in range(10):
        foot, lift = np.append(random.uniform(-0.3, 0.3, 2), 0.0), random.uniform(0.4, 0.9)
        way = np.array([0.0, 0.0, lift]) - foot
        length = float(np.linalg.norm(way)) * random.choice([-1, 1])
        axis = way / length
        b = asin(axis[0])
        a = atan2(-axis[1], axis[2])
        m = leg(lift, foot, Rotation.random(random_state=int(random.integers(1000))))
        m.guess(length=length * (1 + random.uniform(-0.04, 0.04)), foot_1=a + random.uniform(-0.1, 0.1))
        found = closes(m)
        assert found["length"] == pytest.approx(length, abs=1e-9)
        assert [gap(found["foot_1"], a), gap(found["foot_2"], b)] == pytest.approx([0, 0], abs=1e-8)


def test_what_a_guess_leaves_open_is_told_and_can_be_chosen() -> None:
    """The second piston of a V-twin knows nothing of a guess of the first one."""

    def engine(**guess: float) -> eg.Model:
        m = slider_crank(pi / 4, 0.04, 0.16)
        bar, piston = m.body("rod2", mass=1, inertia=THIN), m.body("piston2", mass=1, inertia=THIN)
        m.revolute("B2", m.bodies["crank"].at(0.04, 0, 0), bar)
        m.revolute("C2", bar.at(0.16, 0, 0), piston)
        m.prismatic("D2", m.ground, piston, axis=(-1, 1, 0), coordinate="z")
        m.initial(phi=1.0)
        m.guess = guess
        return m

    first, _ = places(pi / 4, 0.04, 0.16, 0.0, 1.0)
    both = places(3 * pi / 4, 0.04, 0.16, 0.0, 1.0)
    report = engine(s=0.19).check()
    assert report.reference["s"] == pytest.approx(first, abs=1e-10)
    here = report.reference["z"]
    (other,) = report.other_branches
    assert sorted([here, other["z"]]) == pytest.approx(sorted(both), abs=1e-10)
    assert "as near is a branch with z = " in str(report)
    chosen = engine(s=0.19, z=other["z"] + 0.004).check()
    assert chosen.reference["z"] == pytest.approx(other["z"], abs=1e-10)
    assert not chosen.other_branches


def test_a_guess_beside_no_position_is_told_with_its_distance() -> None:
    m = slider_crank(0.5, 0.04, 0.13)
    m.initial(phi=1.0)
    m.guess(s=0.4)
    report = m.check()
    wanted = places(0.5, 0.04, 0.13, 0.0, 1.0)[0]
    assert report.reference["s"] == pytest.approx(wanted, abs=1e-10)
    assert report.guess_distance == pytest.approx((0.4 - wanted) / report.length_scale)
    told = f"nearest to the guess, which is rough, off by {report.guess_distance:.2g}: s = {wanted:.6g}, guessed 0.4"
    assert told in " ".join(str(report).split())


def test_assemble_takes_the_nearest_branch_too() -> None:
    mod = slider_crank(radians(120), 0.04, 0.13).compile(target="numpy")
    random = np.random.default_rng(4)
    for _ in range(16):
        phi = random.uniform(-pi, pi)
        wanted = places(radians(120), 0.04, 0.13, 0.0, phi)[random.integers(2)]
        q = mod.assemble(phi=phi, s=wanted + 0.004 * random.uniform(-1, 1))
        assert dict(zip(mod.q_names, q, strict=True))["s"] == pytest.approx(wanted, abs=1e-9)
