"""Closed chains with contacts of groups: Jacobians, by text and by loops, are the slopes of right-hand sides."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.emit import c_rolled, pair_statements
from eomgen.program import Program


def ring(n: int, name: str, **friction: Any) -> eg.Model:
    """A closed chain of n discs that lies on the floor, pressed together by springs."""
    m = eg.Model(name, gravity=(0, -9.81, 0))
    length, radius = 0.1, 0.1 / (2 * np.sin(np.pi / n))
    links = [m.body(f"b{k}", mass=1.0 + 0.1 * k, com=(0.05, 0, 0), inertia={"zz": 2e-3}) for k in range(n)]
    m.planar("root", m.ground, links[0], coordinates=["x", "y", "turn0"])
    for k, (a, b) in enumerate(pairwise(links), 1):
        m.revolute(f"turn{k}", a.at(length, 0, 0), b)
        m.initial(**{f"turn{k}": 2 * np.pi / n}) if k < n - 2 else m.guess(**{f"turn{k}": 2 * np.pi / n})
    m.revolute("closure", links[-1].at(length, 0, 0), links[0])
    m.initial(x=0, y=radius * (np.cos(np.pi / n) - 1) + radius, turn0=0.1)
    discs = {"shape": "circle", "on": [link.at(0.05, 0, 0) for link in links], "radius": 0.06}
    law = {"stiffness": 1e4, "dissipation": 0.5, "friction": 0.4, **(friction or {"smoothing": 0.05})}
    m.contacts("floor", discs, {"shape": "half_plane", "on": m.ground}, law)
    m.contacts("among", discs, law=law)
    return m


def slopes(mod: Any, x: np.ndarray) -> np.ndarray:
    """Of the right-hand side by central differences of the fourth order."""
    h = 1e-4
    columns = []
    for unit in np.eye(len(x)):
        near, far = (mod.rhs(0.0, x + k * h * unit) - mod.rhs(0.0, x - k * h * unit) for k in (1, 2))
        columns.append((8 * near - far) / (12 * h))
    return np.array(columns).T


@pytest.mark.parametrize("rolled", [0, 10**9], ids=["loops", "text"])
def test_jacobian_of_a_closed_chain_in_contact(rolled: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c_rolled, "ALIKE", 0)
    monkeypatch.setattr(Program, "is_rolled", lambda program, name: program.counts[name].total > rolled)
    mod = ring(7, "by_text" if rolled else "by_loops").compile()
    x = mod.x0()
    x[mod.n_q :] = 0.3 * np.sin(np.arange(mod.n_x - mod.n_q))
    x = mod.project(x)
    expected = slopes(mod, x)
    assert np.abs(expected[mod.n_q :, : mod.n_q]).max() > 1e3  # discs touch
    np.testing.assert_allclose(mod.jacobian(0.0, x), expected, rtol=0, atol=2e-6 * np.abs(expected).max())


BRISTLES = {"friction_law": "lugre", "bristle_stiffness": 2e3, "bristle_damping": 5.0}


@pytest.mark.parametrize("states", [False, True], ids=["laws", "bristles"])
def test_columns_of_contacts_are_their_derivatives(states: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Jacobians by columns that are kept, by columns that soon find no room, and by differences."""
    model = ring(7, "with_room", **(BRISTLES if states else {}))
    mod = model.compile()
    x = mod.x0()
    x[mod.n_q :] = 0.3 * np.sin(np.arange(mod.n_x - mod.n_q))
    x[["bristle" in name for name in mod.x_names]] *= 1e-3
    x = mod.project(x)
    found, expected = mod.jacobian(0.0, x), slopes(mod, x)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())
    monkeypatch.setattr(pair_statements, "SLOTS", 0 if states else 2)
    other = ring(7, "without_room", **(BRISTLES if states else {})).compile()
    np.testing.assert_allclose(other.jacobian(0.0, x), found, rtol=0, atol=1e-12 * np.abs(found).max())
