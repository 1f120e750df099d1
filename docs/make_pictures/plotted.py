"""Pictures of results."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

import eomgen as eg
from tools import DOCS, example, panels, picture


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
def command_line() -> Any:
    """What ``eomgen run slider_crank.yaml --plot`` draws."""
    figure = np.ravel(example("slider_crank.yaml").simulate(1.0).plot())[0].figure
    figure.set_size_inches(7.2, 4.0)
    return figure


@picture
def ensembles() -> Any:
    """Mean, deviation and extremes of many double pendulums."""
    mod = example("double_pendulum.yaml")
    many = mod.simulate_many(
        (0, 5), {"theta1": np.linspace(0.8, 1.0, 200)}, t_eval=np.linspace(0, 5, 101), reduce="statistics"
    )
    figure = np.ravel(many.plot("theta1"))[0].figure
    figure.set_size_inches(7.2, 2.8)
    return figure


@picture
def functions() -> Any:
    """Four kinds of tables through the same points."""
    points, values = np.linspace(0, 6, 7), np.array([0.0, 0.8, 1.0, 1.0, 0.3, 0.2, 0.0])
    figure, ax = panels()
    fine = np.linspace(-0.6, 6.6, 361)
    for kind in ("cubic", "natural", "periodic", "monotone"):
        m = eg.Model("table")
        f = m.table("f", points, values, kind=kind)
        m.prismatic("s", m.ground, m.body("block", mass=1.0), axis="x")
        m.output("value", f(m.coordinate("s")))
        mod = m.compile(target="numpy")
        ax.plot(fine, [mod.outputs(0.0, [s, 0.0])[0] for s in fine], label=kind, linewidth=1.2)
    ax.plot(points, values, "ko", markersize=4)
    ax.set(xlabel="x", ylabel="f(x)")
    ax.legend(frameon=False, fontsize=8)
    return figure


@picture
def method() -> Any:
    """States beside the constraint of a pendulum, and what the projection makes of them."""
    x, y, l = sp.symbols("x y l")
    x_dot, y_dot = sp.symbols("x_dot y_dot")
    m = eg.Model.from_lagrangian(
        "pendulum", (x_dot**2 + y_dot**2) / 2 - 9.81 * y, [x, y], parameters={l: 1.0}, constraints=[x**2 + y**2 - l**2]
    )
    mod = m.compile(target="numpy")
    figure, ax = panels(size=(4.6, 4.2))
    circle = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(circle), np.sin(circle), color="0.6", label="C(q) = 0")
    for k, angle in enumerate(np.linspace(0.2, 2 * np.pi - 0.4, 9)):
        size = 1.0 + 0.25 * (-1) ** k
        start = np.array([size * np.cos(angle), size * np.sin(angle), 0.0, 0.0])
        end = mod.project(start)
        ax.annotate("", end[:2], start[:2], arrowprops={"arrowstyle": "->", "color": "tab:red"})
        ax.plot(*start[:2], "o", color="tab:red", markersize=4, label=None if k else "state x")
        ax.plot(*end[:2], "o", color="tab:blue", markersize=4, label=None if k else "projected state")
    ax.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    ax.legend(frameon=False, fontsize=8, loc="center")
    return figure


@picture
def operations() -> Any:
    """Operations of right-hand sides, from the table of the page."""
    text = (DOCS / "operations.md").read_text(encoding="utf-8")
    found = re.findall(r"\| (\w+) \(URDF\) \| ([\d,]+) \| [\d,]+ \| \d+ \| ([\d,]+) \|", text)
    numbers = [(robot, *(int(n.replace(",", "")) for n in counts)) for robot, *counts in found]
    return bars(numbers, "operations per call", ("eomgen", "CasADi"))


@picture
def speed() -> Any:
    """Times of right-hand sides, from the last measurement."""
    others = ("CasADi, -O3 native", "one at a time")
    rows = measured(r"lanes \| rhs of (\w+), 8 lanes, ns a state")
    found = [(robot, *(ns[who] for who in others), ns["eomgen"]) for robot, ns in rows.items()]
    return bars(found, "ns per state", ("CasADi, -O3 -march=native", "eomgen", "eomgen, 8 lanes"))


def measured(task: str) -> dict[str, dict[str, float]]:
    """Newest numbers in benchmarks/results.md of the tasks that match, by the robot in them and by who was measured."""
    text = (DOCS.parent / "benchmarks" / "results.md").read_text(encoding="utf-8")
    found: dict[str, dict[str, float]] = {}
    for robot, own, others in re.findall(rf"^\| {task} \| ([^|]+) \| ([^|]+) \|", text, re.MULTILINE):
        each = [f"eomgen {own}", *re.sub(r" \([\d.,]+\)", "", others).split("; ")]
        numbers = {who: float(ns.replace(",", "")) for who, ns in (one.rsplit(" ", 1) for one in each)}
        found.setdefault(robot, numbers)
    return found


def bars(found: Sequence[tuple[Any, ...]], label: str, names: Sequence[str]) -> Any:
    """Bars of numbers: a label and a number of each name."""
    figure, ax = panels(size=(6.4, 2.8))
    place = np.arange(len(found))
    for k, name in enumerate(names):
        drawn = ax.bar(place + 0.8 / len(names) * k, [line[k + 1] for line in found], 0.75 / len(names), label=name)
        ax.bar_label(drawn, fmt="{:,.0f}", fontsize=7)
    ax.set_xticks(place + 0.4 - 0.4 / len(names), [line[0] for line in found])
    ax.set(ylabel=label, yscale="log")
    ax.legend(frameon=False, fontsize=8, loc="upper left")
    ax.margins(y=0.25)
    return figure


@picture
def sympy() -> Any:
    """Tension of the pendulum that LagrangesMethod describes, as a multiplier and by hand."""
    x, y = dynamicsymbols("x y")
    m, g, l = sp.symbols("m g l")
    L = m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y
    formed = LagrangesMethod(L, [x, y], hol_coneqs=[x**2 + y**2 - l**2])
    formed.form_lagranges_equations()
    values = {m: 2.0, g: 9.81, l: 1.5}
    model = eg.from_sympy(
        formed, "pendulum", parameters=values, initial={x: 1.5, y: 0}, outputs={"tension": "2*l*lam1"}
    )
    run = model.compile(target="numpy").simulate(5, t_eval=np.linspace(0, 5, 401))
    by_hand = 2.0 * (9.81 * -run["y"] / 1.5 + (run["x_dot"] ** 2 + run["y_dot"] ** 2) / 1.5)
    figure, ax = panels(size=(6.4, 2.6))
    ax.plot(run.t, run["tension"], label="multiplier")
    ax.plot(run.t[::10], by_hand[::10], ".", label="m (g cos + v^2 / l)")
    ax.set(xlabel="t (s)", ylabel="tension (N)", ylim=(-2, 78))
    ax.legend(frameon=False, fontsize=8, loc="upper right", ncols=2)
    return figure


@picture
def verification() -> Any:
    """The checks of a four-bar that come nearest to their limits."""
    worst: dict[str, float] = {}
    for finding in example("four_bar.yaml").verify(seconds=0.0).findings:
        if finding.limit and finding.worst is not None:
            group = finding.check.split(":")[0]
            worst[group] = max(worst.get(group, 1e-6), finding.worst / finding.limit)
    largest = sorted(worst.items(), key=lambda item: -item[1])[:14]
    figure, ax = panels(size=(6.4, 3.2))
    ax.barh([name for name, _ in largest], [value for _, value in largest])
    ax.axvline(1, color="tab:red")
    ax.set(xscale="log", xlabel="largest difference / limit")
    ax.invert_yaxis()
    return figure


@picture
def forms() -> Any:
    """Operations of each method, from the table of the page."""
    text = (DOCS / "forms.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| `(\w+)` \| [^|]*?, (\d+), [^|]* \| [^|]*?, ([\d,]+), [^|]* \|$", text, re.MULTILINE)
    figure, ax = panels(size=(7.2, 2.8))
    place = np.arange(len(found))
    for k, name in enumerate(("slider-crank", "chain of 8 rods")):
        drawn = ax.bar(place + 0.4 * k, [float(line[k + 1].replace(",", "")) for line in found], 0.38, label=name)
        ax.bar_label(drawn, fmt="{:,.0f}", fontsize=7)
    ax.set_xticks(place + 0.2, [line[0] for line in found], fontsize=7)
    ax.set(ylabel="operations", yscale="log")
    ax.margins(y=0.1)
    ax.legend(frameon=False, fontsize=8)
    return figure


@picture
def comparison_robots() -> Any:
    """Times of forward dynamics, from the last measurement."""
    rows, robots = measured(r"rhs \| rhs of (\w+) in C, ns"), ("UR5", "Panda", "ANYmal", "Talos")
    figure, ax = panels(size=(7.5, 3))
    for tool in ("eomgen", "CasADi", "MuJoCo", "Pinocchio from Python"):
        ax.plot([rows[robot][tool] for robot in robots], robots, "o", markersize=9, label=tool)
    ax.set(xscale="log", xlabel="one evaluation of forward dynamics (ns, logarithmic)")
    ax.margins(y=0.2)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure
