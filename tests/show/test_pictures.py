"""Pictures: what is drawn lies where the poses say, true to scale, of the right kind."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as pyplot
import numpy as np
import pytest
from matplotlib.path import Path as Line

import eomgen as eg
from eomgen.errors import MissingDependencyError, UsageError
from eomgen.show import optional
from eomgen.show.build_scene import build_scene
from eomgen.show.scene import Scene
from eomgen.show.solids import outline, rounded

matplotlib.use("agg")
EXAMPLES = Path(__file__).parents[2] / "examples"
SLIDER_CRANK = EXAMPLES / "slider_crank.yaml"


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    pyplot.close("all")


def compiled(name: str) -> Any:
    return eg.load(EXAMPLES / name).compile(target="numpy")


def scene_of(module: Any, **values: float) -> Scene:
    return build_scene(module, module.x0(values or None)[: module.n_q, None])


def middles(scene: Scene, role: str, name: str) -> np.ndarray:
    """Middle of each item of a role and a name, in ground axes at the first frame."""
    found = [item.at(scene.frames[0]) for item in scene.items if (item.role, item.name) == (role, name)]
    return np.array([(p.min(axis=0) + p.max(axis=0)) / 2 for p in found])


@pytest.fixture(scope="module")
def module() -> Any:
    return compiled("slider_crank.yaml")


def test_joint_symbols_lie_at_the_joints(module: Any) -> None:
    """Crank pin and slider by the closed form of a slider-crank."""
    for r in (0.1, 0.13):
        bound, theta, l = module.bind(p={"r": r}), 0.7, 0.35
        scene = scene_of(bound, theta=theta)
        pin = r * np.array([np.cos(theta), np.sin(theta), 0.0])
        slider = np.array([pin[0] + np.sqrt(l**2 - pin[1] ** 2), 0.0, 0.0])
        assert middles(scene, "joint", "A")[0] == pytest.approx([0, 0, 0], abs=1e-12)
        assert middles(scene, "joint", "B")[0] == pytest.approx(pin, abs=1e-12)
        assert middles(scene, "joint", "C")[0] == pytest.approx(slider, abs=1e-12)
        assert middles(scene, "block", "D")[0] == pytest.approx(slider, abs=1e-12)


def test_a_coil_goes_from_marker_to_marker(module: Any) -> None:
    scene = scene_of(module)
    (coil,) = [item.at(scene.frames[0]) for item in scene.items if item.name == "k1" and item.role == "force"]
    slider = module.poses(module.x0()[: module.n_q])[module.body_names.index("slider"), :3, 3]
    assert coil[0] == pytest.approx([0.5, 0, 0], abs=1e-12)
    assert coil[-1] == pytest.approx(slider, abs=1e-12)


def test_a_planar_mechanism_is_true_to_scale_and_a_spatial_one_in_space(module: Any) -> None:
    ax = module.draw()
    assert ax.get_aspect() == 1.0
    assert not hasattr(ax, "get_zlim")
    space = compiled("stewart_platform.yaml").draw()
    size = np.array([np.ptp(limits) for limits in (space.get_xlim(), space.get_ylim(), space.get_zlim())])
    box = np.asarray(space._box_aspect)
    assert size / size[0] == pytest.approx(box / box[0], rel=1e-9)


def test_what_stands_on_given_axes_stays_visible(module: Any) -> None:
    ax = pyplot.figure().add_subplot()
    ax.plot([-2.0, 0.1], [0.0, 1.5])
    ax.set_title("mine")
    ax.set_xlabel("way (m)")
    scene = scene_of(module)
    module.draw(ax=ax)
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert left <= -2.0 < 1.5 <= top
    assert right >= scene.high[0]
    assert bottom <= scene.low[1]
    assert (ax.get_aspect(), ax.get_title(), ax.get_xlabel()) == (1.0, "mine", "way (m)")
    before = module.draw({"theta": 0.3}).get_xlim()
    assert before == pytest.approx((scene.low[0], scene.high[0]))  # axes of its own fit the mechanism
    hanging = pyplot.figure().add_subplot()
    hanging.set_ylim(3.0, 1.0)  # downwards, and set by hand
    module.draw(ax=hanging)
    assert hanging.get_ylim()[0] == 3.0
    assert hanging.get_ylim()[1] <= scene.low[1]


def test_what_stands_on_given_axes_in_space_stays_visible() -> None:
    bicycle = compiled("bicycle.yaml")
    alone = bicycle.draw()
    ax = pyplot.figure().add_subplot(projection="3d")
    ax.plot([5.0, 6.0], [0.0, 0.0], [-3.0, -2.0])
    bicycle.draw(ax=ax)
    assert max(ax.get_xlim()) >= 6.0
    assert min(ax.get_zlim()) <= -3.0
    assert max(ax.get_zlim()) == pytest.approx(max(alone.get_zlim()))
    low, high = ax.get_zlim()
    assert low > high  # z is down, as alone
    size = np.array([np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())])
    assert size / size[0] == pytest.approx(np.asarray(ax._box_aspect) / ax._box_aspect[0], rel=1e-9)


def test_down_is_down() -> None:
    """Gravity along x: x points down the page; against z (z down): the vertical axis is turned round."""
    m = eg.Model("hanging", gravity=(9.81, 0, 0))
    rod = m.body("rod", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    m.revolute("hinge", m.ground, rod, coordinate="theta")
    scene = scene_of(m.compile(target="numpy"))
    assert scene.view is not None
    assert scene.view[1] == pytest.approx([-1, 0, 0])
    assert np.linalg.det(scene.view) == pytest.approx(1.0)
    ax = compiled("bicycle.yaml").draw()
    low, high = ax.get_zlim()
    assert low > high


@pytest.mark.parametrize("gravity", [(0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)])
def test_a_picture_in_space_has_one_scale_and_right_hands(gravity: tuple[int, int, int]) -> None:
    """Seen without perspective, three equal axes at right angles give three columns with J J^T = s^2 I (Gauss)."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

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
    eye = np.cross(J[0], J[1])  # of right hands: right x up points at the reader
    assert eye @ up > 0.0  # from above
    right = np.eye(3)[1 if gravity[0] else 0]
    assert J[0] @ right > 0.5 * np.linalg.norm(J[0])


