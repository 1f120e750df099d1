"""A model whose outputs speak of unnamed markers is saved, and what cannot be saved is said in one short line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

import eomgen as eg


def arm() -> eg.Model:
    m = eg.Model("arm", gravity=(0, "-g", 0))
    g, l = m.parameter("g", 9.81), m.parameter("l", 0.7)
    assert g is not None
    upper = m.body("upper", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    lower = m.body("lower", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    upper.marker("marker_1", at=(9, 9, 9))  # the user's own
    m.revolute("A", m.ground, upper, coordinate="theta")
    m.revolute("B", upper.at(l, 0, 0), lower, coordinate="phi")
    m.output("elbow", upper.at(l, 0, 0).position[0] + 2 * upper.at(l, 0.1, 0).velocity[1])
    m.output("tip", sympy.sin(lower.at(0.5, "l/2", 0, rpy=(0, 0, 1)).position[1]))
    m.output("turned", lower.at(0.5, "l/2", 0, rpy=(0, 0, 1)).angle)
    m.output("post", m.ground.at(0.25, l, 0).position[1])
    return m


def test_unnamed_markers_of_outputs_get_names(tmp_path: Path) -> None:
    m = arm()
    before = m.to_yaml()
    m.save(tmp_path / "arm.yaml")
    again = eg.load(tmp_path / "arm.yaml")
    x = [0.3, -0.4, 1.1, 0.7]
    found = [each.compile(target="numpy", kernels=["outputs"]).outputs(0.0, x) for each in (m, again)]
    np.testing.assert_array_equal(found[0], found[1])
    theta, phi, w = 0.3, -0.4, 1.1
    speed = w * (0.7 * np.cos(theta) - 0.1 * np.sin(theta))
    beyond = 0.7 * np.sin(theta) + 0.5 * np.sin(theta + phi) + 0.35 * np.cos(theta + phi)
    expected = [0.7 * np.cos(theta) + 2 * speed, np.sin(beyond), theta + phi + 1.0, 0.7]
    np.testing.assert_allclose(found[1], expected, rtol=1e-14)
    markers = {e.name: e.values.get("markers") for e in again.description.sections["bodies"]}
    assert list(markers["upper"]) == ["marker_1", "marker_2", "marker_3"]
    assert list(markers["lower"]) == list(markers["ground"]) == ["marker_1"]
    assert before == m.to_yaml() == again.to_yaml()  # writing changes nothing, and nothing is named twice


def test_markers_that_nothing_speaks_of_are_left_out() -> None:
    m = arm()
    m.body("lower_2", mass=1)
    assert "lower_2.at" not in m.to_yaml()
    m.ground.at(5, 5, 5).position  # noqa: B018 - asked for, not used
    assert "[5, 5, 5]" not in m.to_yaml()


def test_a_long_expression_that_has_no_text_is_refused_in_one_short_line() -> None:
    m = arm()
    a, b = sympy.symbols("theta phi")
    m.output("bad", sympy.expand((a + b) ** 60) + sympy.gamma(a))
    with pytest.raises(eg.UsageError, match=r"cannot be written as a text: .*gamma") as caught:
        m.to_yaml()
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)
