"""Rigid contact: heaps, whose bodies have many neighbours, and thin or fast shapes, which must not pass each other."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np
import pytest
from rigid_scenes import rigid

import eomgen as eg
from eomgen.errors import SimulationError
from eomgen.runtime.signals import Forcing
from eomgen.simulation.moreau import ContactWarning
from eomgen.simulation.rigid_rows import RigidContacts
from eomgen.simulation.rigid_steps import RigidSteps

D = 0.2  #: diameter of the bodies of heaps


def hexagonal(rows: int) -> np.ndarray:
    """Centres (n, 2) of discs in rows that touch."""
    each = itertools.product(range(rows), range(rows))
    return np.array([(D * (j + 0.5 * (i % 2)), D * (0.5 + np.sqrt(0.75) * i)) for i, j in each])


def face_centred() -> np.ndarray:
    """Centres (32, 3) of spheres, twelve of which touch one within."""
    base = np.array([(0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)]) / np.sqrt(2.0)
    cells = np.array(list(itertools.product(range(2), repeat=3))) * np.sqrt(2.0)
    return np.asarray(D * ((cells[:, None] + base).reshape(-1, 3) + np.array((0.0, 0.0, 0.5))))


def heap(centres: np.ndarray, target: str) -> tuple[Any, dict[str, float]]:
    """Discs or spheres at rest on ground at height 0, and their initial values."""
    axes = centres.shape[1]
    m = eg.Model("heap", gravity=(0, -9.81, 0) if axes == 2 else (0, 0, -9.81))
    shapes: list[dict[str, Any]] = []
    start: dict[str, float] = {}
    for k, centre in enumerate(centres):
        body = m.body(f"b{k}", mass=1.0, inertia={"zz": 0.01} if axes == 2 else dict.fromkeys(("xx", "yy", "zz"), 0.01))
        (m.planar if axes == 2 else m.free)(f"j{k}", m.ground, body)
        shapes.append({"shape": "circle" if axes == 2 else "sphere", "radius": 0.5 * D, "on": body})
        start |= {f"j{k}_{axis}": float(x) for axis, x in zip("xyz", centre, strict=False)}
    law = rigid(friction=0.3)
    m.contacts("among", shapes, law=law)
    m.contacts("floor", shapes, {"shape": "half_plane" if axes == 2 else "half_space", "on": m.ground}, law)
    return m.compile(target=target), start


def touching(centres: np.ndarray) -> int:
    """Pairs whose centres are a diameter apart, and bodies on the ground."""
    reach = np.linalg.norm(centres[:, None] - centres, axis=2)
    return int((np.abs(reach - D) < 1e-9).sum()) // 2 + int((np.abs(centres[:, -1] - 0.5 * D) < 1e-9).sum())


@pytest.mark.parametrize(
    ("centres", "contacts", "target"),
    [
        (hexagonal(3), 3 * 2 + 2 * 5 + 3, "cython"),
        (hexagonal(6), 6 * 5 + 5 * 11 + 6, "numpy"),  # in rows, between rows, on the ground
        pytest.param(hexagonal(10), 10 * 9 + 9 * 19 + 10, "numpy", marks=pytest.mark.thorough),
        (face_centred(), None, "numpy"),
    ],
)
def test_lists_hold_heaps(centres: np.ndarray, contacts: int | None, target: str) -> None:
    """As many contacts as geometry has, and hardly more that are listed."""
    mod, start = heap(centres, target)
    rows = RigidContacts(mod).rows(0.0, mod.x0(start)[: mod.n_q], None)
    expected = touching(centres)
    assert contacts in (None, expected)
    assert int((np.abs(rows.gaps) < 1e-9).sum()) == expected
    assert len(rows.gaps) < 1.3 * expected


@pytest.mark.parametrize("centres", [hexagonal(10), face_centred()])
def test_heaps_run(centres: np.ndarray) -> None:
    """Two steps of a heap, in which every contact takes part; nothing sinks."""
    mod, start = heap(centres, "numpy")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # the impulses of such heaps are not unique
        run = mod.simulate(2e-3, start, method="moreau", step=1e-3, contact_iterations=5)
    assert run.metadata["contacts"] == touching(centres)
    assert run.metadata["penetration"] < 1e-4
    assert run.metadata["steps"] == 2


def thrown_at_wall(offset: float, speed: float, step: float, end: float | None = None) -> Any:
    """A ball (r = 20 mm) that flies along x against a wall of 10 mm at x = 1 m."""
    m = eg.Model("wall")
    ball = m.body("b", mass=0.1, inertia={"zz": 1e-5})
    m.planar("j", m.ground, ball)
    wall = {"shape": "segment", "length": 2.0, "radius": 0.005, "on": m.ground.at(1.0, 0, 0, rpy=(0, 0, np.pi / 2))}
    m.contacts("c", {"shape": "circle", "radius": 0.02, "on": ball}, wall, rigid())
    start = {"j_x": offset, "j_x_dot": speed}
    return m.compile(target="numpy").simulate(end or 2.0 / speed, start, method="moreau", step=step)


@pytest.mark.parametrize("phase", np.linspace(0.0, 1.0, 9)[:-1])
@pytest.mark.parametrize(("speed", "step"), [(12.0, 5e-3), (60.0, 5e-3)])
def test_a_thin_wall_stops_a_ball(phase: float, speed: float, step: float) -> None:
    run = thrown_at_wall(phase * speed * step, speed, step)
    assert abs(run["j_x_dot"][-1]) < 1e-9
    assert 0.97 < run["j_x"][-1] < 0.9751
    assert run.metadata["penetration"] < 2e-3
    assert len(run.t) <= 2.0 / speed / step + 2  # the times are those of the steps asked for


@pytest.mark.parametrize("gap", [0.0, 1e-9, 1e-3])
def test_a_ball_that_begins_at_the_wall(gap: float) -> None:
    run = thrown_at_wall(0.975 - gap, 12.0, 5e-3)
    assert abs(run["j_x_dot"][-1]) < 1e-9
    assert run["j_x"][-1] < 0.98


def test_slow_balls_take_the_steps_asked_for() -> None:
    run = thrown_at_wall(0.5, 1.0, 1e-3)
    assert run.metadata["steps"] == 2000


def test_head_on_in_compiled_code() -> None:
    """Two equal spheres exchange their velocities (elastic, 80 m/s towards each other, 8 diameters in a step)."""
    m = eg.Model("two")
    balls = [m.body(f"b{k}", mass=0.3, inertia={"xx": 1e-4, "yy": 1e-4, "zz": 1e-4}) for k in range(2)]
    for k, ball in enumerate(balls):
        m.free(f"j{k}", m.ground, ball)
    m.contacts("c", [{"shape": "sphere", "radius": 0.025, "on": ball} for ball in balls], law=rigid(restitution=1.0))
    start = {"j0_x": -1.013, "j1_x": 1.0, "j0_x_dot": 50.0, "j1_x_dot": -30.0}
    run = m.compile().simulate(0.05, start, method="moreau", step=5e-3)
    np.testing.assert_allclose([run["j0_x_dot"][-1], run["j1_x_dot"][-1]], [-30.0, 50.0], rtol=1e-9)
    assert run.metadata["steps"] > 10


def test_too_fast_for_any_step() -> None:
    with pytest.raises(SimulationError, match=r"moreau stopped at .* may pass through each other even in steps of"):
        thrown_at_wall(0.0, 1e6, 5e-3, 5e-3)


def test_loops_close_at_the_end_of_a_step() -> None:
    """A slider that an input moves is where the input is at the end of a step, not half a step before."""
    m = eg.Model("led", gravity=(0, -9.81, 0))
    m.input("s")
    slider = m.body("slider", mass=1.0)
    m.prismatic("x", m.ground, slider, axis="x", coordinate="x")
    m.driver("d", "x", "s")
    ball = m.body("b", mass=1.0, inertia={"zz": 0.01})
    m.planar("j", m.ground, ball)
    m.contacts("c", {"shape": "circle", "radius": 0.1, "on": ball}, {"shape": "half_plane", "on": m.ground}, rigid())
    mod = m.compile(target="numpy")
    forcing = Forcing(mod.layout, {"s": "0.1*sin(20*t)"})
    forcing.attach(mod)
    forcing.enter(0.0, 0.5)
    x = mod.bind(u=forcing(0.0, np.zeros(mod.n_x))).x0({"j_y": 0.3})
    q, _ = RigidSteps(mod, forcing, 1e-9, 200).step(0.0, x[: mod.n_q], x[mod.n_q :], 5e-3)
    np.testing.assert_allclose(q[mod.q_names.index("x")], 0.1 * np.sin(0.1), atol=1e-9)
