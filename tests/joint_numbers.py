"""Joints as functions of numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mechanisms import make_joint

from eomgen.graph import Graph, evaluate, vectors
from eomgen.joints import JOINTS, Joint


class Numbers:
    """One joint type, evaluated."""

    def __init__(self, kind: str) -> None:
        self.graph = Graph()
        self.names = [f"j{c.suffix}" for c in JOINTS[kind].coordinates]
        self.symbols = [self.graph.symbol(name) for name in self.names]
        self.joint: Joint = make_joint(self.graph, kind, self.names)

    def at(self, q: Sequence[float], *expressions: object) -> np.ndarray:
        """Values of expressions at q."""
        values = dict(zip(self.names, map(float, q), strict=True))
        return np.array(evaluate(list(expressions), values), dtype=float)  # type: ignore[arg-type]

    def pose(self, q: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and position (3,)."""
        rotation, position = self.joint.pose(self.graph, self.symbols)
        flat = self.at(q, *(x for row in rotation for x in row), *position)
        return flat[:9].reshape(3, 3), flat[9:]

    def columns(self, q: Sequence[float]) -> np.ndarray:
        """Motion subspace (6, n): angular, then linear."""
        columns = self.joint.subspace(self.graph, self.symbols)
        return self.at(q, *(x for w, v in columns for x in (*w, *v))).reshape(-1, 6).T

    def relative(self, rotation: np.ndarray, position: np.ndarray, what: str) -> np.ndarray:
        """Closure, measure or aligned of a relative pose given as numbers."""
        R = tuple(tuple(self.graph.constant(x) for x in row) for row in rotation.tolist())
        r = vectors.vector(self.graph, position.tolist())
        if what == "aligned":
            return self.at([0.0] * len(self.names), *self.joint.aligned(R))  # type: ignore[arg-type]
        found = getattr(self.joint, what)(self.graph, R, r)
        return self.at([0.0] * len(self.names), *(e.expression if what == "closure" else e for e in found))
