"""Pictures: what is drawn lies where the poses say, true to scale, of the right kind, and what hides what."""

import base64
import importlib.util
import io
import re
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as pyplot
import nbformat
import numpy as np
import pytest
import trimesh
from children import executed
from matplotlib.path import Path as Line
from models import EXAMPLES
from mpl_toolkits.mplot3d.proj3d import proj_transform
from PIL import Image
from refusals import refuses
from sweeps import part_of

import eomgen as eg

matplotlib.use("agg")


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    pyplot.close("all")


def compiled(name: str) -> Any:
    return eg.load_example(name).compile(target="numpy")


@pytest.fixture(scope="module")
def module() -> Any:
    return compiled("slider_crank")


def named(ax: Any) -> dict[str, np.ndarray]:
    """Name -> the place that it points at."""
    return {text.get_text(): np.array(text.xy) for text in ax.texts}


def strokes(ax: Any) -> list[np.ndarray]:
    """All outlines and lines of a picture in a plane, without gaps."""
    found = [patch.get_path().vertices for patch in ax.patches] + [line.get_xydata() for line in ax.lines]
    parts = (part for one in found for part in np.split(one, np.flatnonzero(np.isnan(one[:, 0]))))
    return [whole for part in parts if len(whole := part[np.isfinite(part[:, 0])]) > 1]


def sizes(ax: Any) -> np.ndarray:
    """Width and height of each stroke (n, 2)."""
    return np.array([np.ptp(one, axis=0) for one in strokes(ax)])


# -- in a plane -------------------------------------------------------------------------------------------------------


def test_joints_and_springs_lie_where_the_closed_form_says(module: Any) -> None:
    for r in (0.1, 0.13):
        theta, l = 0.7, 0.35
        ax = module.bind(p={"r": r}).draw(theta=theta)
        pin = r * np.array([np.cos(theta), np.sin(theta)])
        slider = np.array([pin[0] + np.sqrt(l**2 - pin[1] ** 2), 0.0])
        places = named(ax)
        for name, place in (("A", (0, 0)), ("B", pin), ("C", slider), ("D", slider), ("rod", (pin + slider) / 2)):
            assert places[name] == pytest.approx(place, abs=1e-12)
        rings = [one for one in strokes(ax) if len(one) == 21]
        for place in ((0, 0), pin, slider):  # the symbols of hinges
            assert any((one.min(axis=0) + one.max(axis=0)) / 2 == pytest.approx(place, abs=1e-9) for one in rings)
        (coil,) = [line.get_xydata() for line in ax.lines if len(line.get_xdata()) > 80]
        assert coil[0] == pytest.approx([0.5, 0])
        assert coil[-1] == pytest.approx(slider)
    assert ax.get_aspect() == 1.0
    assert not hasattr(ax, "get_zlim")


def test_values_may_be_a_state_a_mapping_or_keywords(module: Any) -> None:
    def corners(*args: Any, **how: Any) -> list[Any]:
        return [np.asarray(patch.get_xy()).round(9).tolist() for patch in module.draw(*args, **how).patches]

    given = corners(theta=0.7)
    assert given == corners({"theta": 0.7}) == corners({"theta": 0.1}, theta="0.7") != corners()
    assert given == corners(module.x0(theta=0.7)) == corners(module.x0(theta=0.7)[: module.n_q])
    assert eg.load_example("slider_crank").draw(theta=0.7, names=False).get_title() == "slider_crank"
    for values, said in (
        ({"thata": 0.7}, "EG-NAME-UNKNOWN theta?"),
        ({"x": np.zeros(5)}, "EG-SHAPE (5,)"),
        ({"x": np.full(module.n_q, np.nan)}, "EG-NUMBER finite"),
        ({"x": np.zeros(module.n_q), "theta": 0.7}, "EG-CONFLICT either"),
        ({"ax": matplotlib.figure.Figure().add_subplot(projection="3d")}, "EG-TYPE axes"),
    ):
        refuses(said, module.draw, **values)
    m = eg.Model.from_lagrangian("oscillator", "q_dot**2/2 - q**2/2", ["q"])
    refuses("EG-UNSUPPORTED oscillator", lambda: m.compile(target="numpy").draw())


