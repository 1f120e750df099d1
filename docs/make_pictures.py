"""The pictures of the documentation, made from models by eomgen's public calls.

``python docs/make_pictures.py`` writes all of them to ``docs/pictures``; names after it choose some.
"""

from __future__ import annotations

import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("agg")
import matplotlib.pyplot as plt
from PIL import Image

import eomgen as eg

HERE = Path(__file__).parent
EXAMPLES = HERE.parent / "examples"
LARGEST = 60_000  #: bytes of one picture
PICTURES: dict[str, Callable[[], Any]] = {}


def picture(make: Callable[[], Any]) -> Callable[[], Any]:
    """Register a function that returns a figure or axes; the picture has its name."""
    PICTURES[make.__name__] = make
    return make


def example(name: str, **options: Any) -> Any:
    """A shipped model, compiled."""
    return eg.load(EXAMPLES / name, **options).compile()


def panels(*shape: int, size: tuple[float, float] = (7.2, 2.8)) -> tuple[Any, Any]:
    """An empty figure and its axes."""
    return plt.subplots(*shape, figsize=size, layout="constrained")


@picture
def simulation() -> Any:
    """Steps of DOP853 on a double pendulum."""
    run = example("double_pendulum.yaml").simulate(5, {"theta1": 0.5}, rtol=1e-9, dense_output=True)
    figure, ax = panels()
    fine = np.linspace(0, 5, 1001)
    for column in ("theta1", "bend"):
        (line,) = ax.plot(fine, run.at(fine)[column], linewidth=1.2, label=column)
        ax.plot(run.t, run[column], ".", color=line.get_color())
    ax.set(xlabel="t (s)", ylabel="angle (rad)")
    ax.legend(frameon=False, loc="lower left")
    return figure


@picture
def inputs() -> Any:
    """One table of an input, read in three ways."""
    m = eg.Model("cart")
    m.prismatic("rail", m.ground, m.body("cart", mass=1.0), axis="x", coordinate="s")
    m.torque("motor", "rail", m.input("push"))
    mod = m.compile(target="numpy")
    times, values = [0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 1.0, -0.5, 0.3, 0.2]
    figure, (left, right) = panels(1, 2)
    fine = np.linspace(0, 2, 401)
    for kind in ("linear", "zero-order", "cubic"):
        run = mod.simulate(2, inputs={"push": eg.Signal(times, values, kind)}, t_eval=fine)
        left.plot(run.t, run["push"], label=kind)
        right.plot(run.t, run["s"])
    left.plot(times, values, "ko", markersize=4)
    left.set(xlabel="t (s)", ylabel="push (N)")
    right.set(xlabel="t (s)", ylabel="s (m)")
    left.legend(frameon=False, fontsize=8)
    return figure


@picture
def events() -> Any:
    """A ball that bounces."""
    m = eg.Model("ball", gravity=(0, -9.81, 0))
    m.prismatic("J", m.ground, m.body("ball", mass=1.0), axis="y", coordinate="h")
    m.initial(h=1.0)
    m.event("floor", "h", direction=-1, reset={"h_dot": "-0.8*h_dot"})
    m.event("apex", "h_dot", direction=-1)
    run = m.compile(target="numpy").simulate(2.5, max_step=0.01)
    figure, ax = panels()
    ax.plot(run.t, run["h"], linewidth=1.2)
    ax.axhline(0, color="0.4", linewidth=1)
    for name, mark in (("floor", "v"), ("apex", "^")):
        ax.plot(run.t_events[name], run.x_events[name][0], mark, label=name)
    ax.set(xlabel="t (s)", ylabel="h (m)")
    ax.legend(frameon=False, loc="upper right")
    return figure


@picture
def kinematics() -> Any:
    """Both branches of a four-bar."""
    mod = example("four_bar.yaml")
    panels = np.ravel(mod.draw_branches({mod.q_names[0]: mod.x0()[0]}))
    panels[0].figure.set_size_inches(7.2, 3.0)
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


