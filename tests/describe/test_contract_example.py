"""The documented slider-crank: Python and YAML describe one and the same mechanism."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from eomgen import Model, load
from eomgen.describe import Mechanism
from eomgen.forces import Actuator, JointCoordinate, Line, Spring
from eomgen.frames import GROUND
from eomgen.graph import Expr, evaluate, vectors

VALUES = {"g": 9.7, "r": 0.11, "l": 0.36, "m_c": 1.2, "m_r": 0.7, "m_s": 0.6, "tau": 0.4}


def numbers(expressions: list[Expr]) -> list[float]:
    return [float(x) for x in evaluate(expressions, VALUES)]


def fingerprint(m: Mechanism) -> list[float]:
    """Every number behind bodies, markers and forces at one set of parameters."""
    parts: list[Expr] = [*m.gravity]
    for body in m.bodies:
        parts += [body.mass, *body.com, *(x for row in body.inertia for x in row)]
    for joint in m.joints:
        for marker in (joint.predecessor, joint.successor):
            parts += [*marker.frame.position, *(x for row in marker.frame.rotation for x in row)]
    return numbers(parts)


def test_python_and_yaml_agree(slider_crank: Model, slider_crank_text: str, write) -> None:
    a, b = slider_crank.mechanism(), load(write(slider_crank_text)).mechanism()
    np.testing.assert_allclose(fingerprint(a), fingerprint(b), rtol=1e-14)
    assert {p.name: p.value for p in a.parameters} == {p.name: p.value for p in b.parameters}
    for m in (a, b):
        assert [x.name for x in m.bodies] == ["crank", "rod", "slider"]
        assert [(j.name, j.coordinates, j.named) for j in m.joints] == [
            ("A", ("theta",), True),
            ("B", ("B",), False),
            ("C", ("C",), False),
            ("D", ("s",), True),
        ]
        assert [(j.predecessor.body, j.successor.body) for j in m.joints] == [(GROUND, 0), (0, 1), (1, 2), (GROUND, 2)]
        motor, spring = m.forces
        assert isinstance(motor, Actuator)
        assert motor.path == JointCoordinate("theta")
        assert motor.value == m.graph.symbol("tau")
        assert isinstance(spring, Spring)
        assert isinstance(spring.path, Line)
        assert numbers([*spring.path.start.frame.position, spring.stiffness, spring.rest]) == [0.5, 0, 0, 200, 0.1]
        assert [o.name for o in m.outputs] == ["pin_x", "speed"]
        assert {k: (q.marker.label, q.level, q.axis) for k, q in m.quantities.items()} == {
            "x(rod.tip)": ("rod.tip", 0, 0),
            "vx(slider)": ("slider", 1, 0),
        }
        assert m.independent == ("theta",)
        assert {k: v.value for k, v in m.initial.items()} == {"theta": 0.3, "theta_dot": 10.0}
        assert (m.simulation.end, m.simulation.method, m.simulation.rtol) == (5.0, "DOP853", 1e-9)


def test_the_file_says_where_things_stand(slider_crank_text: str, write) -> None:
    path = write(slider_crank_text)
    m = load(path).mechanism()
    assert m.lines["joints.D.axis"] == (str(path), 19)
    problem = m.problem("joints.D.coordinate.x", "is odd")
    assert (problem.file, problem.line) == (str(path), 19)
    assert m.parameters[0].doc == "crank radius"
    assert m.parameters[0].unit == "m"


def test_the_axis_becomes_z(slider_crank: Model) -> None:
    m = slider_crank.mechanism()
    turned = m.joints[3].predecessor.frame.rotation
    assert [[x.value for x in row] for row in turned] == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert m.joints[0].predecessor.frame.rotation == vectors.identity(m.graph)


def test_unnamed_markers_keep_their_text_as_label(slider_crank: Model) -> None:
    m = slider_crank.mechanism()
    assert m.joints[1].predecessor.label == "crank.at(r, 0, 0)"
    assert m.forces[1].path.start.label == "ground.at(0.5, 0, 0)"  # type: ignore[attr-defined]


def test_handles_give_symbols(slider_crank: Model) -> None:
    assert slider_crank.joints["A"].coordinate == sympy.Symbol("theta")
    assert slider_crank.joints["A"].velocity == sympy.Symbol("theta_dot")
    assert slider_crank.bodies["rod"].acceleration[1] == sympy.Symbol("ay(rod)")
    assert slider_crank.coordinate("s") == sympy.Symbol("s")
    assert slider_crank.parameters["r"] == sympy.Symbol("r")


def test_motion_of_an_unnamed_marker(slider_crank: Model) -> None:
    middle = slider_crank.bodies["rod"].at("l/2", 0, 0)
    slider_crank.output("height", 2 * middle.position[1])
    m = slider_crank.mechanism()
    quantity = m.quantities["y(rod.at(l/2, 0, 0))"]
    assert (quantity.level, quantity.axis, quantity.marker.body) == (0, 1, 1)
    assert numbers([quantity.marker.frame.position[0]]) == pytest.approx([0.18])


def test_display_is_short(slider_crank: Model) -> None:
    assert repr(slider_crank) == (
        "<Model slider_crank: 6 parameters, 1 input, 3 bodies, 4 joints, 2 forces, 2 outputs>"
    )
    html = slider_crank._repr_html_()
    assert "crank.at(r, 0, 0) to rod" in html
    assert html.count("<tr>") == 19
