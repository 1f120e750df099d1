"""Markers turned by two of their axes or by a matrix stand where SciPy's rotations put them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy
from scipy.spatial.transform import Rotation

import eomgen as eg
from eomgen.verification.variants import variant_findings


def pose(model: eg.Model, marker: str = "ground.m") -> np.ndarray:
    """Rotation of a body that is welded to a marker."""
    model.weld("glue", marker, model.body("probe", mass=1, inertia=(1, 1, 1)))
    mod = model.compile(target="numpy", kernels=["poses"])
    return np.asarray(dict(zip(mod.body_names, mod.poses([0.0]), strict=True))["probe"][:3, :3])


def model() -> eg.Model:
    m = eg.Model("m")
    m.parameter("a", 0.3)
    m.revolute("j", m.ground, m.body("b", mass=1, inertia=(1, 1, 1)))
    return m


@pytest.mark.parametrize(
    ("axes", "columns"),
    [
        ({"x": (1, 1, 0), "z": "z"}, [[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]),
        ({"z": "x", "y": "-z"}, [[0, -1, 0], [0, 0, -1], [1, 0, 0]]),
        ({"y": (0, 3, 4), "x": (1, 0, 0)}, [[1, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]]),
        ({"y": (2, 1, 2), "z": (1, 2, -2)}, [[-6 / 9, 6 / 9, 3 / 9], [2 / 3, 1 / 3, 2 / 3], [1 / 3, 2 / 3, -2 / 3]]),
    ],
)
def test_two_axes(axes: dict[str, object], columns: list[list[float]]) -> None:
    m = model()
    m.ground.marker("m", at=(1, 2, 3), axes=axes)
    wanted = np.array(columns, dtype=float).T
    wanted /= np.linalg.norm(wanted, axis=0)
    assert np.linalg.det(wanted) == pytest.approx(1)
    np.testing.assert_allclose(pose(m), wanted, rtol=0, atol=1e-15)


def test_a_matrix_of_numbers_and_one_of_expressions() -> None:
    turn = Rotation.from_euler("xyz", [0.4, -0.2, 1.1]).as_matrix()
    m = model()
    m.ground.marker("m", matrix=turn)
    np.testing.assert_allclose(pose(m), turn, rtol=0, atol=1e-15)
    a = sympy.Symbol("a")
    for matrix in (
        sympy.rot_axis3(-a),
        [["cos(a)", "-sin(a)", 0], ["sin(a)", "cos(a)", 0], [0, 0, 1]],
    ):
        m = model()
        m.ground.marker("m", matrix=matrix)
        np.testing.assert_allclose(pose(m), Rotation.from_euler("z", 0.3).as_matrix(), rtol=0, atol=1e-15)


def test_unnamed_markers_and_files(tmp_path: Path) -> None:
    m = model()
    place = m.ground.at(0, 1, 0, axes={"z": "x", "x": "y"})
    other = m.ground.at(0, 1, 0, matrix=np.eye(3)[[1, 0, 2]] * [[1], [1], [-1]])
    assert place.label != other.label
    body = m.body("slider", mass=1, inertia=(1, 1, 1))
    m.prismatic("s", place, body)
    m.output("here", body.position[0])
    m.save(tmp_path / "m.yaml")
    mod = eg.load(tmp_path / "m.yaml").compile(target="numpy")
    assert mod.outputs(0, mod.x0(s=0.7))[0] == pytest.approx(0.7)  # the marker's z is ground's x


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"axes": {"x": "x"}}, "is not a mapping of two of x, y, z"),
        ({"axes": {"x": "x", "w": "y"}}, "is not a mapping of two of x, y, z"),
        ({"axes": {"x": "x", "y": (1, 1, 0)}}, "the directions of x and y are not at right angles"),
        ({"matrix": np.eye(2)}, "is not a list of rows"),
        ({"matrix": 2 * np.eye(3)}, "is not a rotation"),
        ({"matrix": np.diag([1, 1, -1])}, "is not a rotation"),
        ({"matrix": np.eye(3), "rpy": (0, 0, 1)}, "rpy is given too"),
        ({"matrix": np.eye(3), "axes": {"x": "x", "y": "y"}}, "axes is given too"),
    ],
)
def test_faults(keys: dict[str, object], told: str) -> None:
    m = model()
    m.ground.marker("m", **keys)
    with pytest.raises(eg.ModelError, match=told):
        m.mechanism()


def test_verification_takes_them() -> None:
    """Variants of the model, body frames turned among them, give the same motion."""
    m = model()
    arm = m.bodies["b"]
    arm.marker("end", at=(1, 0, 0), axes={"x": (1, 1, 0), "z": "z"})
    m.prismatic("s", "b.end", m.body("c", mass=1, inertia=(1, 2, 2)), axis="x")
    m.spring("k", arm.at(0.2, 0, 0, matrix=[["cos(a)", "-sin(a)", 0], ["sin(a)", "cos(a)", 0], [0, 0, 1]]), "c", 30)
    found = variant_findings(m, seconds=8.0)
    assert any(not f.left_out for f in found)
    assert all(f.ok for f in found if not f.left_out)
