"""Solids of uniform density against integrals of the density over them, and meshes against trimesh."""

from pathlib import Path

import judges
import numpy as np
import pytest
from refusals import refused, refuses
from scipy.integrate import tplquad
from scipy.spatial.transform import Rotation

import eomgen as eg

trimesh = pytest.importorskip("trimesh")
Numbers = tuple[float, np.ndarray, np.ndarray]


def body_of(m: eg.Model, values: dict[str, float] | None = None) -> Numbers:
    """Mass, centre of mass and inertia about it of the only body, as numbers."""
    rigid = judges.described(m, values)
    return float(rigid.masses[0]), rigid.centers[0], rigid.inertias[0]


def one(**given: object) -> eg.Model:
    m = eg.Model("one")
    m.weld("J", m.ground, m.body("b", **given))  # type: ignore[arg-type]
    return m


def integrated(inside: tuple) -> Numbers:
    """Volume, centroid and inertia about it by quadrature over z, y, x bounds (scipy.tplquad)."""

    def integral(f) -> float:
        return tplquad(lambda z, y, x: f(x, y, z), *inside, epsabs=1e-11, epsrel=1e-11)[0]

    volume = integral(lambda x, y, z: 1.0)
    c = np.array([integral(lambda x, y, z, k=k: (x, y, z)[k]) for k in range(3)]) / volume
    pairs = [lambda x, y, z, i=i, j=j: (x, y, z)[i] * (x, y, z)[j] for i in range(3) for j in range(3)]
    second = np.reshape([integral(pair) for pair in pairs], (3, 3))
    second -= volume * np.outer(c, c)
    return volume, c, np.trace(second) * np.eye(3) - second


def round_bounds(radius, low: float, high: float) -> tuple:
    """Bounds of a body of revolution about z: x is the height, so that the radius may depend on it."""

    def half(h, y):
        return np.sqrt(max(radius(h) ** 2 - y * y, 0.0))

    return low, high, lambda h: -radius(h), radius, lambda h, y: -half(h, y), half


X_TO_Z = Rotation.from_euler("y", -np.pi / 2).as_matrix()  # the quadrature's x is the solid's z


def of_revolution(radius, low: float, high: float) -> Numbers:
    volume, c, tensor = integrated(round_bounds(radius, low, high))
    return volume, X_TO_Z @ c, X_TO_Z @ tensor @ X_TO_Z.T


def box(a: float, b: float, c: float) -> Numbers:
    return integrated((-a / 2, a / 2, -b / 2, b / 2, -c / 2, c / 2))


def ellipsoid(a: float, b: float, c: float) -> Numbers:
    def y(x):
        return b * np.sqrt(max(1 - (x / a) ** 2, 0.0))

    def z(x, y):
        return c * np.sqrt(max(1 - (x / a) ** 2 - (y / b) ** 2, 0.0))

    return integrated((-a, a, lambda x: -y(x), y, lambda x, y: -z(x, y), z))


def tube(outer: float, inner: float, length: float) -> Numbers:
    full, hole = (of_revolution(lambda h, r=r: r, -length / 2, length / 2) for r in (outer, inner))
    return full[0] - hole[0], full[1], full[2] - hole[2]


CASES = [
    ({"type": "box", "size": (0.3, 0.5, 0.7)}, lambda: box(0.3, 0.5, 0.7)),
    ({"type": "cylinder", "radius": 0.2, "length": 0.9}, lambda: of_revolution(lambda h: 0.2, -0.45, 0.45)),
    ({"type": "tube", "outer_radius": 0.4, "inner_radius": 0.3, "length": 0.5}, lambda: tube(0.4, 0.3, 0.5)),
    ({"type": "cone", "radius": 0.4, "length": 1.1}, lambda: of_revolution(lambda h: 0.4 * (1 - h / 1.1), 0, 1.1)),
    ({"type": "sphere", "radius": 0.6}, lambda: ellipsoid(0.6, 0.6, 0.6)),
    ({"type": "ellipsoid", "semi_axes": (0.3, 0.4, 0.5)}, lambda: ellipsoid(0.3, 0.4, 0.5)),
]


@pytest.mark.parametrize(("solid", "reference"), CASES, ids=lambda x: x["type"] if isinstance(x, dict) else "")
@pytest.mark.parametrize("way", ["density", "mass"])
def test_a_solid_has_the_integrals_of_its_density(solid: dict, reference, way: str) -> None:
    volume, c, tensor = reference()
    amount = 7.0 if way == "density" else 7.0 * volume
    mass, com, inertia = body_of(one(solids=[{**solid, way: amount}]))
    assert mass == pytest.approx(7.0 * volume, rel=1e-7)
    np.testing.assert_allclose(com, c, atol=1e-7)
    np.testing.assert_allclose(inertia, 7.0 * tensor, atol=1e-7 * np.abs(tensor).max() * 7)


def test_placement_turns_and_shifts_like_numpy() -> None:
    """Two solids, one turned by rpy and laid along an axis, one a hole, and a point; R from SciPy."""
    at, rpy = np.array([0.3, -0.2, 0.5]), np.array([0.4, -0.7, 1.1])
    solids = [
        {"type": "box", "size": (0.5, 0.6, 0.7), "density": 100, "at": at, "rpy": rpy},
        {"type": "cylinder", "radius": 0.05, "length": 0.2, "density": 100, "axis": "x", "at": at, "subtract": True},
    ]
    given = [{"mass": 0.8, "at": (1, 2, 3)}]
    mass, com, inertia = body_of(one(solids=solids, points=given))
    m = np.array([100 * 0.5 * 0.6 * 0.7, -100 * np.pi * 0.05**2 * 0.2, 0.8])
    c = np.array([at, at, [1, 2, 3]])
    turn = Rotation.from_euler("xyz", rpy).as_matrix()
    a, b, d = np.array([0.5, 0.6, 0.7]) ** 2 / 12
    along, across = 0.05**2 / 2, 0.05**2 / 4 + 0.2**2 / 12
    own = [m[0] * turn @ np.diag([b + d, a + d, a + b]) @ turn.T, m[1] * np.diag([along, across, across]), 0.0]
    centre = m @ c / m.sum()
    total = sum(i + k * (x @ x * np.eye(3) - np.outer(x, x)) for i, k, x in zip(own, m, c - centre, strict=True))
    assert mass == pytest.approx(m.sum())
    np.testing.assert_allclose(com, centre, rtol=1e-13)
    np.testing.assert_allclose(inertia, total, atol=1e-13 * np.abs(total).max())


