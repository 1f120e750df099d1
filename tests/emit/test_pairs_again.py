"""Derivatives of a closed chain in contact: near pairs are found once for all columns, and anew for each state."""

from __future__ import annotations

import re

import numpy as np
import pytest

import eomgen as eg
from eomgen import pipeline
from eomgen.emit import emit_c
from eomgen.graph import pair_calls

LAW = {"stiffness": 2e4, "dissipation": 0.3, "friction": 0.4, "smoothing": 0.1}
LINKS = 20


def ring() -> eg.Model:
    """A ring of links on hinges round a wheel on ground, over a floor."""
    m = eg.Model("ring", gravity=(0, -9.81, 0))
    length = 2 * np.sin(np.pi / LINKS)  # of a polygon of radius 1
    first = m.body("link0", mass=1.0, com=(length / 2, 0, 0), inertia={"zz": 0.01})
    m.planar("free", m.ground, first)
    m.initial(free_x=0.0, free_y=-1.0, free_3=np.pi / LINKS)
    links, last = [first], first
    for k in range(1, LINKS):
        link = m.body(f"link{k}", mass=1.0, com=(length / 2, 0, 0), inertia={"zz": 0.01})
        m.revolute(f"turn{k}", last.at(length, 0, 0), link, coordinate=f"a{k}")
        m.guess(**{f"a{k}": 2 * np.pi / LINKS})
        last = link
        links.append(link)
    m.revolute("end", last.at(length, 0, 0), first)
    pins = {"shape": "circle", "on": links, "radius": 0.08}
    m.contacts("floor", pins, {"shape": "half_plane", "on": m.ground.at(0, -1.07, 0)}, LAW)
    m.contacts("wheel", pins, {"shape": "circle", "on": [m.ground], "radius": 0.93}, LAW)
    return m


def states(mod: eg.Module) -> list[np.ndarray]:
    """Closed states with different pairs in contact."""
    rng = np.random.default_rng(3)
    found = []
    for shift in (0.0, 0.005, 0.02, -0.015):
        x = mod.x0()
        x[mod.q_names.index("free_y")] += shift
        x[: mod.n_q] += 1e-3 * rng.standard_normal(mod.n_q)
        x[mod.n_q :] = 0.1 * rng.standard_normal(mod.n_v)
        found.append(mod.project(x))
    return found


def test_columns_are_differences_of_right_hand_sides_in_any_order_of_states(monkeypatch: pytest.MonkeyPatch) -> None:
    equations = ring().derive()
    texts = emit_c(pipeline.build(equations, "c", ["rhs", "jacobian"]))
    assert {sum_ for text in texts.values() for sum_ in re.findall(r"pairs_(\w+)_again\(w", text)} == {"floor", "wheel"}
    mod = equations.compile()
    first = [mod.jacobian(0.0, x) for x in states(mod)]
    assert len({np.count_nonzero(np.abs(J) > 1e3) for J in first}) > 1  # not the same pairs everywhere
    for x, J in zip(reversed(states(mod)), reversed(first), strict=True):
        np.testing.assert_array_equal(mod.jacobian(0.0, x), J)
    steps = 1e-7 * np.eye(mod.n_x)
    for x, J in zip(states(mod), first, strict=True):
        slopes = np.array([(mod.rhs(0.0, x + h) - mod.rhs(0.0, x - h)) / 2e-7 for h in steps]).T
        assert np.abs(J - slopes).max() <= 2e-6 * np.abs(J).max()
    other = equations.compile(target="numpy")
    x = states(mod)[0]
    assert np.abs(other.jacobian(0.0, x) - first[0]).max() <= 1e-10 * np.abs(first[0]).max()
    monkeypatch.setattr(pair_calls, "SPARE", 2)
    monkeypatch.setattr(pair_calls, "IN_PLANE", 0)
    crowded = ring().derive().compile(kernels=["rhs", "jacobian"])  # without room for the pairs that are near
    for x, J in zip(states(mod), first, strict=True):
        np.testing.assert_array_equal(crowded.jacobian(0.0, x), J)
