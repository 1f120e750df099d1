"""Models that no motion can mend: told at the check, by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import AssemblyError, EvaluationError, ModelError, UsageError


def disc(joint: str, **keys: str) -> eg.Model:
    m = eg.Model("disc", gravity=(0, 0, -9.81))
    d = m.body("d", mass=1, inertia=(0.25, 0.25, 0.5))
    getattr(m, joint)("f", m.ground, d, **keys)
    m.rolling("r", d, radius=1)
    return m


def test_a_disc_that_lies_flat_at_the_start_is_told_with_the_remedy() -> None:
    with pytest.raises(
        AssemblyError, match=r"constraints\.r: .*not finite.*the disc lies flat.*tilt the disc in initial"
    ):
        disc("free").check()


def test_a_disc_that_can_only_lie_flat_is_refused() -> None:
    with pytest.raises(ModelError, match=r"constraints\.r: d always lies flat"):
        disc("revolute").check()


def test_a_disc_that_has_fallen_flat_is_named() -> None:
    m = disc("free", rotation="euler_parameters")
    m.initial(f_e0=0.8, f_e1=0.6)
    module = m.compile(target="numpy")
    x = np.zeros(module.n_x)
    x[module.x_names.index("f_e0")] = 1.0
    with pytest.raises(EvaluationError, match=r"constraint 'r': the disc lies flat"):
        module.rhs(0.0, x)


@pytest.mark.parametrize("kind", ["spring", "damper"])
def test_a_line_between_points_that_always_coincide_is_refused(kind: str) -> None:
    m = eg.Model("coincident")
    a = m.body("a", mass=1, com=(0, -1, 0))
    m.revolute("A", m.ground, a)
    law = {"stiffness": 1, "length": 0.2} if kind == "spring" else {"damping": 1}
    getattr(m, kind)("Z", m.ground, a, **law)
    getattr(m, kind)("Y", a, a, **law)
    with pytest.raises(ModelError) as caught:
        m.check()
    assert [p.path for p in caught.value.problems] == ["forces.Z", "forces.Y"]
    assert all(p.message == "both ends are always at the same point" for p in caught.value.problems)


def test_a_fixed_end_inside_its_cylinder_is_refused() -> None:
    m = eg.Model("wrapped")
    m.parameter("r", 0.3)
    a = m.body("a", mass=1, com=(0, -1, 0))
    m.revolute("A", m.ground, a)
    via = [{"around": m.ground, "radius": "r"}]
    m.spring("Z", m.ground.at(0.2, 0, 0), a.at(0, -1, 0), via=via, stiffness=1, length=0.1)
    with pytest.raises(ModelError, match=r"forces\.Z\.via\[0\]: ground\.at\(0\.2, 0, 0\) lies inside the cylinder"):
        m.check()


def test_sizes_that_cannot_be_are_refused() -> None:
    m = eg.Model("sizes")
    a, b, c = (m.body(name, mass=1, inertia=(1, 1, 1)) for name in "abc")
    for name, body in zip("ABC", (a, b, c), strict=True):
        m.revolute(name, m.ground, body)
    m.planetary("P", sun="A", ring="B", carrier="C", radii={"sun": 2, "ring": 1})
    m.distance("D", a.at(1, 0, 0), b.at(0, 3, 0), length=-1)
    with pytest.raises(ModelError) as caught:
        m.check()
    told = str(caught.value)
    assert "joints.D.length: is -1; give a length greater than 0" in told
    assert "ring 1 is not larger than sun 2" in told


def test_calls_with_the_wrong_shape_of_values_are_told() -> None:
    m = eg.Model("calls")
    length = m.parameter("l", 1.0)
    m.revolute("q", m.ground, m.body("a", mass=1, com=(0, -1, 0)))
    m.torque("law", "q", 1 / length)
    with pytest.raises(UsageError, match="by name"):
        m.initial(5)
    module = m.compile(target="numpy")
    with pytest.raises(UsageError, match=r"must be a mapping of names to values"):
        module.x0(1)
    with pytest.raises(UsageError, match=r"not finite with l = 0 \(changed"):
        module.bind(p={"l": 0.0})


@pytest.mark.parametrize("target", ["numpy", "cython"])
def test_a_mapping_of_parameters_in_a_call_is_read_and_checked(target: str) -> None:
    m = eg.Model("calls")
    m.parameter("l", 1.0)
    m.revolute("q", m.ground, m.body("a", mass=1, com=(0, "-l", 0)))
    module = m.compile(target=target)
    assert module.rhs(0, [0.1, 0.0], p={"l": 2}).tolist() == module.rhs(0, [0.1, 0.0], p=[2.0]).tolist()
    with pytest.raises(UsageError, match="ll"):
        module.rhs(0, [0.0, 0.0], p={"ll": 1})


def test_markers_without_their_names_are_told(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(
        "name: x\nbodies: {a: {mass: 1, inertia: {zz: 1}, markers: [0.1, 0, 0]}}\n"
        "joints: {A: {type: revolute, between: [ground, a]}}\n"
    )
    with pytest.raises(ModelError, match=r"x.yaml:2: bodies.a.markers: \[0.1, 0, 0\] is not a mapping of marker names"):
        eg.load(path).check()


def test_lengths_whose_squares_overflow_are_told() -> None:
    m = eg.Model("huge")
    a, b, c = (m.body(name, mass=0) for name in "abc")
    m.revolute("A", m.ground, a, coordinate="th")
    m.revolute("B", a.at(0.1, 0, 0), b)
    m.revolute("C", b.at(0.3, 1e308, 0), c)
    m.prismatic("D", m.ground, c, axis="x", coordinate="s")
    with (
        np.errstate(all="ignore"),
        pytest.raises(AssemblyError, match="C.r_x: the constraint is not finite at the initial"),
    ):
        m.compile(target="numpy")


def test_a_singular_position_without_freedom_names_no_independent_coordinates() -> None:
    m = eg.Model("triangle")  # 0.2 + 0.2 = 0.4: flat, where both can turn for a moment
    a, b = (m.body(name, mass=1, inertia={"zz": 0.1}) for name in "ab")
    m.revolute("A", m.ground, a)
    m.revolute("B", a.at(0.2, 0, 0), b)
    m.revolute("C", b.at(0.2, 0, 0), m.ground.at(0.4, 0, 0))
    module = m.compile(target="numpy")
    with pytest.raises(EvaluationError, match="no degree of freedom; start a little away"):
        module.rhs(0.0, [0.0] * module.n_x)