def test_what_stands_on_given_axes_stays_visible(module: Any) -> None:
    ax = pyplot.figure().add_subplot()
    ax.plot([-2.0, 0.1], [0.0, 1.5])
    ax.set(title="mine", xlabel="way (m)")
    module.draw(ax=ax)
    assert ax.get_xlim()[0] <= -2.0
    assert ax.get_ylim()[1] >= 1.5
    assert ax.get_xlim()[1] >= 0.44
    assert (ax.get_aspect(), ax.get_title(), ax.get_xlabel()) == (1.0, "mine", "way (m)")


PLANE = ("slider_crank", "four_bar", "cart_pendulum", "chebyshev", "planetary_gear", "cam_follower", "hydraulic_boom")
SPACE = ("stewart_platform", "furuta_pendulum", "bicycle", "double_wishbone", "satellite")
NAMES = sorted(file.stem for file in EXAMPLES.glob("*.yaml"))


@pytest.mark.parametrize("name", part_of(NAMES, (*PLANE[:5], *SPACE[:3]).__contains__))
def test_every_example_is_drawn_in_its_page_with_names_side_by_side(name: str) -> None:
    ax = compiled(name).draw()
    ax.figure.canvas.draw()
    width, height = ax.figure.canvas.get_width_height()
    if hasattr(ax, "get_zlim"):
        size = np.array([np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())])
        assert size / size[0] == pytest.approx(np.asarray(ax._box_aspect) / ax._box_aspect[0], rel=1e-9)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):  # its name is not cut off
            box = axis.label.get_window_extent()
            assert min(box.x0, box.y0, width - box.x1, height - box.y1) >= 0.0
    else:
        for one in strokes(ax):
            low, high = one.min(axis=0), one.max(axis=0)
            assert (low >= [min(ax.get_xlim()), min(ax.get_ylim())]).all()
            assert (high <= [max(ax.get_xlim()), max(ax.get_ylim())]).all()
        assert len(strokes(ax)) > 5
    if name in PLANE[:4]:
        boxes = {text.get_text(): text.get_bbox_patch().get_window_extent() for text in ax.texts}
        assert len(boxes) > 2
        bars = [Line(ax.transData.transform(p.get_path().vertices)) for p in ax.patches if len(p.get_path()) == 25]
        for text, box in boxes.items():
            assert not any(box.overlaps(other) for word, other in boxes.items() if word != text)
            assert name == "four_bar" or not any(bar.intersects_bbox(box, filled=True) for bar in bars)  # a plate


def test_gears_touch_and_a_load_hangs_on_its_drum() -> None:
    """30, 30 and 90 teeth on a carrier of 60 mm: diameters 60, 60 and 180 mm; the drum of the rope has 80 mm."""
    found = sizes(compiled("planetary_gear").draw())
    for diameter, count in ((0.06, 3), (0.18, 1), (0.08, 1)):
        assert np.isclose(found, [diameter, diameter], rtol=0, atol=1e-6).all(axis=1).sum() >= count


@pytest.mark.parametrize("crossed", [False, True])
def test_pulleys_are_drawn_with_the_radii_that_are_given(crossed: bool) -> None:
    m = eg.Model("belt")
    first, second = (m.body(name, mass=1, inertia={"zz": 0.01}) for name in ("first", "second"))
    m.revolute("A", m.ground, first, coordinate="a")
    m.revolute("B", m.ground.at(0.4, 0, 0), second, coordinate="b")
    r = m.parameter("r", 0.06)
    m.belt("belt", "A", "B", radii=[r, "r + 0.04"], crossed=crossed)
    ax = m.compile(target="numpy").draw(a=0.3)
    for centre, radius in ((0, 0.06), (0.4, 0.1)):
        rims = [np.hypot(one[:, 0] - centre, one[:, 1]) for one in strokes(ax)]
        assert any(len(rim) > 20 and rim == pytest.approx(radius, rel=0.01) for rim in rims)


