"""Equations of rolling and of blades at random states, against searches over the wheel's surface."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from judges import Bodies
from models import rotation as rpy

import eomgen as eg
from eomgen.graph import evaluate
from eomgen.kinematics import analyse

RADIUS, TUBE = 0.4, 0.07
TILT = (0.3, -0.2, 0.5)


def rolling(moving_plane: bool = False, **keys: Any) -> eg.Model:
    """A free body with a wheel out of its centre, over a tilted plane that may move."""
    m = eg.Model("roller")
    body = m.body("body", mass=1, inertia=(0.1, 0.2, 0.15))
    m.free("free", m.ground, body, sequence="zxy")
    wheel = body.marker("hub", at=(0.1, -0.05, 0.02), rpy=(0.4, 0.1, 0.2))
    plane = m.ground.at(0.1, 0.2, -0.3, rpy=TILT)
    if moving_plane:
        table = m.body("table", mass=2, inertia=(1, 1, 1))
        m.planar("slide", m.ground.at(0, 0, 0, rpy=(0.1, 0, 0)), table)
        plane = table.marker("top", at=(0.1, 0.2, -0.3), rpy=TILT)
    m.rolling("roll", wheel, plane, radius=RADIUS, **keys)
    return m


def rows_at(model: eg.Model, q: np.ndarray, v: np.ndarray) -> dict[str, float]:
    """The element's equations at a state, by label, made without the rest of the constraint machinery."""
    mechanism = model.mechanism()
    (constraint,) = mechanism.constraints
    kinematics = analyse(replace(mechanism, constraints=()))
    conditions = constraint.conditions(kinematics.motion)
    values = dict(zip(kinematics.names, q.tolist(), strict=True))
    values |= {f"{n}_dot": x for n, x in zip(kinematics.names, v.tolist(), strict=True)}
    numbers = evaluate([c.expression for c in conditions], values)
    assert all((c.level == "position") == (c.label == "height") for c in conditions)
    return dict(zip([c.label for c in conditions], map(float, numbers), strict=True))


def state(model: eg.Model, seed: int) -> tuple[Any, np.ndarray, np.ndarray]:
    """A module of the model without its constraint, and a random state."""
    model.description.sections["constraints"], kept = [], model.description.sections["constraints"]
    mod = model.compile(target="numpy")
    model.description.sections["constraints"] = kept
    random = np.random.default_rng(seed)
    return mod, random.uniform(-0.6, 0.6, mod.n_q), random.uniform(-2, 2, mod.n_v)


HUB, HUB_TURN = np.array([0.1, -0.05, 0.02]), (0.4, 0.1, 0.2)
TOP = np.array([0.1, 0.2, -0.3])


def lowest(center: np.ndarray, R: np.ndarray, n: np.ndarray, shape: str, tube: float) -> np.ndarray:
    """The surface point of the wheel that is lowest along n, by search: rim circle plus a sphere of the tube's size."""
    if shape == "sphere":
        return center - RADIUS * n
    angle = np.linspace(0, 2 * np.pi, 20001)
    for _ in range(4):
        rim = center[:, None] + (RADIUS - tube) * (R[:, :1] * np.cos(angle) + R[:, 1:2] * np.sin(angle))
        best = int(np.argmin(n @ rim))
        width = angle[1] - angle[0]
        angle = np.linspace(angle[best] - width, angle[best] + width, 2001)
    return rim[:, best] - tube * n


@pytest.mark.parametrize("moving_plane", [False, True])
@pytest.mark.parametrize("keys", [{}, {"tube": TUBE}, {"shape": "sphere"}, {"shape": "sphere", "no_spin": True}])
def test_height_and_slip_of_the_lowest_point(keys: dict[str, Any], moving_plane: bool) -> None:
    model = rolling(moving_plane, **keys)
    for seed in (1, 2, 3):
        mod, q, v = state(model, seed)
        rows = rows_at(model, q, v)
        bodies = Bodies(mod, q, v)
        hub = bodies.r[0] + bodies.R[0] @ HUB
        plane = rpy(TILT)
        origin, w, at = TOP, np.zeros(3), np.zeros(3)
        if moving_plane:
            plane, origin = bodies.R[1] @ plane, bodies.r[1] + bodies.R[1] @ TOP
            w, at = bodies.w[1], bodies.v[1]
        n = plane[:, 2]
        point = lowest(hub, bodies.R[0] @ rpy(HUB_TURN), n, keys.get("shape", "disc"), keys.get("tube", 0.0))
        assert rows["height"] == pytest.approx(n @ (point - origin), abs=1e-9)
        arm = point - (bodies.r[0])
        slip = bodies.v[0] + np.cross(bodies.w[0], arm)
        if moving_plane:
            slip = slip - at - np.cross(w, point - bodies.r[1])
        np.testing.assert_allclose([rows["slip_x"], rows["slip_y"]], (plane.T @ slip)[:2], atol=1e-7)
        if "no_spin" in keys:
            assert rows["spin"] == pytest.approx(n @ (bodies.w[0] - w), abs=1e-11)


def test_a_blade_does_not_move_sideways() -> None:
    m = eg.Model("sleigh")
    body, table = m.body("body", mass=1, inertia=(1, 1, 1)), m.body("table", mass=1, inertia=(1, 1, 1))
    m.planar("move", m.ground, body)
    m.planar("turn", m.ground, table)
    m.knife_edge("blade", body.at(0.3, -0.1, 0, rpy=(0, 0, 0.4)), axis="y", on=table)
    mod, q, v = state(m, 4)
    bodies = Bodies(mod, q, v)
    arm = bodies.R[0] @ [0.3, -0.1, 0]
    point = bodies.r[0] + arm
    side = bodies.R[0] @ rpy((0, 0, 0.4)) @ [0, 1, 0]
    relative = bodies.v[0] + np.cross(bodies.w[0], arm) - bodies.v[1] - np.cross(bodies.w[1], point - bodies.r[1])
    assert rows_at(m, q, v)["slip"] == pytest.approx(side @ relative, abs=1e-11)


def test_a_wheel_in_the_plane_of_the_paper() -> None:
    """x' + r theta' = 0 and nothing else: height and side slip hold identically."""
    m = eg.Model("wheel")
    carriage, wheel = m.body("carriage", mass=1), m.body("wheel", mass=1, inertia=(1, 1, 2))
    m.prismatic("rail", m.ground.at(0, 0.25, 0), carriage, axis="x", coordinate="x")
    m.revolute("hub", carriage, wheel, coordinate="theta")
    m.rolling("roll", wheel, m.ground.at(0, 0, 0, rpy=(-np.pi / 2, 0, 0)), radius=0.25)
    rows = rows_at(m, np.array([0.3, 0.7]), np.array([2.0, -5.0]))
    assert rows["height"] == rows["slip_y"] == 0
    assert rows["slip_x"] == pytest.approx(2.0 - 0.25 * 5.0)
