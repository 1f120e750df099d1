"""Mesh files of bodies in pictures: read as trimesh reads them, in their place, thinned out; what cannot be is told."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as pyplot
import numpy as np
import pytest
import trimesh

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.show.build_scene import build_scene
from eomgen.show.mesh_files import TRIANGLES, read_mesh

matplotlib.use("agg")
KINDS = ("stl", "stl_ascii", "obj")


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    pyplot.close("all")


def write(folder: Path, kind: str, mesh: Any, name: str = "part") -> Path:
    path = folder / f"{name}.{kind[:3]}"
    mesh.export(path, file_type=kind)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_is_read_as_trimesh_reads_it(kind: str, tmp_path: Path) -> None:
    mesh = trimesh.creation.annulus(0.2, 0.5, 0.3)
    vertices, faces = read_mesh(str(write(tmp_path, kind, mesh)))
    found = trimesh.Trimesh(vertices, faces)
    assert found.is_watertight
    assert len(faces) == len(mesh.faces)
    assert found.volume == pytest.approx(mesh.volume, rel=1e-5)
    assert found.moment_inertia == pytest.approx(mesh.moment_inertia, rel=1e-4, abs=1e-6)


def test_faces_of_an_obj_file_may_have_many_corners_and_count_backwards(tmp_path: Path) -> None:
    path = tmp_path / "quad.obj"
    path.write_text("# a square and a triangle\nv 0 0 0\nv 1 0 0\nvn 0 0 1\nv 1 1 0\nv 0 1 0\nf 1//1 2//1 3//1 4//1\n"
                    "v 0 0 2\nf -1 -5 -4\n")  # fmt: skip
    vertices, faces = read_mesh(str(path))
    corners = {frozenset(map(tuple, vertices[one].tolist())) for one in faces}
    a, b, c, d, e = (0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 2)
    assert corners == {frozenset((a, b, c)), frozenset((a, c, d)), frozenset((e, a, b))}


def test_a_fine_mesh_is_thinned_out_and_keeps_its_shape(tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=0.4)
    assert len(mesh.faces) > 80_000
    vertices, faces = read_mesh(str(write(tmp_path, "stl", mesh)))
    assert 500 < len(faces) <= TRIANGLES
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(0.4, rel=0.05)
    assert trimesh.Trimesh(vertices, faces).volume == pytest.approx(mesh.volume, rel=0.05)


MODEL = """\
name: lever
gravity: [0, 0, -9.81]
bodies:
  arm:
    mass: 2
    com: [0.3, 0, 0]
    inertia: [0.01, 0.02, 0.02]
    display:
      - {shape: mesh, file: shapes/part.stl, scale: [0.001, 0.001, 0.001], at: [0.3, 0, 0], rpy: [0, pi/2, 0]}
joints:
  A: {type: revolute, between: [ground, arm], axis: y, coordinate: theta}
