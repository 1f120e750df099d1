"""Balls at 0.1 to 50 m/s against fixed shapes of 1 mm to 1 m, at default tolerances: how many contacts a run misses.

``python -m benchmarks.short_contacts`` prints a row for each shape and method.  A ball flies on a known parabola until
it touches, so geometry alone says whether it touches and how deep it would get.
"""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple

import numpy as np

import eomgen as eg

KINDS = ("circle", "segment", "polygon")
METHODS = ("DOP853", "RK45", "Radau")
GRAZING = 0.02  #: depth, relative to the thinner of the two, from which on the ball has to be turned


class Shot(NamedTuple):
    """A ball and what it is shot at: parameters of the model, first velocities, seconds of flight."""

    parameters: dict[str, float]
    start: dict[str, float]
    end: float
    depth: float  #: of the parabola at most, relative to the thinner of the two; negative where it passes by


def model(kind: str) -> eg.Model:
    """A ball in the plane and a fixed shape."""
    m = eg.Model(f"shot_at_{kind}", gravity=(0, "-g", 0))
    for name, value in (("g", 9.81), ("r", 0.05), ("size", 0.5), ("thin", 0.001), ("k", 1e6)):
        m.parameter(name, value)
    for name in ("wx", "wy", "wa"):
        m.parameter(name, 0.0)
    ball = m.body("ball", mass=1.0, inertia={"zz": "0.4*r**2"})
    m.planar("j", m.ground, ball)
    at = m.ground.at("wx", "wy", 0, rpy=(0, 0, "wa"))
    shapes: dict[str, dict[str, Any]] = {
        "circle": {"radius": "size/2"},
        "segment": {"length": "size", "radius": "thin/2"},
        "polygon": {"points": [("size/2", 0), (0, "thin/2"), ("-size/2", 0), (0, "-thin/2")]},
    }
    law = {"stiffness": "k", "exponent": 1.5}
    m.contacts("wall", {"shape": "circle", "on": ball, "radius": "r"}, {"shape": kind, "on": at, **shapes[kind]}, law)
    return m


def shot(rng: np.random.Generator, kind: str) -> Shot:
    """A random one, aimed at the shape or beside it; stiff enough that the ball comes back."""
    r, size = 0.5 * 10 ** rng.uniform(-3, 0), 10 ** rng.uniform(-3, 0)
    thin = size * (1.0 if kind == "circle" else 10 ** rng.uniform(-2, -0.3))
    speed, g = 10 ** rng.uniform(-1, np.log10(50)), float(rng.choice((0.0, 9.81)))
    distance, way = 10 ** rng.uniform(-0.5, 1) + r + size, rng.uniform(-np.pi, np.pi)
    place = distance * np.array([np.cos(way), np.sin(way)])
    aside = rng.uniform(-0.7, 0.7) * (r + 0.5 * size) * np.array([-np.sin(way), np.cos(way)])
    time = distance / speed
    velocity = (place + aside) / time + np.array([0.0, 0.5 * g * time])
    fastest, soft = float(np.hypot(*velocity) + 2.0 * g * time), 0.2 * min(2.0 * r, r + 0.5 * thin)
    k = max(1e3, 1.25 * fastest**2 / soft**2.5)  # k d^2.5 / 2.5 is the energy at 0.2 of the thickness
    parameters = {"g": g, "r": r, "size": size, "thin": thin, "k": k, "wa": rng.uniform(-3, 3)}
    parameters |= {"wx": float(place[0]), "wy": float(place[1])}
    t = np.linspace(0.0, 1.5 * time, 400_001)
    x, y = velocity[0] * t, velocity[1] * t - 0.5 * g * t * t
    deepest = float((r - gaps(kind, parameters, x, y)).max())
    start = {"j_x_dot": float(velocity[0]), "j_y_dot": float(velocity[1]), "j_3_dot": rng.uniform(-20, 20)}
    return Shot(parameters, start, 1.5 * time, deepest / min(2.0 * r, thin))


def gaps(kind: str, p: dict[str, float], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Distances of points from the shape, negative inside."""
    c, s = np.cos(p["wa"]), np.sin(p["wa"])
    u, v = np.abs(c * (x - p["wx"]) + s * (y - p["wy"])), np.abs(c * (y - p["wy"]) - s * (x - p["wx"]))
    half, thin = 0.5 * p["size"], 0.5 * p["thin"]
    if kind == "circle":
        return np.asarray(np.hypot(u, v) - half)
    if kind == "segment":
        return np.asarray(np.hypot(np.maximum(u - half, 0.0), v) - thin)
    length = np.hypot(half, thin)  # a quarter of a rhombus
    along = np.clip(((half - u) * half + v * thin) / length**2, 0.0, 1.0)
    outside = np.hypot(u - half + along * half, v - along * thin)
    return np.where(u / half + v / thin < 1.0, -outside, outside)


def judge(module: Any, one: Shot, method: str) -> tuple[float, int]:
    """How much the ball was turned, relative to its speed, and evaluations of the right-hand side."""
    run = module.bind(p=one.parameters).simulate((0, one.end), initial=one.start, method=method)
    end = np.array([run["j_x_dot"][-1], run["j_y_dot"][-1]])
    free = np.array([one.start["j_x_dot"], one.start["j_y_dot"] - one.parameters["g"] * one.end])
    speed = max(np.hypot(one.start["j_x_dot"], one.start["j_y_dot"]), np.hypot(*free))
    return float(np.hypot(*(end - free)) / speed), run.nfev


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shots", type=int, default=100, help="of each kind of shape")
    count = parser.parse_args().shots
    heads = ("shots", "touch", "missed", "evaluations", "free flight")
    print(f"{'shape':10s}{'method':10s}" + "".join(f"{head:>13s}" for head in heads))
    for kind in KINDS:
        module = model(kind).compile()
        rng = np.random.default_rng(3)
        shots = [shot(rng, kind) for _ in range(count)]
        for method in METHODS:
            found = [(one.depth, *judge(module, one, method)) for one in shots]
            deep = [turned for depth, turned, _ in found if depth > GRAZING]
            spent = [[n for depth, _, n in found if (depth > 0) == hit] for hit in (True, False)]
            means = [float(np.mean(n)) if n else 0.0 for n in spent]
            missed = sum(turned < 1e-6 for turned in deep)
            row = f"{kind:10s}{method:10s}{count:13d}{len(deep):13d}{missed:13d}{means[0]:13.0f}{means[1]:13.0f}"
            print(row, flush=True)


if __name__ == "__main__":
    main()
