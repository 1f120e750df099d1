"""Which joint of a loop is cut, and that the tree reaches every body in an order where parents come first."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import eomgen as eg
from eomgen import Model
from eomgen.kinematics import analyse, find_topology


def four_bar(named: Sequence[str] = ()) -> Model:
    """Ground, three links and four revolute joints A, B, C, D; the joints in ``named`` have a named coordinate."""
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    bars = [m.body(name, mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1}) for name in ("crank", "coupler", "rocker")]
    names = {j: f"angle_{j}" if j in named else None for j in "ABCD"}
    m.revolute("A", m.ground, bars[0], coordinate=names["A"])
    m.revolute("B", bars[0].at(1, 0, 0), bars[1], coordinate=names["B"])
    m.revolute("C", bars[1].at(2, 0, 0), bars[2], coordinate=names["C"])
    m.revolute("D", bars[2].at(1.5, 0, 0), m.ground.at(2, 0, 0), coordinate=names["D"])
    return m


@pytest.mark.parametrize(
    ("named", "independent", "cut"),
    [
        ("", (), "C"),  # B and C leave equally short chains, C is declared later
        ("C", (), "B"),  # C is named, and B leaves shorter chains than A or D
        ("BC", (), "D"),  # among A and D the chains are equally long, D is declared later
        ("ABC", (), "D"),  # only D is unnamed
        ("ABCD", (), "C"),  # all named: as if none were
        ("", ("C",), "B"),  # a chosen independent coordinate stays in the tree
        ("BD", ("C",), "A"),
    ],
)
def test_cut_joint(named: str, independent: tuple[str, ...], cut: str) -> None:
    mechanism = four_bar(named).mechanism()
    topology = find_topology(mechanism, independent)
    assert [mechanism.joints[k].name for k in topology.cut] == [cut]


def test_parents_come_first() -> None:
    mechanism = four_bar().mechanism()
    topology = find_topology(mechanism)
    seen = {-1}
    for branch in topology.branches:
        assert branch.parent in seen
        seen.add(branch.body)
    assert len(seen) == 1 + len(mechanism.bodies)


def test_joint_passed_backwards_is_marked() -> None:
    mechanism = four_bar("BC").mechanism()  # tree: A, B, C; D is declared from the rocker to ground and cut
    assert not any(b.reversed for b in find_topology(mechanism).branches)
    topology = find_topology(four_bar("D").mechanism())
    turned = {mechanism.joints[b.joint].name for b in topology.branches if b.reversed}
    assert "D" in turned


def test_long_ladder_of_loops_keeps_chains_short() -> None:
    """A ladder of four-bars: every loop is cut so that no body hangs deeper than three joints from ground."""
    m = eg.Model("ladder", gravity=(0, -9.81, 0))
    pivots = [m.ground.at(k, 0, 0) for k in range(6)]
    rods = [m.body(f"rod{k}", mass=1, com=(0, 0.5, 0), inertia={"zz": 0.1}) for k in range(6)]
    for k, rod in enumerate(rods):
        m.revolute(f"foot{k}", pivots[k], rod)
    for k in range(5):
        bar = m.body(f"bar{k}", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
        m.revolute(f"left{k}", rods[k].at(0, 1, 0), bar)
        m.revolute(f"right{k}", bar.at(1, 0, 0), rods[k + 1].at(0, 1, 0))
    kinematics = analyse(m.mechanism())
    assert len(kinematics.topology.cut) == 5
    depth = {-1: 0}
    for branch in kinematics.topology.branches:
        depth[branch.body] = depth[branch.parent] + 1
    assert max(depth.values()) == 2
    assert len(kinematics.constraints.values) == 10