def written(path: Path, mesh) -> str:
    mesh.export(path)
    return str(path)


@pytest.mark.parametrize("ascii_file", [False, True])
def test_a_mesh_equals_the_solid_it_bounds(tmp_path: Path, ascii_file: bool) -> None:
    mesh = trimesh.creation.box((300.0, 500.0, 700.0))
    mesh.apply_translation((100.0, 0.0, 0.0))
    path = tmp_path / "part.stl"
    mesh.export(path, "stl_ascii" if ascii_file else "stl")
    place = {"at": (0.1, 0.2, 0.3), "rpy": (0.3, 0.2, 0.1)}
    m = one(solids=[{"type": "mesh", "file": path, "density": 8.0, "scale": 0.001, **place}])
    turn = Rotation.from_euler("xyz", place["rpy"]).as_matrix()
    at = np.array(place["at"]) + turn @ [0.1, 0, 0]
    same = one(solids=[{"type": "box", "size": (0.3, 0.5, 0.7), "density": 8.0, "at": at, "rpy": place["rpy"]}])
    for a, b in zip(body_of(m), body_of(same), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-8)


def test_a_model_file_finds_its_mesh_beside_it(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    written(tmp_path / "parts" / "ball.stl", trimesh.creation.icosphere(subdivisions=4, radius=0.5))
    text = """
name: ball
parameters: {rho: 700, s: 1}
bodies:
  b: {solids: [{type: mesh, file: FILE, density: rho, scale: s}]}
joints: {J: {type: free, between: [ground, b]}}
"""
    model = tmp_path / "ball.yaml"
    model.write_text(text.replace("FILE", "parts/ball.stl"))
    mass, _, inertia = body_of(eg.load(model))
    exact = 700 * 4 / 3 * np.pi * 0.5**3
    assert mass == pytest.approx(exact, rel=0.01)
    np.testing.assert_allclose(inertia, 0.4 * exact * 0.25 * np.eye(3), rtol=0.01, atol=1e-4 * exact)
    assert body_of(eg.load(model), {"s": 2.0})[2][0, 0] == pytest.approx(32 * inertia[0, 0], rel=1e-12)
    again = tmp_path / "again.yaml"
    again.write_text(eg.load(model).to_yaml())
    assert body_of(eg.load(again))[0] == mass
    outside = written(tmp_path.parent / "outside.stl", trimesh.creation.box((1, 1, 1)))
    for file in ("../outside.stl", outside):
        model.write_text(text.replace("FILE", str(file)))
        with refused("EG-FILE bodies.b.solids[0].file ball.yaml 5"):
            eg.load(model).check()


def broken(tmp_path: Path, what: str) -> Path:
    mesh = trimesh.creation.box((1, 1, 1))
    path = tmp_path / f"{what}.stl"
    if what == "open":
        mesh.update_faces(np.arange(len(mesh.faces)) > 0)
    elif what == "inwards":
        mesh.faces = mesh.faces[:, ::-1]
    elif what == "mixed":
        mesh.faces = np.vstack([mesh.faces[:1, ::-1], mesh.faces[1:]])
    elif what == "text":
        path.write_text("no mesh at all")
        return path
    elif what == "missing":
        return path
    written(path, mesh)
    return path


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("open", "EG-FILE-DAMAGED bodies.b.solids[0].file holes"),
        ("inwards", "EG-FILE-DAMAGED bodies.b.solids[0].file inside"),
        ("mixed", "EG-FILE-DAMAGED bodies.b.solids[0].file opposite"),
        ("text", "EG-FILE-DAMAGED bodies.b.solids[0].file"),
        ("missing", "EG-FILE bodies.b.solids[0].file"),
    ],
)
def test_meshes_that_bound_no_solid_are_refused(tmp_path: Path, what: str, message: str) -> None:
    refuses(message, lambda: one(solids=[{"type": "mesh", "file": str(broken(tmp_path, what)), "density": 1}]).check())


@pytest.mark.parametrize(
    ("solid", "demand"),
    [
        ({"type": "ball", "radius": 1, "mass": 1}, "EG-CHOICE solids[0].type: 'ball'"),
        ({"type": "sphere", "radius": 1}, "EG-CONFLICT solids[0]: neither"),
        ({"type": "sphere", "radius": 1, "mass": 1, "density": 1}, "EG-CONFLICT solids[0]: both"),
        ({"type": "sphere", "radius": -1, "mass": 1}, "EG-RANGE solids[0].radius: -1"),
        ({"type": "sphere", "radius": 1, "mass": 1, "axis": "x"}, "EG-NAME-UNKNOWN solids[0].axis: 'axes'?"),
        ({"type": "tube", "outer_radius": 1, "inner_radius": 2, "length": 1, "mass": 1}, "EG-RANGE inner_radius: 2 1"),
    ],
    ids=str,
)
def test_faults_of_solids(solid: object, demand: str) -> None:
    refuses(demand, lambda: one(solids=[solid]).check())
