"""Contact between groups, 40 against 320 shapes: text apart from tables, seconds to compile, microseconds a call.

``python -m benchmarks.contact_groups`` prints the table; ``--scenes N`` runs N random scenes instead and says by how
much energy grew at most.  The circles lie side by side on a floor, each a body of its own, or all on two bodies.
"""

from __future__ import annotations

import argparse
import re
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import eomgen as eg
from eomgen.api.generation import generate

LAW = {"stiffness": 1e5, "dissipation": 0.5, "friction": 0.4, "smoothing": 1e-3}


def on_two_bodies(count: int) -> eg.Model:
    """So many circles on each of two bodies, every one against every one of the other body."""
    m = eg.Model("two", gravity=(0, -9.81, 0))
    groups = []
    for k in range(2):
        body = m.body(f"b{k}", mass=1.0, inertia={"zz": 1.0})
        m.planar(f"j{k}", m.ground.at(0, 0.11 * k, 0), body)
        groups.append({"shape": "circle", "on": [body.at(0.12 * i, 0, 0) for i in range(count)], "radius": 0.06})
    m.contacts("touch", *groups, LAW)
    return m


def on_own_bodies(count: int) -> eg.Model:
    """So many circles, each a body, on a floor and beside each other."""
    m = eg.Model("own", gravity=(0, -9.81, 0))
    bodies = [m.body(f"b{k}", mass=1.0, inertia={"zz": 0.01}) for k in range(count)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground.at(0.12 * k, 0.06, 0), body)
    circles = {"shape": "circle", "on": bodies, "radius": 0.06}
    m.contacts("floor", circles, {"shape": "half_plane", "on": m.ground}, LAW)
    m.contacts("among", circles, law=LAW)
    return m


def text_apart(folder: Path) -> tuple[int, int]:
    """Characters of the C files apart from tables, and of the file of pairs alone."""
    found = {}
    for file in folder.rglob("*.c"):
        text = re.sub(r"(?s)(static )?const \w+ \w+\[\d+\](\[\d+\])? = \{.*?\n\};", "", file.read_text())
        found[file.name] = len(re.sub(r"\d+", "0", re.sub(r"(?s)metadata_texts\[\] = \{.*?\n\};", "", text)))
    return sum(found.values()), sum(n for name, n in found.items() if "_pairs_" in name)


def microseconds(call: Callable[[], Any]) -> float:
    """Median of a call."""
    times = []
    for _ in range(7):
        start = time.perf_counter()
        for _ in range(20):
            call()
        times.append((time.perf_counter() - start) / 20)
    return 1e6 * statistics.median(times)


def table() -> None:
    """Print a row for each scene and size."""
    print(
        f"{'scene':16s}{'shapes':>8s}{'pairs':>9s}{'text':>10s}{'of pairs':>10s}"
        f"{'derive s':>10s}{'compile s':>11s}{'rhs us':>9s}"
    )
    for make, pairs in ((on_two_bodies, lambda n: n * n), (on_own_bodies, lambda n: n + n * (n - 1) // 2)):
        for count in (40, 320):
            m = make(count)
            start = time.perf_counter()
            equations = m.derive()
            derived = time.perf_counter() - start
            whole = own = 0  # of many bodies the text is that of their Jacobians
            if make is on_two_bodies:
                with tempfile.TemporaryDirectory() as folder:
                    whole, own = text_apart(generate(m, folder, target="c"))
            start = time.perf_counter()
            mod = equations.compile(kernels=["rhs"])
            compiled = time.perf_counter() - start
            x = mod.x0()
            call = microseconds(lambda mod=mod, x=x: mod.rhs(0.0, x))  # type: ignore[misc]
            row = f"{make.__name__:16s}{count:8d}{pairs(count):9d}{whole:10d}{own:10d}"
            print(f"{row}{derived:10.2f}{compiled:11.2f}{call:9.1f}", flush=True)


def scenes(count: int) -> None:
    """Throw four shapes at each other in a box, so many times from other states; say by how much energy grew."""
    m = eg.Model("thrown", gravity=(0, -9.81, 0))
    bodies = [m.body(f"b{k}", mass=1.0, inertia={"zz": 0.01}) for k in range(4)]
    for k, body in enumerate(bodies):
        m.planar(f"j{k}", m.ground, body)
    k, mu, loss = m.parameter("k", 1e4), m.parameter("mu", 0.3), m.parameter("loss", 0.2)
    law = {"stiffness": k, "dissipation": loss, "friction": mu, "smoothing": 0.01}
    group = [
        {"shape": "circle", "on": bodies[0], "radius": 0.1},
        {"shape": "box", "on": bodies[1], "size": (0.2, 0.14)},
        {"shape": "polygon", "on": bodies[2], "points": [(0.12, 0.01), (-0.1, 0.1), (-0.08, -0.1)]},
        {"shape": "segment", "on": bodies[3], "length": 0.3, "radius": 0.03},
    ]
    m.contacts("among", group, law=law)
    m.contacts("floor", group, {"shape": "half_plane", "on": m.ground}, law)
    mod = m.compile()
    rng, worst = np.random.default_rng(1), 0.0
    for _ in range(count):
        given = {"k": 10 ** rng.uniform(4, 5), "mu": rng.uniform(0, 1), "loss": rng.uniform(0, 1)}
        start = {f"j{i}_x": 0.4 * (i % 2) for i in range(4)} | {f"j{i}_y": 0.3 + 0.4 * (i // 2) for i in range(4)}
        start |= {f"j{i}_3": rng.uniform(-3, 3) for i in range(4)} | {
            f"j{i}_3_dot": rng.uniform(-5, 5) for i in range(4)
        }
        start |= {f"j{i}_x_dot": (1 - 2 * (i % 2)) * rng.uniform(0, 2) for i in range(4)}
        bound = mod.bind(p=given)
        traj = bound.simulate((0, 0.5), initial=start, rtol=1e-8, atol=1e-10)
        energy = np.sum(bound.energy(np.ascontiguousarray(traj.x)), axis=0)
        worst = max(worst, float(np.diff(energy).max() / np.abs(energy).max()))
    print(f"{count} scenes: energy grew in a step by {worst:.1e} of itself at most")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=0, help="number of random scenes to run")
    given = parser.parse_args()
    scenes(given.scenes) if given.scenes else table()