def test_given_forces_torques_and_stops_are_to_be_seen() -> None:
    """Arrows end where forces act, in their direction; walls stand at the limits of a slide."""
    m = eg.Model("pushed", gravity=(0, -9.81, 0))
    arm, slider = m.body("arm", mass=1, com=(0.25, 0, 0), inertia={"zz": 0.02}), m.body("slider", mass=1)
    m.revolute("A", m.ground, arm, coordinate="a")
    m.prismatic("D", m.ground.at(0, -0.3, 0), slider, axis="x", coordinate="s")
    m.force("down", arm.at(0.4, 0, 0), (0, -3, 0))
    m.force("along", arm.at(0.4, 0, 0), ("sin(t)", 0, 0), axes="body")
    m.stop("end", "s", lower=-0.1, upper=0.3, stiffness=100)
    found = strokes(m.compile(target="numpy").draw(a=0.3, s=0.1))
    place = 0.4 * np.array([np.cos(0.3), np.sin(0.3)])
    for way in (np.array([0, -1]), place / 0.4):
        tails = [one[0] - one[1] for one in found if len(one) > 1 and one[1] == pytest.approx(place, abs=1e-9)]
        assert any(-tail / np.linalg.norm(tail) == pytest.approx(way, abs=1e-9) for tail in tails)
    for wall in (-0.1, 0.3):
        assert any(np.ptp(one[:, 0]) < 1e-9 and one[0, 0] == pytest.approx(wall) for one in found)


@pytest.mark.parametrize("swings", [False, True])
@pytest.mark.parametrize("turns", [True, False])
def test_the_curve_of_a_lift_goes_through_the_follower_at_every_position_of_the_cam(turns: bool, swings: bool) -> None:
    m = eg.Model("lift", gravity=(0, -9.81, 0))
    cam = m.body("cam", mass=1, inertia={"zz": 0.01})
    follower = m.body("follower", mass=0.2, com=(0.05, 0, 0) if swings else None, inertia={"zz": 1e-3})
    follower.marker("tip", at=(0.1, 0, 0) if swings else (0, 0, 0))
    (m.revolute if turns else m.prismatic)("C", m.ground, cam, coordinate="c", **({} if turns else {"axis": "x"}))
    if swings:
        m.revolute("F", m.ground.at(-0.09, 0.05, 0), follower, coordinate="f")
    else:
        m.prismatic("F", m.ground, follower, axis="y", coordinate="f")
    rise = "0.01*(1 - cos(theta)) + 0.004*sin(3*theta)" if turns else "0.01*sin(30*theta)"
    lift = f"{'-0.1 + 4*' if swings else '0.05 + '}({rise})"
    m.cam("law", cam="C", follower="F", lift=lift, phase=0.3 if turns else 0)
    mod = m.compile(target="numpy")
    for c in (0.0, 0.8, 2.5, 5.0) if turns else (-0.02, 0.0, 0.03):
        curve = max(strokes(mod.draw(c=c)), key=len)
        assert len(curve) > 100
        pose = mod.poses(mod.x0(c=c)[: mod.n_q])[mod.body_names.index("follower")]
        tip = (pose[:3, :3] @ [0.1 if swings else 0.0, 0, 0] + pose[:3, 3])[:2]
        starts, ways = curve[:-1], np.diff(curve, axis=0)
        part = np.clip(((tip - starts) * ways).sum(axis=1) / (ways**2).sum(axis=1), 0.0, 1.0)
        assert np.linalg.norm(starts + part[:, None] * ways - tip, axis=1).min() < 1e-3 * 0.05  # the sag of a chord


@pytest.mark.parametrize("law", [{"support": "0.04 + 0.008*cos(theta)"}, {"contour": "law(theta)"}])
def test_a_flat_face_lies_on_the_highest_point_of_its_cam(law: dict[str, str]) -> None:
    """Also where the contour is a table."""
    m, t = eg.Model("tappet", gravity=(0, -9.81, 0)), np.linspace(0.0, 2.0 * np.pi, 241)
    m.table("law", t, 0.04 + 0.006 * np.cos(t), kind="periodic")
    cam, follower = m.body("cam", mass=1, inertia={"zz": 0.01}), m.body("follower", mass=0.2)
    m.revolute("C", m.ground, cam, coordinate="phi")
    m.prismatic("F", m.ground, follower, axis="y", coordinate="y")
    m.cam_contact("touch", cam=cam, follower=follower.at(rpy=("-pi/2", 0, 0)), shape="flat_face", **law)
    mod = m.compile(target="numpy")
    for phi in (0.0, 0.8, 2.5):
        found = strokes(mod.draw(mod.assemble(phi=phi, y=0.05)))
        contour = max(found, key=len)
        top = contour[np.argmax(contour[:, 1])]
        flat = [one for one in found if np.ptp(one[:, 1]) < 1e-9 and one[0, 1] == pytest.approx(top[1], abs=4e-5)]
        assert any(one[:, 0].min() < top[0] < one[:, 0].max() for one in flat)


