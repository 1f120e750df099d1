"""One equilibrium and one verdict, however the mechanism is described."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sweeps import part_of

import eomgen as eg

LENGTHS, ANGLES = (0.7, 0.5, 0.6, 0.4, 0.5), (1.1, 0.3, -0.4, -0.9, -1.2)


def loop(
    unit: float = 1.0, turn: float = 0.0, order: int = 1, cut: int = 4, method: str = "auto", target: str = "numpy"
) -> Any:
    """Five links between two walls with soft and stiff springs.

    unit: of lengths, per metre; turn: of the links' frames; order: of bodies and forces; cut: hinge declared last.
    """
    m = eg.Model("loop", gravity=(0, -9.81 * unit, 0))
    c, s = np.cos(turn), np.sin(turn)

    def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
        return (unit * (c * x + s * y), unit * (c * y - s * x), 0.0)

    turned = {"rpy": (0, 0, -turn)}
    names = [f"l{k}" for k in range(5)][::order]
    links = {}
    for name in names:
        length = LENGTHS[int(name[1])]
        links[name] = m.body(name, mass=1 + length, com=at(length / 2, 0.02), inertia={"zz": 0.05 * unit**2})
    end = [sum(l * f(a) for l, a in zip(LENGTHS, ANGLES, strict=True)) for f in (np.cos, np.sin)]
    places = [m.ground]
    for k in range(5):
        places.append(links[f"l{k}"].at(*at(LENGTHS[k]), **turned))
    for k in [*(k for k in range(5) if k != cut), cut]:
        successor = links[f"l{k}"].at(*at(0), **turned)
        m.revolute(f"R{k}", places[k], successor, coordinate=f"q{k}")
    m.revolute("end", places[5], m.ground.at(unit * end[0], unit * end[1], 0), coordinate="q5")
    forces = [("t1", 1, 3e6), ("t3", 3, 40.0), ("t2", 2, 2.0)][::order]
    for name, k, stiffness in forces:
        m.torsional_spring(name, joint=f"R{k}", stiffness=stiffness * unit**2, angle=ANGLES[k] - ANGLES[k - 1])
    m.spring("pull", m.ground.at(0.2 * unit, -0.8 * unit, 0), links["l2"].at(*at(0.3)), stiffness=90, length=0.4 * unit)
    m.guess(q0=ANGLES[0], **{f"q{k}": ANGLES[k] - ANGLES[k - 1] for k in range(1, 5)})
    return m.compile(method=method, target=target)


DESCRIPTIONS: dict[str, dict[str, Any]] = {
    "millimetres": {"unit": 1000.0},
    "kilometres": {"unit": 1e-3},
    "frames turned": {"turn": 0.7},
    "order": {"order": -1},
    "another cut": {"cut": 2},
    "lagrange": {"method": "lagrange"},
    "augmented": {"method": "augmented"},
    "recursive": {"method": "recursive"},
    "cython": {"target": "cython"},
    "frames turned, another order and cut": {"turn": 0.7, "order": -1, "cut": 2},
    "kilometres by lagrange": {"unit": 1e-3, "method": "lagrange"},
}
#: What a case with two or three changes has too; one by one by ``make thorough``.
JOINED = ("kilometres", "frames turned", "order", "another cut", "lagrange")


def angles(found: Any) -> list[float]:
    return [found[f"q{k}"] for k in range(5)]


GUESS = {f"q{k}": ANGLES[k] - (ANGLES[k - 1] if k else 0.0) + 0.05 * (k == 0) for k in range(5)}


@pytest.fixture(scope="module")
def plain() -> Any:
    return loop().equilibrium(GUESS)


@pytest.mark.parametrize("described", part_of(DESCRIPTIONS, lambda name: name not in JOINED))
def test_a_loop_with_soft_and_stiff_springs(described: str, plain: Any) -> None:
    mod, first = loop(**DESCRIPTIONS[described]), plain
    other = mod.equilibrium(GUESS)
    np.testing.assert_allclose(angles(other), angles(first), atol=1e-10)
    assert other.stability == first.stability == "stable (undamped)"
    np.testing.assert_allclose(np.abs(other.eigenvalues), np.abs(first.eigenvalues), rtol=1e-7)
    assert mod.linearize(other.x).is_equilibrium


def hanging(turn: Rotation, rotation: str = "euler_parameters", unit: float = 1.0) -> Any:
    """A body with a rotor on a ball joint, held by a soft spring and a stiff one, its frames turned."""

    def at(*place: float) -> tuple[float, ...]:
        return tuple(unit * turn.inv().apply(place))

    m = eg.Model("hanging", gravity=(0, -9.81 * unit, 0))
    inertia = unit**2 * turn.as_matrix().T @ np.diag([0.012, 0.02, 0.03]) @ turn.as_matrix()
    body = m.body("body", mass=3.8, com=at(0.125, 0.02, 0), inertia=inertia)
    back = tuple(turn.inv().as_euler("xyz"))
    m.spherical("S", m.ground, body.at(0, 0, 0, rpy=back), rotation=rotation)
    quarter = turn.inv() * Rotation.from_euler("xyz", [0, np.pi / 4, 0])
    rotor = m.body("rotor", mass=12.1, inertia=[unit**2 * x for x in (0.015, 0.048, 0.048)])
    m.revolute("R", body.at(*at(0.25, 0, 0), rpy=tuple(quarter.as_euler("xyz"))), rotor, axis="x")
    m.spring("soft", m.ground.at(0.3 * unit, 0, 0), body.at(*at(0.1, 0.1, 0)), stiffness=3.0, length=0.2 * unit)
    m.spring("stiff", m.ground.at(0, -unit, 0), body.at(*at(0.2, 0, 0.1)), stiffness=1e6, length=0.78 * unit)
    return m.compile(target="numpy")


def test_a_hanging_body_with_a_free_rotor() -> None:
    rng = np.random.default_rng(3)
    first = None
    for turn, options in (
        (Rotation.identity(), {}),
        *((Rotation.random(rng=rng), {}) for _ in range(6)),
        (Rotation.identity(), {"unit": 1000.0}),
        (Rotation.from_euler("xyz", [0.3, 0.4, 0.5]), {"rotation": "euler_angles"}),
    ):
        mod = hanging(turn, **options)
        names = [n for n in mod.q_names if n.startswith("S_")]
        down = Rotation.from_euler("xyz", [0.2, 0.1, -1.4])
        e = down.as_quat(scalar_first=True)
        guess = dict(zip(names, e if len(names) == 4 else down.as_euler("XYZ"), strict=True))
        found = mod.equilibrium(guess)
        pose = mod.poses(found.q)[mod.body_names.index("body")][:3, :3] @ turn.as_matrix().T
        outcome = (pose, found.stability, np.sort(np.abs(found.eigenvalues)))
        first = first or outcome
        np.testing.assert_allclose(outcome[0], first[0], atol=1e-8)
        assert outcome[1] == first[1] == "marginal"
        np.testing.assert_allclose(outcome[2][2:], first[2][2:], rtol=1e-6)
