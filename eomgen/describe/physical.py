"""Stage describe, checks of bodies: masses and inertias that no rigid body can have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..graph.substitute import symbols_of
from ..graph.vectors import Mat3
from ..numeric.inertia import SWITCH, fault_of_inertia
from .description import Faults
from .mechanism import Body


def check_bodies(bodies: Sequence[Body], values: Mapping[str, float], faults: Faults) -> None:
    """Note masses and inertias that no body can have, as far as the declared values of parameters tell."""
    for body in bodies:
        path = f"bodies.{body.name}"
        if not body.checked:
            continue
        mass = _numbers([body.mass], values)
        if mass is not None and mass[0] < 0:
            how = "" if body.mass.value is not None else " at the declared values"
            faults.add(f"{path}.mass", f"is {mass[0]:g}{how}", f"a mass is 0 or positive; {SWITCH}")
        entries = [entry for row in body.inertia for entry in row]
        tensor = _numbers(entries, values)
        if faults.under(f"{path}.inertia"):
            continue
        if not is_symmetric(body.inertia, tensor):
            faults.add(f"{path}.inertia", *ASYMMETRIC)
        elif tensor is not None:
            fault = fault_of_inertia(tensor, None if body.plane is None else _numbers(body.plane, values))
            if fault:
                faults.add(f"{path}.inertia", *fault)


def _numbers(expressions: Sequence[Expr], values: Mapping[str, float]) -> list[float] | None:
    if not symbols_of(expressions) <= values.keys():
        return None
    result = [float(x) for x in evaluate(expressions, values)]
    return result if np.all(np.isfinite(result)) else None


ASYMMETRIC = ("the tensor is not symmetric", "entries [i][j] and [j][i] must be equal")


def is_symmetric(inertia: Mat3, tensor: Sequence[float] | None = None) -> bool:
    """Whether a tensor equals its mirror image: at its values if they are known, else wherever one looks."""
    pairs = [(inertia[i][j], inertia[j][i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    if all(a == b for a, b in pairs):
        return True
    if tensor is not None:
        full = np.reshape(tensor, (3, 3))
        return bool(np.allclose(full, full.T, rtol=1e-9, atol=1e-12 * float(np.max(np.abs(full), initial=0.0))))
    # written differently above and below the diagonal: equal if they agree wherever one looks
    flat = [x for pair in pairs for x in pair]
    names = sorted(symbols_of(flat))
    for seed in (1, 2, 3):
        draws = np.random.default_rng(seed).uniform(0.5, 1.5, len(names))
        result = np.asarray(evaluate(flat, dict(zip(names, draws.tolist(), strict=True))), dtype=float)
        if not np.allclose(result[::2], result[1::2], rtol=1e-9, atol=1e-12):
            return False
    return True
