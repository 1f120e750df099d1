"""Plots of runs: what is drawn, where its names stand, and that nothing is squeezed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import UsageError
from eomgen.runtime.refined import cubic_between, monotone_slopes

matplotlib.use("agg")
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(autouse=True)
def close_figures() -> Iterator[None]:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def run() -> Any:
    return eg.load(EXAMPLES / "slider_crank.yaml").compile(target="numpy").simulate(1.0)


def pendulum(theta: float = 0.01, end: float = 8.0, **options: Any) -> Any:
    m = eg.Model("pendulum", gravity=(0, -9.81, 0))
    bob = m.body("bob", mass=1, com=(0, -1, 0))
    m.revolute("hinge", m.ground, bob, coordinate="theta")
    return m.compile(target="numpy").simulate(end, initial={"theta": theta}, rtol=1e-10, atol=1e-12, **options)


@pytest.mark.parametrize(("times", "curved"), [([0.0, 60.0], False), (np.linspace(0.0, 8.0, 41), True)])
def test_points_far_apart_are_joined_by_straight_lines(times: Any, curved: bool) -> None:
    """A pendulum that swings every two seconds: of a minute between two points nothing is known."""
    few = pendulum(0.5, times[-1], t_eval=times)
    ax = few.plot("theta")
    t, theta = ax.lines[0].get_data()
    straight = np.interp(t, few.t, few["theta"])
    assert (np.abs(theta - straight).max() > 0.02) == curved
    assert np.abs(theta).max() <= 0.51


def test_shape_against_shape_is_the_path_of_the_point(run: Any) -> None:
    ax = run.plot(x="pin_x", y="s")
    line = ax.lines[0].get_xydata()
    # the tip of the rod is on the slider: a straight line of 45 degrees, drawn in one scale
    assert line[:, 0] == pytest.approx(line[:, 1], abs=1e-9)
    assert ax.get_aspect() == 1.0
    assert len(line) > 500
    assert run.plot("theta", x="s").get_xlabel() == "$s$ (m)"


def test_a_phase_portrait_of_a_small_swing_is_an_ellipse() -> None:
    ax = pendulum().plot("theta", kind="phase")
    x, y = ax.lines[0].get_xydata().T
    assert (x / 0.01) ** 2 + (y / (0.01 * np.sqrt(9.81))) ** 2 == pytest.approx(1.0, abs=1e-4)
    assert ax.get_xlabel() == r"$\theta$ (rad)"
    assert ax.get_ylabel() == r"$\dot{\theta}$ (rad/s)"


def test_a_spectrum_has_the_frequency_and_amplitude_of_the_swing() -> None:
    period = 2.0 * np.pi / np.sqrt(9.81)
    ax = pendulum(end=10 * period).plot(kind="spectrum")
    frequency, amplitude = ax.lines[0].get_xydata().T
    k = int(np.argmax(amplitude))
    assert frequency[k] == pytest.approx(1.0 / period, rel=1e-3)
    assert amplitude[k] == pytest.approx(0.01, rel=1e-3)


def test_energy_and_residuals(run: Any) -> None:
    parts, change = run.plot(kind="energy")
    kinetic, potential, total = (line.get_ydata() for line in parts.lines)
    assert kinetic + potential == pytest.approx(total)
    assert np.abs(change.lines[0].get_ydata()).max() < 1e-6
    position, _ = run.plot(kind="residuals")
    assert position.get_yscale() == "log"
    assert position.lines[0].get_ydata().max() < 1e-9
    with pytest.raises(UsageError, match="no constraints"):
        pendulum(end=0.1).plot(kind="residuals")


def test_the_energy_between_the_steps_drifts_no_more_than_at_them() -> None:
    run = pendulum(2.0)  # 110 steps of about a fortieth of a swing; the cubics between them are off by 7e-4 J
    E = -9.81 * np.cos(2.0)  # of the closed form, at rest at 2 rad
    at_steps = run["energy"]
    drift = float(np.ptp(at_steps))
    assert drift < 1e-8
    curve = run.plot("energy").lines[0].get_ydata()
    assert len(curve) > 5 * len(at_steps)
    assert np.abs(curve - E).max() <= np.abs(at_steps - E).max() + 1e-13
    parts, change = run.plot(kind="energy")
    assert np.ptp(change.lines[0].get_ydata()) <= drift + 1e-13
    t, kinetic = parts.lines[0].get_xydata().T
    assert len(t) == len(curve)  # and smooth
    swing = np.interp(t, *run.plot("theta").lines[0].get_xydata().T)
    assert kinetic == pytest.approx(9.81 * (np.cos(swing) - np.cos(2.0)), abs=1e-3)  # T = m g l (cos - cos 2)


def test_a_curve_without_extremes_between_its_points_is_that_of_scipy() -> None:
    from scipy.interpolate import PchipInterpolator

    t = np.linspace(0.0, 3.0, 13)
    for y in (np.sin(3.0 * t), np.full(13, 2.0), np.where(t < 1.5, 0.0, 1.0)):
        slopes = monotone_slopes(t, y)
        assert slopes[1:-1] == pytest.approx(PchipInterpolator(t, y).derivative()(t)[1:-1], abs=1e-13)
    # a jump at t = 1 begins a new curve
    twice, steps = np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 1.0, 5.0, 3.0])
    assert monotone_slopes(twice, steps) == pytest.approx([1.0, 1.0, -2.0, -2.0])


def test_sixty_columns_leave_the_axes_their_room() -> None:
    mod = eg.load(EXAMPLES / "stewart_platform.yaml").compile(target="numpy")
    traj = mod.simulate(0.02)
    names = [n for n in traj.names if traj.units.get(n) in ("rad", "m", "rad/s", "m/s")][:60]
    assert len(names) == 60
    panels = traj.plot(*names)
    assert len(panels) == 4
    figure = panels[0].figure
    figure.canvas.draw()
    for ax in panels:
        box = ax.get_window_extent()
        assert box.width > 0.35 * figure.bbox.width
        assert box.height > 120
        legend = ax.get_legend().get_window_extent()
        assert legend.x0 >= box.x1 - 1.0  # outside
        assert legend.x1 <= figure.bbox.x1 + 1.0
        styles = {(line.get_color(), line.get_linestyle()) for line in ax.lines}
        assert len(styles) == len(ax.lines)


def test_wishes_that_do_not_go_together_are_refused(run: Any) -> None:
    for call, words in (
        ({"y": "s"}, "needs x="),
        ({"x": "s"}, "no column to draw against it"),
        ({"x": "s", "y": "theta", "kind": "phase"}, "cannot be used together"),
        ({"kind": "phases"}, "did you mean phase"),
        ({"x": "thet", "y": "s"}, "did you mean theta"),
    ):
        with pytest.raises(UsageError, match=words):
            run.plot(**call)
    assert plt.get_fignums() == []


def test_cubics_take_the_later_state_after_a_reset() -> None:
    """A ball that bounces: x = t (1 - t) twice, its rate turned round at t = 1."""
    t = np.array([0.0, 1.0, 1.0, 2.0])
    x = np.array([[0.0, 0.0, 0.0, 0.0]])
    slopes = np.array([[1.0, -1.0, 1.0, -1.0]])
    times = np.linspace(0.0, 2.0, 41)
    part = times % 1.0
    for way in (1.0, -1.0):  # backwards too
        found = cubic_between(way * t, x, way * slopes, way * times)
        assert found[0] == pytest.approx(part * (1.0 - part), abs=1e-14)


def test_names_may_be_given_as_a_list(run: Any) -> None:
    ax = run.plot(["theta", "B"])
    assert [line.get_label() for line in ax.lines] == [r"$\theta$", "$B$"]
    with pytest.raises(UsageError, match="a column must be a name or a list of names, not 3"):
        run.plot(3)