def test_a_law_between_two_points_is_seen() -> None:
    m = eg.Model("sling", gravity=(0, -9.81, 0))
    arm = m.body("arm", mass=1, com=(0.5, 0, 0), inertia={"zz": 0.1})
    m.revolute("A", m.ground, arm)
    m.element("sling", m.ground.at(0, 1, 0), arm.at(1, 0, 0), law="-10*max(0, length - 0.5)")
    [line] = [item.points for item in scene_of(m.compile(target="numpy")).items if item.role == "force"]
    assert np.allclose(line[0], (0, 1, 0))
    assert np.allclose(line[-1], (1, 0, 0))


def test_a_height_field_is_lines_at_its_heights_and_not_walls() -> None:
    m = eg.Model("dunes", gravity=(0, 0, -9.81))
    ball = m.body("ball", mass=1, inertia=(0.004,) * 3)
    m.free("j", m.ground, ball)
    x = [-1.0, 0.0, 1.0]
    field = {"shape": "height_field", "on": m.ground, "x": x, "y": x, "z": [[0.2] * 3, [0.0] * 3, [0.2] * 3]}
    m.contacts("c", {"shape": "sphere", "radius": 0.1, "on": ball}, field, {"stiffness": 1e5})
    items = scene_of(m.compile(target="numpy")).items
    assert not [item for item in items if item.role == "hatch" and item.name == "c"]
    points = np.vstack([item.points for item in items if item.role == "force" and item.name == "c"])
    edges = points[np.isclose(np.abs(points[:, 0]), 1.0)]
    assert len(edges) > 4
    assert np.allclose(edges[:, 2], 0.2)


@pytest.mark.parametrize("name", sorted(file.name for file in EXAMPLES.glob("*.yaml")))
def test_every_example_draws_all_bodies_in_the_page(name: str) -> None:
    module = compiled(name)
    scene = scene_of(module)
    seen = {item.body for item in scene.items if item.role not in ("frame", "hatch")}
    massive = {k for k, b in enumerate(module.metadata["picture"]["bodies"]) if b["mass"] != 0.0}
    assert massive <= seen
    for item in scene.items:
        points = item.at(scene.frames[0])
        points = points[np.isfinite(points).all(axis=1)]
        points = points if scene.view is None else points @ scene.view.T
        assert (points >= scene.low).all()
        assert (points <= scene.high).all()
    module.draw().figure.canvas.draw()


