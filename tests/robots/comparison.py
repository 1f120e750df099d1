"""One robot against its judge: the largest relative differences over random states, in C or in the evaluator."""

from __future__ import annotations

from typing import Any

import numpy as np
from robots.pinocchio_judge import State, centre_of_mass, difference, link_frames

from eomgen.graph.evaluate import compile_evaluator
from eomgen.program.collect import collect_terms

KERNELS = ["mass_matrix", "bias", "inverse_dynamics", "rhs", "poses"]


class Compiled:
    """A robot's equations as compiled C."""

    def __init__(self, equations: Any, **options: Any) -> None:
        self.module = equations.compile(kernels=KERNELS, **options)
        self.body_names = self.module.body_names

    def __call__(self, s: State) -> dict[str, np.ndarray]:
        m = self.module
        u = np.array([s.u[name] for name in m.u_names])
        still, x = np.zeros(m.n_u), np.concatenate([s.q, s.v])
        return {
            "M": m.mass_matrix(s.q),
            "h": m.bias(0.0, x, u=still),
            "inverse": m.inverse_dynamics(s.q, s.v, s.a, u=still),
            "forward": m.rhs(0.0, x, u=u)[m.n_q :],
            "poses": m.poses(s.q),
        }


class Evaluated:
    """The same in NumPy, node by node; forward dynamics by solving with M."""

    def __init__(self, equations: Any) -> None:
        terms = collect_terms(equations.kinematics, equations.mobility, equations.tree)
        tree = equations.tree
        self.n, self.u = len(terms.q), terms.u
        self.body_names = tuple(b.name for b in equations.kinematics.mechanism.bodies)
        parts = {
            "M": [x for row in tree.mass_matrix for x in row],
            "h": list(tree.bias),
            "inverse": list(tree.inverse_dynamics),
            "poses": list(terms.poses),
        }
        self.sizes = {name: len(part) for name, part in parts.items()}
        names = (*terms.q, *terms.v, *terms.a, *terms.u, "t")
        self.run = compile_evaluator([x for part in parts.values() for x in part], names)

    def __call__(self, s: State) -> dict[str, np.ndarray]:
        values = np.array(self.run([*s.q, *s.v, *s.a, *np.zeros(len(self.u)), 0.0]), dtype=float)
        found, start = {}, 0
        for name, size in self.sizes.items():
            found[name], start = values[start : start + size], start + size
        found["M"] = found["M"].reshape(self.n, self.n)
        found["poses"] = found["poses"].reshape(-1, 4, 4)
        found["forward"] = np.linalg.solve(found["M"], s.tau - found["h"])
        return found


def largest_differences(model: Any, run: Any, states: list[State]) -> dict[str, float]:
    """Per quantity; accelerations as CONTRACT has it: of max|v'| and max(1, cond(M)/1e3)."""
    frames = link_frames(model)
    worst: dict[str, float] = {}
    for s in states:
        ours = run(s)
        condition = max(1.0, np.linalg.cond(s.mass_matrix) / 1e3)
        found = {
            "M": difference(ours["M"], s.mass_matrix),
            "h": difference(ours["h"], s.bias),
            "inverse": difference(ours["inverse"], s.inverse_dynamics),
            "forward": difference(ours["forward"], s.acceleration) / condition,
            "com": float(np.abs(centre_of_mass(model, ours["poses"], run.body_names) - s.com).max()),
            "frames": 0.0,
        }
        assert set(s.frames) <= set(frames)
        for link in s.frames:
            body, at = frames[link]
            pose = at if body is None else ours["poses"][run.body_names.index(body)] @ at
            found["frames"] = max(found["frames"], float(np.abs(pose - s.frames[link]).max()))
        worst = {name: max(worst.get(name, 0.0), value) for name, value in found.items()}
    return worst
