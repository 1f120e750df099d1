"""Sliders in notebooks: loops are closed at every position, on the same branch; a gap is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import MissingDependencyError
from eomgen.show import optional

EXAMPLES = Path(__file__).parents[2] / "examples"
pytest.importorskip("ipywidgets")
pytest.importorskip("k3d")


@pytest.fixture(scope="module")
def module() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy")


def slider_at(theta: float, r: float = 0.1, l: float = 0.35) -> float:
    return float(r * np.cos(theta) + np.sqrt(l**2 - (r * np.sin(theta)) ** 2))


def test_sliders_move_the_mechanism_on_its_branch(module: Any) -> None:
    explorer = module.explore()
    for one in explorer.sliders.values():  # else a browser rounds the value that is not on a step
        steps = (one.value - one.min) / one.step
        assert steps == pytest.approx(round(steps), abs=1e-6)
    assert list(explorer.sliders) == ["theta", "r", "l"]  # masses and the motor change nothing that is seen
    s = module.q_names.index("s")
    for theta in (2.9, -2.0, 0.1):  # leaps past the dead centres
        explorer.sliders["theta"].value = theta
        assert explorer.message == ""
        assert explorer.q[s] == pytest.approx(slider_at(theta), abs=1e-9)
    explorer.sliders["r"].value = 0.15
    assert explorer.q[s] == pytest.approx(slider_at(0.1, 0.15), abs=1e-9)
    explorer.reset()
    assert explorer.q == pytest.approx(module.x0()[: module.n_q], abs=1e-9)


@pytest.mark.parametrize("limits", [{"upper": 1.0}, {"velocity": 2.0}])
def test_sliders_end_at_a_limit_of_one_side(limits: dict[str, float]) -> None:
    m = eg.Model("arm")
    m.revolute("A", m.ground, m.body("arm", mass=1, com=(0.5, 0, 0), inertia={"zz": 1}), limits=limits)
    slider = m.compile(target="numpy").explore().sliders["A"]
    step = slider.step
    assert slider.min == pytest.approx(-np.pi, abs=step)
    assert slider.max == pytest.approx(limits.get("upper", np.pi), abs=step)


def test_what_cannot_be_closed_is_told_and_the_last_position_stays(module: Any) -> None:
    explorer = module.explore({"theta": 0.0})
    explorer.sliders["l"].value = 0.175
    explorer.sliders["r"].value = 0.2  # asin(0.175 / 0.2) = 1.065
    explorer.sliders["theta"].value = 1.5
    assert "do not close" in explorer.message
    assert explorer.message in explorer.widget.children[1].value
    gap = np.abs(explorer.module.constraints.every(explorer.q)).max()
    assert gap < 1e-9
    assert abs(explorer.q[0]) < 1.066
    explorer.sliders["theta"].value = 0.5
    assert explorer.message == ""


def test_the_picture_follows(module: Any) -> None:
    explorer = module.explore({"theta": 0.0})
    names = [one.name for one in explorer.widget.children[0].objects]
    crank = explorer.widget.children[0].objects[names.index("link crank")]
    assert crank.model_matrix[:2, 0] == pytest.approx([1.0, 0.0], abs=1e-6)
    explorer.sliders["theta"].value = 1.0
    angle = explorer.sliders["theta"].value  # on a step of the slider
    assert crank.model_matrix[:2, 0] == pytest.approx([np.cos(angle), np.sin(angle)], abs=1e-6)


def test_an_open_chain_takes_what_it_is_given() -> None:
    explorer = eg.load(EXAMPLES / "double_pendulum.yaml").compile(target="numpy").explore()
    explorer.sliders["bend"].value = 1.0
    assert explorer.q[1] == explorer.sliders["bend"].value


def test_time_moves_what_drivers_move() -> None:
    explorer = eg.load(EXAMPLES / "v_twin.yaml").compile(target="numpy").explore()
    assert list(explorer.sliders) == ["t", "r", "l"]
    explorer.sliders["t"].value = 0.013  # 100 pi / s: more than half a turn
    t = explorer.sliders["t"].value
    names = explorer.module.q_names
    assert explorer.q[names.index("theta")] == pytest.approx(100 * np.pi * t, abs=1e-9)
    assert explorer.q[names.index("s_1")] == pytest.approx(slider_at(100 * np.pi * t - np.pi / 4, 0.04, 0.16), abs=1e-9)


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, module: Any) -> None:
    def lacking(name: str) -> Any:
        raise ImportError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(optional, "import_module", lacking)
    with pytest.raises(MissingDependencyError, match=r"needs (ipywidgets|k3d): pip install"):
        module.explore()
