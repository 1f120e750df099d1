"""Pictures of mechanisms."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

import eomgen as eg
from tools import example, of_page, panels, picture


@picture
def kinematics() -> Any:
    """Both branches of a four-bar."""
    mod = example("four_bar.yaml")
    panels = np.ravel(mod.draw_branches({mod.q_names[0]: mod.x0()[0]}))
    panels[0].figure.set_size_inches(7.2, 3.0)
    plt.setp(panels, xlim=(-0.05, 0.17), ylim=(-0.09, 0.09))
    return panels


@picture
def kinematics_curve() -> Any:
    """Hoecken's straight-line linkage and the way of its coupler point."""
    mod = example("hoecken.yaml")
    motion = mod.kinematic_analysis(t=np.linspace(0, 1, 361))
    figure, ax = panels(size=(7.2, 3.6))
    ax.plot(motion["P_x"], motion["P_y"], color="tab:red", linewidth=1.2)
    mod.draw(motion.q[:, 160], ax=ax, t=motion.t[160])
    ax.set(title="", xlim=(-1.6, 4.6), ylim=(-0.5, 5.6))
    return figure


def parallelogram() -> Any:
    """Four bars of 1 m."""
    m = eg.Model("parallelogram", gravity=(0, -9.81, 0))
    rods = {"mass": 1, "com": (0.5, 0, 0), "inertia": {"zz": 1 / 12}}
    crank, coupler, rocker = (m.body(name, **rods) for name in ("crank", "coupler", "rocker"))
    m.revolute("A", m.ground, crank, coordinate="theta")
    m.revolute("B", crank.at(1, 0, 0), coupler, coordinate="bend")
    m.revolute("D", m.ground.at(1, 0, 0), rocker, coordinate="psi")
    m.revolute("C", coupler.at(1, 0, 0), rocker.at(1, 0, 0))
    m.initial(theta=1.0)
    m.guess(bend=-1.0, psi=1.0)
    return m


@picture
def mobility() -> Any:
    """A parallelogram and its graph of bodies and joints."""
    m = parallelogram()
    figure, (left, right) = panels(1, 2, size=(7.2, 3.4))
    m.compile(target="numpy").draw(ax=left)
    m.check().draw(ax=right)
    left.set_title("")
    right.set_title("")
    return figure


@picture
def constraints() -> Any:
    """A gear pair with a belt, and a cam with its roller."""
    m = eg.Model("gears_and_belt")
    motor, shaft, drum = (m.body(n, mass=1, inertia={"zz": 0.01}) for n in ("motor", "shaft", "drum"))
    m.revolute("A", m.ground, motor)
    m.revolute("B", m.ground.at(0.2, 0, 0), shaft)
    m.revolute("C", m.ground.at(0.6, 0, 0), drum)
    m.gear("mesh", "A", "B", radii=(0.05, 0.15))
    m.belt("strap", "B", "C", radii=(0.06, 0.1))
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.9), width_ratios=(3, 2), layout="constrained")
    m.compile(target="numpy").draw(ax=left)
    example("cam_follower.yaml").draw(ax=right)
    left.set_title("gear and belt", fontsize=10)
    right.set_title("cam and roller", fontsize=10)
    right.locator_params(axis="x", nbins=4)
    return figure


@picture
def forces() -> Any:
    """The landing leg, and the laws of three of its elements."""
    mod = of_page("forces", 0)
    figure = plt.figure(figsize=(7.2, 3.4), layout="constrained")
    drawn = figure.add_subplot(1, 2, 1)
    mod.draw(ax=drawn)
    law = figure.add_subplot(1, 2, 2)
    v = np.linspace(-0.2, 0.2, 801)
    for smoothing in (0.001, 0.01):
        force = (20 + 10 * np.exp(-((v / 0.05) ** 2))) * np.tanh(v / smoothing) + 5 * v
        law.plot(v, -force, label=f"smoothing {smoothing} m/s", linewidth=1.2)
    law.set(xlabel="velocity (m/s)", ylabel="friction force (N)")
    law.legend(frameon=False, fontsize=8)
    return figure


@picture
def reactions() -> Any:
    """Forces in the joints of a slider-crank."""
    run = example("slider_crank.yaml").simulate(0.2, initial={"theta": 0.9, "theta_dot": 20.0})
    with tempfile.TemporaryDirectory() as folder:
        run.animate(Path(folder, "frames"), forces=True, fps=10, dpi=70)
        first = sorted(Path(folder, "frames").glob("*.png"))[0]
        return Image.open(first).convert("RGB")


@picture
def components() -> Any:
    """A Stewart platform: one leg, added six times."""
    ax = example("stewart_platform.yaml").draw()
    ax.figure.set_size_inches(5.0, 4.6)
    return ax


