"""Branches side by side: they are seen from where they differ, and titles say by what."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.pyplot as pyplot
import numpy as np
import pytest

import eomgen as eg
from eomgen.show.branch_views import telling_values, telling_view, toward_eye, usual_view
from eomgen.show.build_scene import build_scene
from eomgen.show.scene import Scene
from eomgen.show.scene_pieces import eye_of

matplotlib.use("agg")
EXAMPLES = Path(__file__).parents[2] / "examples"


def flight(gravity: tuple[float, float, float], *places: np.ndarray) -> list[Scene]:
    """Scenes of a free body at places (3,)."""
    m = eg.Model("flight", gravity=gravity)
    m.free("fly", m.ground, m.body("b", mass=1, inertia=(1, 1, 1), display=[{"shape": "box", "size": (1, 2, 3)}]))
    module = m.compile(target="numpy")
    start = module.x0()[: module.n_q]
    return [build_scene(module, np.r_[place, start[3:]][:, None]) for place in places]


@pytest.mark.parametrize("gravity", [(0, 0, -1), (0, -1, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)])
def test_directions_of_views_are_those_of_matplotlib(gravity: tuple[float, float, float]) -> None:
    m = eg.Model("flight", gravity=gravity)
    m.free("fly", m.ground, m.body("b", mass=1, inertia=(1, 1, 1), display=[{"shape": "box", "size": (1, 2, 3)}]))
    ax = m.draw()
    ax.set_proj_type("ortho")
    (scene,) = flight(gravity, np.zeros(3))
    vertical = int(np.argmax(np.abs(scene.up)))
    for view in (usual_view(scene), (50.0, 110.0)):
        ax.view_init(*view, vertical_axis="xyz"[vertical])
        ax.figure.canvas.draw()
        assert eye_of(ax.M)[:3] == pytest.approx(toward_eye(scene, *view), abs=1e-6)
    pyplot.close("all")


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -1.0), (0.0, 1.0, 0.0)])
def test_branches_that_hide_each_other_are_seen_from_the_side(gravity: tuple[float, float, float]) -> None:
    (scene,) = flight(gravity, np.zeros(3))
    deep = toward_eye(scene, *usual_view(scene))
    view = telling_view(flight(gravity, -deep, deep))
    assert abs(float(toward_eye(scene, *view) @ deep)) < 0.7  # else each hides the other, as from the usual place
    across = np.cross(deep, scene.up)
    assert telling_view(flight(gravity, -across, across)) == usual_view(scene)
    assert telling_view(flight(gravity, deep, deep)) == usual_view(scene)  # nothing to be told apart


def test_titles_name_the_coordinates_that_differ() -> None:
    """Two branches of the RSSR have all bodies in the same place, and other angles in a universal joint."""
    module = eg.load(EXAMPLES / "spatial_four_bar.yaml").compile(target="numpy")
    panels = module.draw_branches()
    titles = [ax.get_title() for ax in panels]
    assert len(set(titles)) == len(titles) == len(module.branches({}))
    for q, title in zip(module.branches({}), titles, strict=True):
        for part in title.splitlines()[1].split(", "):
            name, _, value = part.partition(" = ")
            assert q[module.q_names.index(name)] == pytest.approx(float(value), rel=5e-3)
    assert telling_values(["a", "b"], [np.array([1.0, 2.0])]) == [""]
    pyplot.close("all")