@pytest.mark.parametrize("shape", ["star", "bracket"])
def test_bodies_with_hollow_outlines_show_their_hollows(shape: str) -> None:
    turns = -np.pi * np.arange(10) / 5
    star = np.column_stack([np.cos(turns), np.sin(turns)]) * np.where(np.arange(10) % 2, 0.2, 0.5)[:, None]
    bracket = [(0, 0), (0, 1), (1, 1), (1, 0.8), (0.2, 0.8), (0.2, 0.2), (1, 0.2), (1, 0)]
    points = star.tolist() if shape == "star" else bracket
    m = eg.Model("hollow", gravity=(0, -9.81, 0))
    body = m.body("star", mass=1.0, inertia={"zz": 0.1})
    m.planar("j", m.ground, body)
    outline = {"shape": "outline", "on": body, "points": points}
    m.contacts("floor", outline, {"shape": "half_plane", "on": m.ground.at(0, -1, 0)}, {"stiffness": 1e5})
    ax = m.compile(target="numpy").draw()
    filled = [path for one in ax.collections for path in one.get_paths()] + [patch.get_path() for patch in ax.patches]
    grid = np.mean(points, axis=0) + np.random.default_rng(1).uniform(-0.6, 0.6, (4000, 2))
    seen = np.any([path.contains_points(grid) for path in filled], axis=0)
    assert (seen == Line(np.array(points)).contains_points(grid)).mean() > 0.985


def test_branches_are_drawn_side_by_side_and_named_by_what_differs() -> None:
    module = compiled("four_bar")
    panels = module.draw_branches()
    titles = [ax.get_title() for ax in panels]
    assert len(panels) == len(module.branches({})) == len(set(titles)) == 2
    assert panels[0].get_xlim() == panels[1].get_xlim()
    for q, title in zip(module.branches({}), titles, strict=True):
        for part in title.splitlines()[1].split(", "):
            name, _, value = part.partition(" = ")
            assert q[module.q_names.index(name)] == pytest.approx(float(value), rel=5e-3)


# -- in space ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gravity", [(0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)])
def test_a_picture_in_space_has_one_scale_and_right_hands(gravity: tuple[int, int, int]) -> None:
    """Seen without perspective, three equal axes at right angles give three columns with J J^T = s^2 I (Gauss)."""
    m = eg.Model("flight", gravity=gravity)
    body = m.body("body", mass=1, inertia=(1, 1, 1), display=[{"shape": "box", "size": (3, 1, 0.4)}])
    m.free("fly", m.ground, body)
    ax = m.compile(target="numpy").draw({"fly_x": 2.0, "fly_y": 0.5})
    ax.set_proj_type("ortho")
    ax.figure.canvas.draw()
    low = np.array([ax.get_xlim3d()[0], ax.get_ylim3d()[0], ax.get_zlim3d()[0]])

    def page(point: np.ndarray) -> np.ndarray:
        return np.array(ax.transData.transform(proj_transform(*point, ax.get_proj())[:2]))

    J = np.column_stack([page(low + step) - page(low) for step in np.eye(3)])
    assert pytest.approx(np.eye(2), abs=1e-3) == 2.0 * J @ J.T / np.trace(J @ J.T)
    up = -np.array(gravity, dtype=float)
    assert J[1] @ up > 0.0  # what falls falls on the page
    assert np.cross(J[0], J[1]) @ up > 0.0  # from above, of right hands: right x up points at the reader


def seen(ax: Any, point: tuple[float, float, float]) -> np.ndarray:
    """The colour at the place of a point."""
    ax.figure.canvas.draw()
    image = np.asarray(ax.figure.canvas.buffer_rgba()).astype(int)
    x, y = ax.transData.transform(proj_transform(*point, ax.get_proj())[:2])
    return image[int(len(image) - y), int(x), :3]


