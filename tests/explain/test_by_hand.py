"""Numbers of a published slider-crank found in the line-by-line part.

Parameters of Flores, Leine and Glocker (2010), as in the file's source; accelerations at the outer dead centre, where
the slider of every book has x'' = -r omega^2 (1 + r/l), whatever the angular acceleration of the crank.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import eomgen as eg
from eomgen.explain.document import Folded, FormulaLine

FILE = Path(__file__).parents[1] / "reference" / "planar_slider_crank_dynamics.json"


def test_accelerations_of_a_published_slider_crank() -> None:
    known = json.loads(FILE.read_text(encoding="utf-8"))
    p = known["parameters_SI"]
    m = eg.Model("crank_drive", gravity=(0, "-g", 0))
    for name, value in p.items():
        m.parameter(name, value)
    crank = m.body("crank", mass="m1", com=("l1/2", 0, 0), inertia={"zz": "J1"})
    rod = m.body("rod", mass="m2", com=("l2/2", 0, 0), inertia={"zz": "J2"})
    slider = m.body("slider", mass="m3")
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at("l1", 0, 0), rod, coordinate="bend")
    m.revolute("C", rod.at("l2", 0, 0), slider)
    m.prismatic("D", m.ground, slider, axis="x", coordinate="s")
    m.initial(theta=0.0, theta_dot=150.0)
    document = m.derive(independent=["theta"]).explain()
    (section,) = [s for s in document.sections if s.title.startswith("Numbers")]
    pieces = [x for piece in section.pieces for x in (piece.pieces if isinstance(piece, Folded) else [piece])]
    lines = {piece.sides[0]: piece.sides[-1] for piece in pieces if isinstance(piece, FormulaLine)}
    crank_turn, rod_turn, along = map(float, known["reference"]["omega150"]["initial_acc"])
    assert lines[r"\ddot{\theta}"] == pytest.approx(crank_turn, rel=1e-9)
    assert lines[r"\ddot{s}"] == pytest.approx(along, rel=1e-9)
    assert lines[r"\ddot{\mathrm{bend}}"] == pytest.approx(rod_turn - crank_turn, rel=1e-9)
    assert along == pytest.approx(-p["l1"] * 150.0**2 * (1 + p["l1"] / p["l2"]))
    assert "5163.75" in document.html
    assert "-5163.75" in document.latex
    shown = [s for key, s in lines.items() if key.startswith(r"(\mathbf{a}_{\mathrm{slider}})")]
    assert shown == [pytest.approx(along, rel=1e-9)]
