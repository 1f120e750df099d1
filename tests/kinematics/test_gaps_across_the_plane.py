"""Plane loops whose hinges do not lie in one plane: a gap that nothing moves is told, rounding is not one."""

from __future__ import annotations

import pytest

import eomgen as eg
from eomgen.errors import AssemblyError


def four_bar(offset: float) -> eg.Model:
    m = eg.Model("bars", gravity=(0, -9.81, 0))
    crank, rod, rocker = (m.body(name, mass=1.0, inertia={"zz": 0.1}) for name in ("crank", "rod", "rocker"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(0.3, 0, 0), rod)
    m.revolute("C", rod.at(1.0, 0, offset), rocker.at(0.8, 0, 0))
    m.revolute("D", m.ground.at(0.9, 0, 0), rocker)
    m.guess = {"theta": 1.0}
    return m


@pytest.mark.parametrize("offset", [1e-9, 1e-4, 5e-3])
def test_a_gap_across_the_plane_is_told(offset: float) -> None:
    with pytest.raises(AssemblyError, match=r"C\.r_z"):
        four_bar(offset).derive()


@pytest.mark.parametrize("offset", [0.0, 0.1 + 0.2 - 0.3])
def test_rounding_across_the_plane_is_none(offset: float) -> None:
    assert four_bar(offset).compile(target="numpy").n_dof == 1