@pytest.mark.parametrize("name", ["furuta_pendulum", "double_wishbone", "satellite"])
def test_the_names_of_axes_are_not_cut_off(name: str) -> None:
    ax = compiled(f"{name}.yaml").draw()
    canvas = ax.figure.canvas
    canvas.draw()
    width, height = canvas.get_width_height()
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        box = axis.label.get_window_extent(canvas.get_renderer())
        assert min(box.x0, box.y0, width - box.x1, height - box.y1) >= 0.0


def boxes_of_names(ax: Any) -> dict[str, Any]:
    """Where each name stands on the drawn page, with its light ground."""
    renderer = ax.figure.canvas.get_renderer()
    return {text.get_text(): text.get_bbox_patch().get_window_extent(renderer) for text in ax.texts}


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "cart_pendulum", "chebyshev"])
def test_names_stand_beside_bars_and_hatching(name: str) -> None:
    module = compiled(f"{name}.yaml")
    scene = scene_of(module)
    ax = module.draw()
    ax.figure.canvas.draw()
    boxes = boxes_of_names(ax)
    assert set(boxes) == {label.text for label in scene.labels}
    for item in scene.items:
        if item.role not in ("link", "hatch"):
            continue
        corners = item.at(scene.frames[0]) @ scene.view[:2].T
        solid = item.faces is not None
        pieces = [outline(corners)] if solid else np.split(corners, np.flatnonzero(np.isnan(corners[:, 0])))
        if solid and item.name == "coupler":
            continue  # a plate is not a bar; its name may stand on it
        for piece in pieces:
            line = Line(ax.transData.transform(piece[np.isfinite(piece[:, 0])]), closed=solid)
            for text, box in boxes.items():
                assert not line.intersects_bbox(box, filled=solid), (text, item.role, item.name)
    for text, box in boxes.items():
        assert not any(box.overlaps(other) for word, other in boxes.items() if word != text)


def test_names_stand_over_solids_in_space() -> None:
    ax = compiled("furuta_pendulum.yaml").draw()
    ax.figure.canvas.draw()
    boxes = boxes_of_names(ax)
    assert len(boxes) == 4
    assert min(text.zorder for text in ax.texts) > max(one.zorder for one in ax.collections)
    for text, box in boxes.items():
        assert not any(box.overlaps(other) for word, other in boxes.items() if word != text)


def test_a_flywheel_is_round() -> None:
    scene = scene_of(compiled("engine.yaml"))
    (wheel,) = [item for item in scene.items if (item.role, item.name) == ("shape", "crank")]
    x, y = outline(wheel.points[:, :2]).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert area == pytest.approx(np.pi * 0.085**2, rel=0.005)


def test_sizes_of_shapes_follow_the_parameters() -> None:
    m = eg.Model("disc")
    m.parameter("r", 0.2)
    shapes = [{"shape": "cylinder", "radius": "r", "length": "r/4"}]
    m.revolute("A", m.ground, m.body("disc", mass=1.0, inertia={"zz": 1.0}, display=shapes), coordinate="turn")
    module = m.compile(target="numpy")
    for bound, r in ((module, 0.2), (module.bind({"r": 0.5}), 0.5)):
        (disc,) = [item for item in scene_of(bound).items if (item.role, item.name) == ("shape", "disc")]
        assert np.ptp(disc.points, axis=0) == pytest.approx([2 * r, 2 * r, r / 4], rel=0.02)
    m.body("other", mass=1.0, inertia={"zz": 1.0}, display=[{"shape": "sphere", "radius": "turn"}])
    with pytest.raises(eg.ModelError, match="the coordinate 'turn' cannot be used here"):
        m.check()


def test_branches_are_drawn_side_by_side() -> None:
    module = compiled("four_bar.yaml")
    panels = module.draw_branches()
    assert len(panels) == len(module.branches({})) == 2
    assert panels[0].get_xlim() == panels[1].get_xlim()


def test_a_model_is_drawn_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    ax = eg.load(SLIDER_CRANK).draw({"theta": 1.0})
    assert ax.get_title() == "slider_crank"


def test_an_outline_is_the_convex_hull() -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (200, 2))
    from scipy.spatial import ConvexHull

    x, y = outline(points).T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    assert area == pytest.approx(ConvexHull(points).volume, rel=1e-9)