@pytest.mark.parametrize("shape", [{"shape": "box", "size": (0.1, 1, 1)}, {"shape": "sphere", "radius": 0.4}])
def test_what_lies_in_front_hides_what_lies_behind(shape: dict[str, Any]) -> None:
    """Red stands at x = 0.5, blue at -0.5, green beside both; seen from all round."""
    m = eg.Model("blocks", gravity=(0, 0, -9.81))
    for k, (x, y, color) in enumerate(((0.5, 0, "#ff0000"), (-0.5, 0, "#0000ff"), (0, 2, "#00ff00"))):
        shown = [{**shape, "at": (x, y, 0), "color": color}]
        m.free(f"fly{k}", m.ground, m.body(f"b{k}", mass=1, inertia=(1, 1, 1), display=shown))
    ax = m.compile(target="numpy").draw(names=False)
    for elevation in (0, 15):
        for azimuth in (0, 188):
            ax.view_init(elevation, azimuth)
            assert np.argmax(seen(ax, (0, 0, 0))) == (0 if azimuth < 90 else 2)
            assert np.argmax(seen(ax, (0, 2, 0))) == 1


# -- mesh files -------------------------------------------------------------------------------------------------------

MODEL = """\
name: lever
gravity: [0, -9.81, 0]
bodies:
  arm: {mass: 2, com: [0.3, 0, 0], inertia: [0.01, 0.02, 0.02],
    display: [{shape: mesh, file: part.stl, scale: [0.001, 0.001, 0.001], at: [0.3, 0, 0], rpy: [0, pi/2, 0]}]}
joints:
  A: {type: revolute, between: [ground, arm], axis: z, coordinate: theta}
"""


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "dae"])
def test_a_mesh_is_drawn_in_its_place(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = trimesh.creation.cylinder(radius=40.0, height=600.0)  # in millimetres; z of the file lies along x
    file = tmp_path / f"part.{kind[:3]}"
    if kind == "dae":
        pytest.importorskip("collada")
        file.write_bytes(trimesh.exchange.dae.export_collada(mesh))
    else:
        mesh.export(file, file_type=kind)
    (tmp_path / "lever.yaml").write_text(MODEL.replace("part.stl", file.name))
    module = eg.load(tmp_path / "lever.yaml").compile(target="numpy")
    monkeypatch.chdir("/")  # the folder of the model file counts
    ax = module.draw(theta=0.0)
    points = np.vstack([path.vertices for one in ax.collections for path in one.get_paths()])
    assert points.min(axis=0) == pytest.approx([0.0, -0.04], abs=1e-3)
    assert points.max(axis=0) == pytest.approx([0.6, 0.04], abs=1e-3)
    assert "data:image/png" in module._repr_html_()


def test_a_ring_has_its_hole_and_a_fine_mesh_is_thinned_out(tmp_path: Path) -> None:
    for name, mesh in (
        ("ring", trimesh.creation.annulus(0.2, 0.5, 0.1)),
        ("ball", trimesh.creation.icosphere(subdivisions=6, radius=0.4)),
    ):
        mesh.export(tmp_path / f"{name}.stl")
        m = eg.Model(name, gravity=(0, -9.81, 0))
        shapes = [{"shape": "mesh", "file": str(tmp_path / f"{name}.stl")}]
        m.revolute("A", m.ground, m.body("part", mass=1.0, inertia={"zz": 1.0}, display=shapes), coordinate="theta")
        ax = m.compile(target="numpy").draw()
        paths = [path for one in ax.collections for path in one.get_paths()]
        assert any(path.contains_point((0.351, 0.002)) for path in paths)
        assert any(path.contains_point((0.1, 0.0)) for path in paths) == (name == "ball")
        assert len(paths) < 20_000  # of 80,000


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("part.ply", b"ply", "STL, OBJ and DAE files can be drawn"),
        ("part.stl", None, "No such file"),
        ("part.stl", b"no mesh at all", "it holds no triangles"),
        ("part.stl", b"solid a\n" + b"vertex 0 0 nan\n" * 3, "vertices that are not finite"),
        ("part.obj", b"v 0 0 0\nf 1 2 3\n", "name vertices that it does not have"),
        ("part.dae", b'<!DOCTYPE x [<!ENTITY e "e">]>', "declares a document type"),
        ("../part.stl", b"", "outside the folder of the model file"),
    ],
)
def test_what_cannot_be_drawn_is_reported_and_left_out(name: str, data: bytes | None, why: str, tmp_path: Path) -> None:
    folder = tmp_path / "model"
    folder.mkdir()
    if data is not None:
        (folder / name).write_bytes(data)
    (folder / "lever.yaml").write_text(MODEL.replace("part.stl", name))
    module = eg.load(folder / "lever.yaml").compile(target="numpy")
    with pytest.warns(UserWarning, match=f"the mesh '{name}' of arm is not drawn: .*{why}"):
        ax = module.draw()
    assert any(size[0] > 0.2 for size in sizes(ax))  # a bar in its place


