"""One robot against its judge: the largest relative differences over random states, in C or in the evaluator."""

from __future__ import annotations

from typing import Any

import numpy as np
from robots.pinocchio_judge import link_frames
from robots.state import State, difference

from eomgen.graph.evaluate import compile_evaluator
from eomgen.program.collect import collect_terms

KERNELS = ["mass_matrix", "bias", "inverse_dynamics", "rhs", "poses", "centroidal"]


class Compiled:
    """A robot's equations as compiled C, called state by state."""

    def __init__(self, equations: Any, **options: Any) -> None:
        self.module = equations.compile(kernels=KERNELS, **options)
        self.body_names = self.module.body_names

    def __call__(self, states: list[State]) -> list[dict[str, np.ndarray]]:
        return [self._at(s) for s in states]

    def _at(self, s: State) -> dict[str, np.ndarray]:
        m = self.module
        u = np.array([s.u[name] for name in m.u_names])
        still, x = np.zeros(m.n_u), np.concatenate([s.q, s.v])
        return {
            "M": m.mass_matrix(s.q),
            "h": m.bias(0.0, x, u=still),
            "inverse": m.inverse_dynamics(s.q, s.v, s.a, u=still),
            "forward": m.rhs(0.0, x, u=u)[m.n_q :],
            "poses": m.poses(s.q),
            "com": m.center_of_mass(s.q),
        }


class Evaluated:
    """The same in NumPy, node by node, for all states at once.

    Forward dynamics as the method has them: its accelerations, or those by a solution with M.
    """

    def __init__(self, equations: Any) -> None:
        terms = collect_terms(equations.kinematics, equations.mobility, equations.tree)
        tree = equations.tree
        self.n, self.u = len(terms.v), terms.u
        self.body_names = tuple(b.name for b in equations.kinematics.mechanism.bodies)
        parts = {
            "M": [x for row in tree.mass_matrix for x in row],
            "h": list(tree.bias),
            "inverse": list(tree.inverse_dynamics),
            "poses": list(terms.poses),
            "com": list(terms.centroidal[:3]),
        }
        self.sizes = {name: len(part) for name, part in parts.items()}
        names = (*terms.q, *terms.v, *terms.a, *terms.u, "t")
        self.run = compile_evaluator([x for part in parts.values() for x in part], names)
        self.accelerate = None if tree.accelerations is None else compile_evaluator(list(tree.accelerations), names)

    def __call__(self, states: list[State]) -> list[dict[str, np.ndarray]]:
        motion = [row for part in _parts(states) for row in np.stack(part, axis=1)]
        still, u = np.zeros(len(self.u)), [np.array([s.u[name] for s in states]) for name in self.u]
        values = _stack(self.run([*motion, *still, 0.0]), len(states))
        found = [self._split(column) for column in values.T]
        forward = None if self.accelerate is None else _stack(self.accelerate([*motion, *u, 0.0]), len(states))
        for k, (s, at) in enumerate(zip(states, found, strict=True)):
            at["forward"] = np.linalg.solve(at["M"], s.tau - at["h"]) if forward is None else forward[:, k]
        return found

    def _split(self, values: np.ndarray) -> dict[str, np.ndarray]:
        found, start = {}, 0
        for name, size in self.sizes.items():
            found[name], start = values[start : start + size], start + size
        found["M"] = found["M"].reshape(self.n, self.n)
        found["poses"] = found["poses"].reshape(-1, 4, 4)
        return found


def _parts(states: list[State]) -> tuple[list[np.ndarray], ...]:
    return [s.q for s in states], [s.v for s in states], [s.a for s in states]


def _stack(values: Any, count: int) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(x, dtype=float), count) for x in values])


def largest_differences(model: Any, run: Any, states: list[State]) -> dict[str, float]:
    """Per quantity, of the largest entry; of accelerations also by max(1, cond(M)/1e3).

    Those of ``scaled`` names once more with each coordinate measured by the root of its inertia, so that light joints
    count as much as heavy ones, and the much smaller condition of M in that measure.
    """
    frames = link_frames(model)
    worst: dict[str, float] = {}
    for s, ours in zip(states, run(states), strict=True):
        condition = max(1.0, np.linalg.cond(s.mass_matrix) / 1e3)
        size = np.sqrt(s.mass_matrix.diagonal())
        scaled = s.mass_matrix / np.outer(size, size)
        found = {
            "M": difference(ours["M"], s.mass_matrix),
            "h": difference(ours["h"], s.bias),
            "inverse": difference(ours["inverse"], s.inverse_dynamics),
            "forward": difference(ours["forward"], s.acceleration) / condition,
            "scaled M": difference(ours["M"] / np.outer(size, size), scaled),
            "scaled h": difference(ours["h"] / size, s.bias / size),
            "scaled forward": difference(ours["forward"] * size, s.acceleration * size)
            / max(1.0, np.linalg.cond(scaled) / 1e3),
            "com": float(np.abs(ours["com"] - s.com).max()),
            "frames": 0.0,
        }
        assert all(np.isfinite(x).all() for x in ours.values())
        assert set(s.frames) <= set(frames)
        for link in s.frames:
            body, at = frames[link]
            pose = at if body is None else ours["poses"][run.body_names.index(body)] @ at
            found["frames"] = max(found["frames"], float(np.abs(pose - s.frames[link]).max()))
        worst = {name: max(worst.get(name, 0.0), value) for name, value in found.items()}
    return worst