initial: {theta: 0.2}
"""


def test_a_mesh_is_drawn_in_its_place_on_page_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "shapes").mkdir()
    write(tmp_path / "shapes", "stl", trimesh.creation.cylinder(radius=40.0, height=600.0))  # in millimetres
    (tmp_path / "lever.yaml").write_text(MODEL)
    module = eg.load(tmp_path / "lever.yaml").compile(target="numpy")
    monkeypatch.chdir("/")  # the folder of the model file counts
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = build_scene(module, np.array([[0.0]]))
        module.draw().figure.canvas.draw()
    (shape,) = [item for item in scene.items if item.role == "shape"]
    points = shape.at(scene.frames[0])
    assert points.min(axis=0) == pytest.approx([0.0, -0.04, -0.04], abs=1e-3)  # z of the file lies along x
    assert points.max(axis=0) == pytest.approx([0.6, 0.04, 0.04], abs=1e-3)
    page = str(module.simulate(0.5).animate(fps=4))
    assert len(page) > 100_000
    assert not [item for item in scene.items if (item.role, item.name) == ("link", "arm")]


def test_the_mesh_of_a_solid_is_drawn_too(tmp_path: Path) -> None:
    m = eg.Model("block", gravity=(0, -9.81, 0))
    path = write(tmp_path, "stl", trimesh.creation.box((0.4, 0.2, 0.1)))
    m.body("block", solids=[{"type": "mesh", "file": str(path), "density": 1000.0}])
    m.revolute("A", m.ground, "block", coordinate="theta")
    mod = m.compile(target="numpy")
    scene = build_scene(mod, np.array([[0.0]]))
    (shape,) = [item for item in scene.items if item.role == "shape"]
    assert np.ptp(shape.points, axis=0) == pytest.approx([0.4, 0.2, 0.1], abs=1e-6)
    mod.draw().figure.canvas.draw()


def test_a_ring_in_a_plane_has_its_hole(tmp_path: Path) -> None:
    m = eg.Model("ring", gravity=(0, -9.81, 0))
    path = write(tmp_path, "stl", trimesh.creation.annulus(0.2, 0.5, 0.1))
    shapes = [{"shape": "mesh", "file": str(path)}]
    m.revolute("A", m.ground, m.body("ring", mass=1.0, inertia={"zz": 1.0}, display=shapes), coordinate="theta")
    ax = m.compile(target="numpy").draw()
    (mesh,) = ax.collections
    assert not any(path.contains_point((0.1, 0.0)) for path in mesh.get_paths())
    assert any(path.contains_point((0.351, 0.002)) for path in mesh.get_paths())


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("part.ply", b"ply", "STL, OBJ and DAE files can be drawn"),
        ("part.stl", None, "No such file"),
        ("part.stl", b"no mesh at all", "it holds no triangles"),
        ("part.stl", b"solid a\nvertex 0 0 zero\n", "cannot be read as a file .stl"),
        ("part.stl", b"solid a\n" + b"vertex 0 0 nan\n" * 3, "not finite"),
        ("part.obj", b"v 0 0 0\nf 1 2 3\n", "name vertices that it does not have"),
        ("part.obj", b"v 0 0\nv 1\nf 1 2 1\n", "cannot be read as a file .obj"),
        ("../part.stl", b"", "outside the folder of the model file"),
    ],
)
def test_what_cannot_be_drawn_is_told_and_left_out(name: str, data: bytes | None, why: str, tmp_path: Path) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    if data is not None:
        (folder / name).write_bytes(data)
    (folder / "lever.yaml").write_text(MODEL.replace("shapes/part.stl", name))
    module = eg.load(folder / "lever.yaml").compile(target="numpy")
    with pytest.warns(UserWarning, match=f"the mesh '{name}' of arm is not drawn: .*{why}"):
        ax = module.draw()
    ax.figure.canvas.draw()
    scene_roles = {item.role for item in build_scene_quietly(module).items}
    assert "link" in scene_roles  # a bar in its place


def build_scene_quietly(module: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return build_scene(module, np.array([[0.0]]))


def test_meshes_of_a_robot_lie_beside_its_file(tmp_path: Path) -> None:
    write(tmp_path, "stl", trimesh.creation.box((0.4, 0.2, 0.1)))
    visual = '<visual><geometry><mesh filename="package://robot/part.stl"/></geometry></visual>'
    (tmp_path / "robot.urdf").write_text(
        '<robot name="robot"><link name="base"/><link name="arm"><inertial><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
        f'{visual}</link><joint name="j" type="continuous"><parent link="base"/><child link="arm"/>'
        '<axis xyz="0 0 1"/></joint></robot>'
    )
    module = eg.load(tmp_path / "robot.urdf").compile(target="numpy")
    scene = build_scene(module, np.array([[0.0]]))
    (shape,) = [item for item in scene.items if item.role == "shape"]
    assert np.ptp(shape.points, axis=0) == pytest.approx([0.4, 0.2, 0.1], abs=1e-6)


def test_a_notebook_shows_a_model_without_a_warning(tmp_path: Path) -> None:
    (tmp_path / "lever.yaml").write_text(MODEL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "data:image/png" in eg.load(tmp_path / "lever.yaml").compile(target="numpy")._repr_html_()


def test_too_large_files_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from eomgen.show import mesh_files

    monkeypatch.setattr(mesh_files, "MESH", 100)
    path = write(tmp_path, "stl", trimesh.creation.box((1, 1, 1)))
    with pytest.raises(UsageError, match="bytes; at most 100"):
        read_mesh(str(path))


def test_a_collada_file_is_read_in_metres(tmp_path: Path) -> None:
    pytest.importorskip("collada")
    mesh = trimesh.creation.annulus(0.2, 0.5, 0.3)
    data = trimesh.exchange.dae.export_collada(mesh)
    path = tmp_path / "part.dae"
    path.write_bytes(data.replace(b"<asset>", b'<asset><unit name="cm" meter="0.01"/>'))
    found = trimesh.Trimesh(*read_mesh(str(path)))
    assert found.volume == pytest.approx(1e-6 * mesh.volume, rel=1e-5)
    path.write_bytes(b'<!DOCTYPE x [<!ENTITY e "e">]>' + data)
    with pytest.raises(UsageError, match="declares a document type"):
        read_mesh(str(path))
    path.write_bytes(data[:500])
    with pytest.raises(UsageError, match="cannot be read as a file .dae"):
        read_mesh(str(path))


def test_shapes_of_urdf_have_the_colors_of_their_materials(tmp_path: Path) -> None:
    visual = '<visual><geometry><box size="0.1 0.1 0.4"/></geometry><material name="{}">{}</material></visual>'
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(
        f'<link name="{name}">{inertial}{visual.format(*given)}</link>'
        for name, given in (("a", ("steel", "")), ("b", ("", '<color rgba="1 0.5 0 1"/>')), ("c", ("lost", "")))
    )
    joints = "".join(
        f'<joint name="j{name}" type="continuous"><parent link="base"/><child link="{name}"/></joint>' for name in "abc"
    )
    path = tmp_path / "painted.urdf"
    steel = '<material name="steel"><color rgba="0.2 0.4 1.0 1"/></material>'
    path.write_text(f'<robot name="painted"><link name="base"/>{links}{joints}{steel}</robot>')
    eg.load(path).save(tmp_path / "painted.yaml")
    for model in (eg.load(path), eg.load(tmp_path / "painted.yaml")):
        module = model.compile(target="numpy")
        scene = build_scene(module, module.x0()[: module.n_q, None])
        assert {item.name: item.color for item in scene.items if item.role == "shape"} == {
            "a": "#3366ff",
            "b": "#ff8000",
            "c": "",
        }
    wrong = (tmp_path / "painted.yaml").read_text().replace("#3366ff", "blueish")
    (tmp_path / "painted.yaml").write_text(wrong)
    with pytest.raises(eg.ModelError, match=r"display\[0\].color: 'blueish' is no color"):
        eg.load(tmp_path / "painted.yaml").check()