def test_shapes_of_urdf_have_the_colors_of_their_materials(tmp_path: Path) -> None:
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    visual = '<visual><geometry><box size="0.1 0.1 0.4"/></geometry><material name="steel"/></visual>'
    (tmp_path / "painted.urdf").write_text(
        f'<robot name="painted"><link name="base"/><link name="a">{inertial}{visual}</link><joint name="j" '
        'type="continuous"><parent link="base"/><child link="a"/></joint>'
        '<material name="steel"><color rgba="0.2 0.4 1.0 1"/></material></robot>'
    )
    model = eg.load(tmp_path / "painted.urdf")
    assert "#3366ff" in model.to_yaml()
    ax = model.compile(target="numpy").draw(names=False)
    red, green, blue = max((patch.get_facecolor()[:3] for patch in ax.patches), key=lambda color: color[2] - color[0])
    assert blue > green > red


# -- graphs of mechanisms ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["jansen_leg", "planetary_gear", "excavator"])
def test_names_in_the_graph_of_a_mechanism_cover_no_other(name: str) -> None:
    ax = eg.load_example(name).check().draw()
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not [(a, b) for k, a in enumerate(boxes) for b in boxes[:k] if a.overlaps(b)]


# -- notebooks --------------------------------------------------------------------------------------------------------


def pictures(html: str) -> list[Any]:
    """Images in a text, opened."""
    found = re.findall(r"src='data:image/(?:png|gif);base64,([^']+)'", html)
    return [Image.open(io.BytesIO(base64.b64decode(one))) for one in found]


def test_models_modules_reports_and_results_show_themselves(module: Any) -> None:
    model, run = eg.load_example("slider_crank"), module.simulate(0.1)
    motion = module.kinematic_analysis(theta=np.linspace(0.0, 1.0, 5))
    many = module.simulate_many(0.1, parameters={"r": [0.08, 0.1, 0.12]}, t_eval=[0.0, 0.1])
    for one in (model, module, model.check(), run, motion, many):
        (image,) = pictures(one._repr_html_())
        assert len(image.convert("RGB").getcolors(1 << 24)) > 20
    assert "rhs(t, x)" in module._repr_html_()
    assert "0 .. 0.1 s" in run._repr_html_()
    assert f"<td>{np.mean(many['theta'][-1]):.5g}</td>" in many._repr_html_()
    m = eg.Model("open")
    m.parameter("m")
    m.revolute("hinge", m.ground, m.body("rod", mass="m"))
    assert "no picture" in m._repr_html_()
    assert "parameters.m" in m._repr_html_()


# -- animations --------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def animated() -> Any:
    return eg.load_example("slider_crank").compile(target="numpy")


@pytest.fixture(scope="module")
def run(animated: Any) -> Any:
    return animated.simulate(1.0)


def test_positions_of_markers_are_those_of_outputs(run: Any, animated: Any, tmp_path: Path) -> None:
    tip = run.position("rod.tip")
    assert tip[0] == pytest.approx(run["pin_x"], abs=1e-12)
    assert run.poses().shape == (animated.n_bodies, 4, 4, len(run))
    assert run.position("slider") == pytest.approx(tip, abs=1e-6)
    refuses("EG-NAME-UNKNOWN rod.tap rod.tip", run.position, "rod.tap")
    loaded = eg.load_trajectory(run.save(tmp_path / "run.npz"))
    assert loaded.poses(animated) == pytest.approx(run.poses(), abs=1e-12)
    refuses("EG-MISSING model=module", loaded.animate, tmp_path / "run.gif")
    other = eg.load_example("pendulum").compile(target="numpy")
    refuses("EG-SHAPE module", loaded.poses, other)


