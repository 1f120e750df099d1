"""Workspaces against closed forms: planar and spatial serial arms, a four-bar, limits.

Sources: T. Yoshikawa, Manipulability of robotic mechanisms (1985), section 4 (planar 2R arm) and Foundations of
Robotics (1990), section 4.2 (three joints); written out here from the geometry.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from refusals import refuses

import eomgen as eg

TURN = 2 * np.pi
BODY = {"mass": 1, "inertia": (0.1, 0.1, 0.1)}
UPPER, LOWER = 0.5, 0.3  #: links of the arms


def planar_arm() -> eg.Model:
    m = eg.Model("arm")
    upper, lower = m.body("upper", **BODY), m.body("lower", **BODY)
    m.revolute("A", m.ground, upper, coordinate="q1")
    m.revolute("B", upper.at(UPPER, 0, 0), lower, coordinate="q2", limits={"lower": -2.0, "upper": 2.5})
    tip = lower.marker("tip", at=(LOWER, 0, 0))
    for k, name in enumerate("xy"):
        m.output(name, tip.position[k])
    m.output("speed", tip.velocity[0])
    m.initial(q2=0.4)
    return m


def spatial_arm() -> eg.Model:
    m = eg.Model("spatial_arm")
    waist, upper, lower = (m.body(name, **BODY) for name in ("waist", "upper", "lower"))
    m.revolute("A", m.ground, waist, axis="z", coordinate="q1")
    m.revolute("B", waist, upper, axis="y", coordinate="q2")
    m.revolute("C", upper.at(UPPER, 0, 0), lower, axis="y", coordinate="q3")
    tip = lower.marker("tip", at=(LOWER, 0, 0))
    for k, name in enumerate("xyz"):
        m.output(name, tip.position[k])
    m.initial(q3=0.5)
    return m


@pytest.fixture(scope="module")
def arm() -> eg.Module:
    return planar_arm().compile(target="numpy")


def test_the_annulus_of_a_planar_arm(arm: eg.Module) -> None:
    whole = np.pi * ((UPPER + LOWER) ** 2 - (UPPER - LOWER) ** 2)
    off = []
    for n in (13, 25):
        ws = arm.workspace({"q1": (0, TURN, n), "q2": (0, TURN / 2, n)}, ["x", "y"])
        off.append(abs(ws.area() / whole - 1))
    assert off[0] > 2.5 * off[1]
    both = arm.workspace({"q1": (0, TURN, 25), "q2": (-np.pi, np.pi, 49)}, ["x", "y"])
    assert both.area() == pytest.approx(whole, rel=0.02)  # elbow up and elbow down are one place
    assert (both.status == "reached").all()
    q1, q2 = both["q1"], both["q2"]
    np.testing.assert_allclose(both["x"], UPPER * np.cos(q1) + LOWER * np.cos(q1 + q2), atol=1e-15)
    np.testing.assert_allclose(both.manipulability, UPPER * LOWER * np.abs(np.sin(q2)), atol=1e-15)
    np.testing.assert_allclose(1 / both.condition, both.smallest / both.largest, atol=1e-15)
    flat = np.isin(np.arange(49), (0, 24, 48))  # stretched and folded
    assert (both.singular == flat).all()
    assert {one.kind for one in both.singularities} == {"outputs"}


def test_singular_positions_between_grid_points_are_found(arm: eg.Module) -> None:
    ws = arm.workspace({"q1": (0, 1, 3), "q2": (-0.5, 0.63, 6)}, ["x", "y"])
    assert [one.values["q2"] for one in ws.singularities] == pytest.approx([0, 0, 0], abs=1e-10)
    assert ws.singularities[0].names == ("x",)  # stretched along x it still moves along y only
    assert (np.argwhere(ws.singular)[:, 1] // 2 == 1).all()
    assert np.count_nonzero(ws.singular) == 6


@pytest.mark.quick
@pytest.mark.parametrize("limits", [True, {"q2": (-2, 2.5)}])
def test_limits(arm: eg.Module, limits: Any) -> None:
    ws = arm.workspace({"q1": (0, TURN, 5), "q2": (-np.pi, np.pi, 41)}, ["x", "y"], limits=limits)
    fine = (ws["q2"] >= -2) & (ws["q2"] <= 2.5)
    assert (ws.reached == fine).all()
    assert (ws.status[~fine] == "limits").all()
    assert (np.isnan(ws["x"]) == ~fine).all()
    one_side = arm.workspace({"q2": (-3, 3, 7)}, "y", limits={"q2": (None, 0.5)})
    assert (one_side.status == ["reached"] * 4 + ["limits"] * 3).all()


def test_a_spatial_arm() -> None:
    mod = spatial_arm().compile(target="numpy")
    grid = {"q1": (0, np.pi, 5), "q2": (-np.pi, np.pi, 11), "q3": (0, np.pi, 6)}
    ws = mod.workspace(grid, ["x", "y", "z"])
    q1, q2, q3 = (ws[name] for name in grid)
    out = UPPER * np.cos(q2) + LOWER * np.cos(q2 + q3)
    np.testing.assert_allclose(ws["x"], out * np.cos(q1), atol=1e-14)
    np.testing.assert_allclose(ws["z"], -UPPER * np.sin(q2) - LOWER * np.sin(q2 + q3), atol=1e-14)
    np.testing.assert_allclose(ws.manipulability, UPPER * LOWER * np.abs(np.sin(q3) * out), atol=1e-14)
    shell = 4 / 3 * np.pi * ((UPPER + LOWER) ** 3 - (UPPER - LOWER) ** 3)
    assert ws.volume() == pytest.approx(shell, rel=0.2)
    refuses("EG-SHAPE area() 2", ws.area)


def test_a_change_point_is_passed_and_named() -> None:
    m = eg.Model("parallelogram")
    one, bar, two = (m.body(name, **BODY) for name in ("one", "bar", "two"))
    m.revolute("A", m.ground, one, coordinate="theta")
    m.revolute("B", one.at(0.2, 0, 0), bar, coordinate="bend")
    m.revolute("C", bar.at(0.6, 0, 0), two.at(0.2, 0, 0))
    m.revolute("D", m.ground.at(0.6, 0, 0), two, coordinate="psi")
    m.initial(theta=0.5)
    m.guess(bend=-0.5, psi=0.5)
    ws = m.compile(target="numpy").workspace({"theta": (-1, 1, 10)}, "psi")
    np.testing.assert_allclose(ws["psi"], ws["theta"], atol=1e-9)
    (found,) = ws.singularities
    assert (found.kind, found.values["theta"]) == ("change point", pytest.approx(0, abs=1e-6))
    assert list(np.flatnonzero(ws.singular)) == [4, 5]
    assert ws.jacobian[0, 0] == pytest.approx(np.ones(10))


def test_led_by_a_cut_joint_and_its_reach() -> None:
    four = models.build("four_bar").compile(target="numpy")
    ws = four.workspace({"psi": np.linspace(1.0, 2.6, 33)}, ["theta"])
    top = 2.2459278597319283
    assert (ws.reached == (ws["psi"] <= top)).all()
    (stop,) = [one for one in ws.singularities if one.values["psi"] > 1.5]
    assert (stop.kind, stop.values["psi"]) == ("stop", pytest.approx(top, abs=1e-9))
    motion = four.kinematic_analysis(psi=np.linspace(1.0, 2.2, 25), psi_dot=1)
    np.testing.assert_allclose(ws["theta"][:25], motion["theta"], atol=1e-10)
    np.testing.assert_allclose(ws.jacobian[0, 0, :25], motion["theta_dot"], rtol=1e-8)


def test_tables_files_and_pictures(arm: eg.Module, tmp_path: Path) -> None:
    ws = arm.workspace({"q1": (0, 3, 4), "q2": [0.1, 0.5, 0.7]}, ["x", "y"], limits={"q2": (0, 0.6)})
    frame = ws.to_pandas()
    assert frame.index.names == ["q1", "q2"]
    assert frame.loc[(1.0, 0.5), "x"] == ws["x"][1, 1]
    assert (frame["status"] == "limits").sum() == 4
    with np.load(ws.save(tmp_path / "ws"), allow_pickle=False) as data:
        assert list(data["over"]) == ["q1", "q2"]
        np.testing.assert_array_equal(data["[x]"], ws["x"])
        np.testing.assert_array_equal(data["jacobian"], ws.jacobian)
    rows = ws.save(tmp_path / "ws.csv").read_text().splitlines()
    assert len(rows) == 13
    assert rows[0].startswith("q1,q2,x,y,")
    refuses("EG-FILE .npz .csv", ws.save, tmp_path / "ws.txt")
    assert "4 limits" in str(ws)
    assert len(ws.plot()) == 2
    assert ws.plot("condition", ax=ws.plot()[0]) is not None
    refuses("EG-TYPE coloured", ws.plot, "status")
    line = arm.workspace({"q1": (0, 1, 5)}, "x")
    assert len(line.plot()) == 2
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.mark.parametrize(
    ("over", "of", "rest", "said"),
    [
        ({"q9": (0, 1, 3)}, "x", {}, "EG-NAME-UNKNOWN q9"),
        ({"q1": (0, 1, 3)}, "z", {}, "EG-NAME-UNKNOWN z"),
        ({"q1": (0, 1, 3)}, "speed", {}, "EG-UNSUPPORTED velocities"),
        ({"q1": (0, 1, 1)}, "x", {}, "EG-RANGE 2 10000000"),
        ({"q1": [0, 2, 1]}, "x", {}, "EG-TYPE falling"),
        ({"q1": (0, 1, 1000), "q2": (0, 1, 1000)}, "x", {}, "EG-TOO-LARGE 1000 1000000 points="),
        ({"q1": (0, 1, 3)}, "x", {"limits": {"q7": (0, 1)}}, "EG-NAME-UNKNOWN q7"),
        ({"q1": (0, 1, 3)}, "x", {"limits": {"q2": (1, 0)}}, "EG-RANGE lower 1 0"),
        ({"q1": (0, 1, 3)}, "x", {"limits": {"q2": 1}}, "EG-TYPE lower upper"),
    ],
)
def test_what_it_refuses(arm: eg.Module, over: Any, of: Any, rest: Any, said: str) -> None:
    refuses(said, arm.workspace, over, of, **rest)


def test_too_many_or_unreachable() -> None:
    four = models.build("four_bar").compile(target="numpy")
    refuses("EG-PARTITION theta psi 1", four.workspace, {"theta": (0, 1, 3), "psi": (0, 1, 3)}, "bend")
    refuses("EG-MISSING limits", four.workspace, {"theta": (0, 1, 3)}, "bend", limits=True)
    refuses("EG-PARTITION position", four.workspace, {"psi": (2.4, 2.8, 3)}, "theta")