@picture
def kinematics_workspace() -> Any:
    """What the tip of a two-link arm reaches."""
    robot = eg.Model("arm")
    upper, lower = (robot.body(name, mass=1, inertia={"zz": 0.1}) for name in ("upper", "lower"))
    robot.revolute("shoulder", robot.ground, upper, coordinate="q1")
    robot.revolute("elbow", upper.at(0.5, 0, 0), lower, coordinate="q2")
    tip = lower.marker("tip", at=(0.3, 0, 0))
    robot.output("tip_x", tip.position[0])
    robot.output("tip_y", tip.position[1])
    robot.initial(q2=0.5)
    mod = robot.compile(target="numpy")
    ws = mod.workspace({"q1": (0, np.pi / 2, 31), "q2": (0, np.pi, 41)}, of=["tip_x", "tip_y"])
    made = ws.plot()
    figure = np.ravel(made)[0].figure
    figure.set_size_inches(5.2, 4.0)
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
    return figure


@picture
def analyses() -> Any:
    """The four-bar of the IFToMM benchmark in equilibrium, and its eigenvalues over the damping."""
    m = eg.Model("four_bar", gravity=(0, -9.81, 0))
    c = m.parameter("c", 1.0)
    left, top, right = (m.body(n, mass=1, com=(0.5, 0, 0), inertia={"zz": 1 / 12}) for n in ("left", "top", "right"))
    m.revolute("A", m.ground, left, coordinate="phi")
    m.revolute("B", left.at(1, 0, 0), top, coordinate="bend")
    m.revolute("C", top.at(1, 0, 0), right.at(1, 0, 0))
    m.revolute("D", m.ground.at(1, 0, 0), right, coordinate="psi")
    m.spring("diagonal", m.ground, right.at(1, 0, 0), stiffness=25.0, length=np.sqrt(2))
    m.damper("drag", m.ground, right.at(1, 0, 0), damping=c)
    m.independent("phi")
    m.initial(phi=2.0)
    m.guess(bend=-2.0, psi=2.0)
    mod = m.compile(target="numpy")
    figure, (drawn, plane) = panels(1, 2, size=(7.2, 3.2))
    rest = mod.equilibrium()
    mod.draw(rest.x, ax=drawn)
    drawn.set_title("equilibrium", fontsize=10)
    for damping in np.linspace(0, 12, 25):
        roots = mod.bind(p={"c": damping}).linearize(rest.x).eigenvalues
        shown = plane.scatter(roots.real, roots.imag, c=[damping] * 2, s=14, vmin=0, vmax=12, cmap="viridis")
    figure.colorbar(shown, ax=plane, label="damping (N s/m)")
    plane.axvline(0, color="0.6", linewidth=0.8)
    plane.set(xlabel="real part (1/s)", ylabel="imaginary part (rad/s)")
    plane.set_title("eigenvalues", fontsize=10)
    return figure


@picture
def forces() -> Any:
    """The landing leg, and the laws of three of its elements."""
    page = (HERE / "forces.md").read_text(encoding="utf-8")
    text = page.partition("```yaml\n")[2].partition("```")[0]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "leg.yaml")
        file.write_text(text, encoding="utf-8")
        mod = eg.load(file).compile(target="numpy")
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


def write(name: str) -> None:
    """Make one picture and store it in few colours."""
    made = PICTURES[name]()
    figure = made if hasattr(made, "savefig") else np.ravel(made)[0].figure
    memory = io.BytesIO()
    figure.savefig(memory, dpi=100)
    plt.close("all")
    colors = Image.open(memory).convert("RGB").quantize(128, dither=Image.Dither.NONE)
    path = HERE / "pictures" / f"{name}.png"
    path.parent.mkdir(exist_ok=True)
    colors.save(path, optimize=True)
    size = path.stat().st_size
    print(f"{path.relative_to(HERE.parent)}  {size / 1000:.0f} kB")
    if size > LARGEST:
        raise SystemExit(f"{path.name} has {size} bytes, more than {LARGEST}")


if __name__ == "__main__":
    for chosen in sys.argv[1:] or PICTURES:
        write(chosen)
