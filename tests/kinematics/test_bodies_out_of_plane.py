"""One moment of inertia alone is that of a body in a plane: a body that turns otherwise is told of."""

from __future__ import annotations

import pytest

import eomgen as eg


def body_on(axis: str, inertia: dict[str, float], turned: list[str] | None = None) -> list[str]:
    m = eg.Model("m")
    b = m.body("b", mass=1, com=[0, 0.1, 0], inertia=inertia)
    place = b.marker("p", at=[0, 0, 0], rpy=turned) if turned else b
    m.revolute("j", m.ground, place, axis=axis, coordinate="q")
    return [note for note in m.derive().report.notes if "turns about axes" in note]


@pytest.mark.parametrize("axis", "xy")
def test_it_is_told(axis: str) -> None:
    (note,) = body_on(axis, {"zz": 1.0})
    assert note.startswith("b turns about axes without a given moment of inertia")
    assert body_on(axis, {"xx": 1.0, "yy": 1.0, "zz": 1.0}) == []


def test_a_body_in_a_plane_is_not() -> None:
    assert body_on("z", {"zz": 1.0}) == []
    assert body_on("x", {"xx": 1.0}) == []
    assert body_on("x", {"zz": 1.0}, ["0", "pi/2", "0"]) == []  # the joint's x is the body's z, by another frame
    assert len(body_on("x", {"zz": 1.0}, ["0", "pi/3", "0"])) == 1