@pytest.mark.parametrize("many", [2, 3, 7])
@pytest.mark.parametrize("flat", [1e-3, 1.0])
def test_bars_and_plates_are_hulls_of_balls(many: int, flat: float) -> None:
    """Convex, closed, of outward faces, and as far from the points as the radius, all round."""
    from scipy.spatial import ConvexHull

    turn = np.linalg.qr(np.random.default_rng(many).normal(size=(3, 3)))[0]
    points = (np.random.default_rng(2).uniform(-1, 1, (many, 3)) * [1.0, flat, 0.0]) @ turn + [3.0, -2.0, 1.0]
    vertices, faces = rounded(points, 0.05)
    inside = vertices - points.mean(axis=0)
    a, b, c = (inside[faces[:, k]] for k in range(3))
    volume = float((a * np.cross(b, c)).sum() / 6.0)
    assert volume == pytest.approx(ConvexHull(vertices).volume, rel=1e-9)
    for way in np.random.default_rng(3).normal(size=(50, 3)):
        way /= np.linalg.norm(way)
        reach = float((vertices @ way).max() - (points @ way).max())
        assert 0.93 * 0.05 <= reach <= 0.05 * (1.0 + 1e-9)


def test_pitch_circles_touch() -> None:
    """30, 30 and 90 teeth on a carrier of 60 mm: radii 30, 30 and 90 mm; the drum of the rope has 40 mm."""
    scene = scene_of(compiled("planetary_gear.yaml"))
    wheels = [item for item in scene.items if item.role == "wheel" and item.faces is not None]
    for name, expected in (("gears", [0.03, 0.03, 0.03, 0.09]), ("rope", [0.04])):
        radii = sorted(float(np.ptp(item.points[:, 0]) / 2) for item in wheels if item.name == name)
        assert radii == pytest.approx(expected, rel=1e-6)


def test_bad_input_is_refused_by_name(module: Any) -> None:
    with pytest.raises(UsageError, match=r"shape \(5,\); give a state"):
        module.draw(np.zeros(5))
    with pytest.raises(UsageError, match="theta_1"):
        module.draw({"theta_1": 0.2})
    with pytest.raises(UsageError, match="not finite"):
        module.draw(np.full(module.n_q, np.nan))
    with pytest.raises(UsageError, match="plain axes"):
        module.draw(ax=matplotlib.figure.Figure().add_subplot(projection="3d"))


def test_equations_without_bodies_have_no_picture() -> None:
    import sympy

    q = sympy.Function("q")(sympy.Symbol("t"))
    t = sympy.Symbol("t")
    m = eg.Model.from_lagrangian("oscillator", q.diff(t) ** 2 / 2 - q**2 / 2, [q])
    with pytest.raises(UsageError, match="nothing to draw of model 'oscillator'"):
        m.compile(target="numpy").draw()


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, module: Any) -> None:
    def lacking(name: str) -> Any:
        raise ImportError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(optional, "import_module", lacking)
    with pytest.raises(MissingDependencyError, match="draw needs matplotlib: pip install"):
        module.draw()
    with pytest.raises(MissingDependencyError, match="k3d>=3.2"):
        optional.k3d("a page")


def test_coordinates_may_be_keywords(module: Any) -> None:
    def names(**how: Any) -> list[list[float]]:
        ax = module.draw(**how)
        return [np.asarray(patch.get_xy()).round(9).tolist() for patch in ax.patches]

    assert names(theta=0.7) == names(x={"theta": 0.7}) == names(x={"theta": 0.1}, theta="0.7") != names()
    assert eg.load(SLIDER_CRANK).draw(theta=0.7, names=False).get_title() == "slider_crank"
    with pytest.raises(UsageError, match="did you mean theta"):
        module.draw(thata=0.7)
    with pytest.raises(UsageError, match="give either a state or values by name, not both; theta came beside"):
        module.draw(np.zeros(module.n_q), theta=0.7)


def test_a_coordinate_called_x_is_given_in_a_mapping() -> None:
    m = eg.Model("cart")
    m.prismatic("slide", m.ground, m.body("cart", mass=1), axis="x", coordinate="x")
    module = m.compile(target="numpy")
    with pytest.raises(UsageError, match=r'give the coordinate called x in a mapping: draw\(\{"x": 0.3\}\)'):
        module.draw(x=0.3)
    assert module.draw({"x": 0.3}).get_title() == "cart"