def test_a_gif_has_a_frame_for_every_step_of_time(run: Any, animated: Any, tmp_path: Path) -> None:
    file = run.animate(tmp_path / "run.gif", fps=10, speed=0.5, trace="rod.tip", plot="theta", dpi=40)
    with Image.open(file) as image:
        durations, frames = [], []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
            frames.append(np.asarray(image.convert("L"), dtype=int))
    assert (len(frames), sum(durations)) == (21, 2100)  # 1 s at half speed, 10 in a second, both ends
    assert all((np.abs(a - b) > 40).any() for a, b in pairwise(frames))  # it moves
    shown = run.animate(format="gif", fps=4, dpi=30)
    found = re.fullmatch('<img alt="animation" src="data:image/gif;base64,(.*)">', shown._repr_html_())
    assert found is not None
    with Image.open(io.BytesIO(base64.b64decode(found[1]))) as image:
        assert image.n_frames == 13  # 1 s in 3 s, 4 in a second, both ends


def test_a_gif_keeps_the_colours_of_its_frames(tmp_path: Path) -> None:
    """Of a spatial model, whose solids have many shades; 64 colours by number of dots were wrong by 54 of 255."""
    run = eg.load_example("stewart_platform").compile(target="numpy").simulate(0.02)
    film = run.animate(tmp_path / "a.gif", fps=2, speed=0.02, dpi=40)
    folder = run.animate(tmp_path / "frames", fps=2, speed=0.02, dpi=40)
    assert [file.name for file in sorted(folder.iterdir())] == ["frame_0.png", "frame_1.png", "frame_2.png"]
    refuses("EG-FILE empty", run.animate, folder)
    with Image.open(film) as stored, Image.open(folder / "frame_0.png") as made:
        a, b = (np.asarray(one.convert("RGB")).astype(int) for one in (stored, made))
    wrong = np.abs(a - b).max(axis=2)
    assert wrong.mean() < 0.5
    assert np.percentile(wrong, 99.9) <= 16


def test_films_need_ffmpeg(run: Any, tmp_path: Path) -> None:
    if importlib.util.find_spec("imageio_ffmpeg") or shutil.which("ffmpeg"):
        assert run.animate(tmp_path / "run.mp4", fps=5, dpi=40).read_bytes()[4:8] == b"ftyp"
    else:
        refuses("EG-PACKAGE-MISSING ffmpeg", run.animate, tmp_path / "run.mp4")


@pytest.mark.parametrize(
    ("file", "how", "said"),
    [
        ("run.avi", {}, "EG-FILE .gif .mp4 .html"),
        ("run.gif", {"fps": 0}, "EG-RANGE fps 0"),
        ("run.gif", {"fps": 60, "speed": 0.001}, "EG-TOO-LARGE speed"),
        ("run.gif", {"trace": "nowhere"}, "EG-NAME-UNKNOWN trace"),
        ("run.gif", {"dpi": "x"}, "EG-NUMBER dpi"),
        ("run.gif", {"dpi": 1e6}, "EG-RANGE dpi 1 1200"),
        ("run.gif", {"format": "gif"}, "EG-CONFLICT format="),
        ("run.gif", {"forces": ("hing",)}, "EG-NAME-UNKNOWN hing"),
        ("gif", {}, "EG-FILE run.gif gif format="),
        (None, {"format": "png"}, "EG-CHOICE gif mp4 html png"),
        ("run.gif", {"model": eg.Model("m")}, "EG-TYPE Model.compile"),
    ],
)
def test_slips_are_reported_before_any_work(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str | None, how: dict[str, Any], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    refuses(said, run.animate, file, **how)
    assert list(tmp_path.iterdir()) == []


def test_a_page_holds_all_it_needs(run: Any, animated: Any, tmp_path: Path) -> None:
    text = run.animate(tmp_path / "run.html", fps=10, trace="rod.tip").read_text()
    assert re.findall(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text) == []
    assert "default-src 'none'" in text
    assert "<title>slider_crank</title>" in text
    slow = str(animated.simulate(0.1).animate(speed=0.25))
    assert '"pace": 0.25' in slow
    assert "t = 0.000 s" in slow
    motion = animated.kinematic_analysis(theta=np.linspace(0.0, 1.0, 5))
    assert '"words": ["theta = 0.000 rad", "theta = 0.250 rad"' in str(motion.animate(plot="s"))


def test_the_longest_arrow_is_the_force_that_a_joint_bears() -> None:
    """At rest the hinge holds 2 kg; let go at a right angle it holds nothing at first, and 3 m g at the bottom."""
    m = eg.Model("hanging", gravity=(0, -9.81, 0))
    m.revolute("hinge", m.ground, m.body("bob", mass=2.0, com=(0, -1, 0)), coordinate="theta")
    mod = m.compile(target="numpy")
    for angle, end, force in ((0.0, 0.2, 2 * 9.81), (np.pi / 2, 0.6, 3 * 2 * 9.81)):
        run = mod.simulate((0, end), initial={"theta": angle}, rtol=1e-9)
        shown = re.search(r"longest arrow ([\d.]+) N", str(run.animate(forces=True, fps=40, speed=0.1)))
        assert shown is not None
        q, w = run["theta"], run["theta_dot"]
        bound = np.abs(2 * (w**2 + 9.81 * np.cos(q))).max()  # m l w^2 along the rod, and m g cos of the fall
        assert float(shown[1]) == pytest.approx(bound, rel=0.01)
        assert float(shown[1]) <= force * 1.001


def test_the_arrow_of_a_spring_points_along_its_last_part(tmp_path: Path) -> None:
    """A bob straight below a pin, over which its spring runs to a far wall."""
    m = eg.Model("cord", gravity=(0, -9.81, 0))
    m.prismatic("slide", m.ground, bob := m.body("bob", mass=1.0), axis="y", coordinate="y")
    m.spring("cord", m.ground.at(-3, 0, 0), bob, stiffness=10, length=1, via=[m.ground.at(0, 1, 0)])
    run, seen = m.compile(target="numpy").simulate(0.1, initial={"y": -1.0}), []
    for forces in ((), ["cord"]):
        run.animate(folder := tmp_path / f"frames{len(forces)}", fps=10, forces=forces)
        seen.append(np.asarray(Image.open(min(folder.iterdir())).convert("RGB"), dtype=int))
    before, after = (frame @ [65536, 256, 1] for frame in seen)
    rows, columns = np.nonzero(~np.isin(after, before) & (np.ptp(seen[1], axis=2) > 60))
    assert 10 < 2 * np.ptp(columns) < np.ptp(rows)


@pytest.mark.thorough
def test_a_kernel_shows_progress_pictures_and_short_tracebacks(tmp_path: Path) -> None:
    cells = [
        "import eomgen as eg\nmod = eg.load_example('pendulum').compile(target='numpy')\nmod",
        "traj = mod.simulate(20.0, progress=True, rtol=1e-9)",
        "traj.plot();",
        "traj.animate(plot='theta')",
        "def mine():\n    return mod.simulate(1.0, initial={'thet': 3})\nmine()",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in cells])
    notebook.cells[4].metadata.tags = ["raises-exception"]
    nbformat.write(notebook, tmp_path / "given.ipynb")
    (tmp_path / "done").mkdir()
    outputs = [cell.outputs for cell in executed(tmp_path / "given.ipynb", tmp_path / "done", raw=True).cells]
    assert "base64" in outputs[0][0].data["text/html"]
    (bar,) = outputs[1]  # what was shown of the progress, at its end: nothing
    assert bar.data["text/html"] == ""
    assert any("image/png" in one.get("data", {}) for one in outputs[2])
    assert outputs[3][0].data["text/html"].startswith("<iframe")
    (error,) = outputs[4]
    text = "\n".join(error.traceback)
    assert "line 2, in mine" in text
    assert "did you mean theta" in text
    assert "eomgen/" not in text