@picture
def joints() -> Any:
    """Joints in a plane and in space."""
    figure = plt.figure(figsize=(7.2, 3.6), layout="constrained")
    example("slider_crank.yaml").draw({"theta": 0.9}, ax=figure.add_subplot(1, 2, 1))
    space = figure.add_subplot(1, 2, 2, projection="3d")
    example("double_wishbone.yaml").draw(ax=space)
    space.set_box_aspect([np.ptp(limits()) for limits in (space.get_xlim, space.get_ylim, space.get_zlim)], zoom=0.85)
    space.locator_params(axis="x", nbins=4)
    return figure


@picture
def model_file() -> Any:
    """The model of the page."""
    return of_page("model_file", 0).draw(ax=panels(size=(4.6, 4.0))[1])


@picture
def pictures() -> Any:
    """Three shipped examples."""
    figure, axes = panels(1, 3, size=(7.2, 3.0))
    for name, ax in zip(("v_twin", "jansen_leg", "excavator"), axes, strict=True):
        example(f"{name}.yaml").draw(ax=ax, names=False)
    return figure


@picture
def python() -> Any:
    """The two halves of a module's use: the mechanism, and a run."""
    mod = example("slider_crank.yaml")
    figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 2.8), width_ratios=(3, 2), layout="constrained")
    mod.draw(ax=left)
    left.set_title("mod.draw()", fontsize=10)
    run = mod.simulate(1.0, t_eval=np.linspace(0, 1, 401))
    right.plot(run.t, run["s"])
    right.set(xlabel="t (s)", ylabel="s (m)")
    right.set_title('run["s"]', fontsize=10)
    return figure


@picture
def robots() -> Any:
    """The arm of the examples."""
    ax = example("arm.urdf").draw({"shoulder": -0.5, "elbow": 1.2})
    ax.figure.set_size_inches(5.0, 4.4)
    return ax


@picture
def generated_code() -> Any:
    """From a model to a package that stands alone."""
    figure, ax = panels(size=(7.2, 1.9))
    boxes = (
        ("model\nYAML, Python, URDF", "#cfe3f3"),
        ("eomgen generate", "#fde2c4"),
        ("package\nC code, Cython layer,\nPython calls, self-test", "#cfe9d6"),
        ("any machine\nwith NumPy", "#e6e6e6"),
    )
    for k, (text, color) in enumerate(boxes):
        look = {"boxstyle": "round,pad=0.6", "facecolor": color, "edgecolor": "0.4"}
        ax.text(k, 0, text, ha="center", va="center", fontsize=8, bbox=look, zorder=2)
    for k in range(len(boxes) - 1):
        ax.annotate("", (k + 0.58, 0), (k + 0.38, 0), arrowprops={"arrowstyle": "->"}, zorder=3)
    ax.set(xlim=(-0.5, 3.5), ylim=(-1, 1))
    ax.axis("off")
    return figure


@picture
def glossary_slider_crank() -> Any:
    """Bodies and joints with their names."""
    return eg.load_example("slider_crank").draw({"theta": 0.9}, ax=panels(size=(4.8, 2.8))[1])


@picture
def theory_body() -> Any:
    """A point of a rigid body, by the place and the axes of the body."""
    figure, ax = panels(size=(6, 3.2))
    angle, origin, u = 0.5, np.array([2.0, 0.9]), np.array([1.6, 0.5])
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    t = np.linspace(0, 2 * np.pi, 200)
    outline = np.array([1.6 * np.cos(t) + 0.8, 0.75 * np.sin(t) + 0.2 + 0.1 * np.sin(3 * t)])
    ax.fill(*(origin[:, None] + axes @ outline), color="#9ecae1", alpha=0.6)
    point = origin + axes @ u
    for start, end, label, color in (
        (np.zeros(2), np.array([1, 0]), "$X$", "black"),
        (np.zeros(2), np.array([0, 1]), "$Y$", "black"),
        (origin, origin + axes[:, 0], r"$\bar X^i$", "#d62728"),
        (origin, origin + axes[:, 1], r"$\bar Y^i$", "#d62728"),
        (np.zeros(2), origin, "", "#555555"),
        (origin, point, "$P$", "#2ca02c"),
    ):
        style = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", end, start, arrowprops=style)
        ax.text(*(end + 0.05), label, color=color, fontsize=13)
    ax.text(0.85, 0.55, r"$\mathbf{R}^i$", fontsize=13, color="#555555")
    ax.text(2.35, 1.75, r"$\mathbf{A}^i\bar{\mathbf{u}}$", fontsize=13, color="#2ca02c")
    ax.set(xlim=(-0.2, 5.2), ylim=(-0.3, 2.9), aspect="equal")
    ax.axis("off")
    return figure
