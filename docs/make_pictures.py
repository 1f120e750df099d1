"""The pictures of the documentation, made from models by eomgen's public calls.

``python docs/make_pictures.py`` writes all of them to ``docs/pictures``; names after it choose some.
"""

from __future__ import annotations

import io
import sys
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
    times, values = [0.0, 0.3, 0.5, 2.0], [0.0, 1.0, -0.5, 0.2]
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


def write(name: str) -> None:
    """Make one picture and store it in few colours."""
    made = PICTURES[name]()
    figure = made if hasattr(made, "savefig") else np.ravel(made)[0].figure
    memory = io.BytesIO()
    figure.savefig(memory, dpi=100)
    plt.close("all")
    colors = Image.open(memory).convert("RGB").quantize(64, dither=Image.Dither.NONE)
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
