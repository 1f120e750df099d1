"""Robots, balls and free joints: the rotation vector of their stiffness -> expressions of a model file.

MuJoCo resists by -d w - k theta: w is the angular velocity, theta the rotation vector from the pose at rest, of at most
half a turn, both in the axes of the child.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..rotations import euler_parameters_from_matrix

_QUATERNION = ("_e0", "_e1", "_e2", "_e3")


def turn_texts(name: str, in_parameters: bool, rest: np.ndarray) -> list[str]:
    """The rotation vector from the pose at rest, in the axes of the child.

    ``name`` begins its coordinates, Euler parameters or angles x-y'-z''; ``rest`` is the rotation (3, 3) at rest.
    """
    if in_parameters:
        raw = [name + suffix for suffix in _QUATERNION]
        size = f"sqrt({' + '.join(f'{x}**2' for x in raw)})"  # 1, but for what an integrator makes of it
        e = [f"({x}/{size})" for x in raw]
    else:
        a, b, c = (f"{name}_{k}" for k in (1, 2, 3))
        (ca, cb, cc), (sa, sb, sc) = ([f"{f}({q}/2)" for q in (a, b, c)] for f in ("cos", "sin"))
        e = [
            f"({ca}*{cb}*{cc} - {sa}*{sb}*{sc})",
            f"({sa}*{cb}*{cc} + {ca}*{sb}*{sc})",
            f"({ca}*{sb}*{cc} - {sa}*{cb}*{sc})",
            f"({ca}*{cb}*{sc} + {sa}*{sb}*{cc})",
        ]
    r0, r1, r2, r3 = (float(x) for x in euler_parameters_from_matrix(rest))
    # the conjugate of the rest times e
    p = [_sum((r0, r1, r2, r3), e)]
    p += [_sum(row, e) for row in ((-r1, r0, r3, -r2), (-r2, -r3, r0, r1), (-r3, r2, -r1, r0))]
    square = f"(1 - ({p[0]})**2)"  # sin(phi/2)^2; near 0 the series of phi / sin(phi/2)
    series = f"2 + {square}/3 + 3*{square}**2/20 + 5*{square}**3/56"
    exact = f"2*atan2(sqrt({square}), abs({p[0]}))/sqrt({square})"
    factor = f"where({p[0]} < 0, -1, 1)*where({square} < 1e-3, {series}, {exact})"
    return [f"({x})*{factor}" for x in p[1:]]


def _sum(factors: Sequence[float], terms: Sequence[str]) -> str:
    """The sum of the terms whose factors are not zero."""
    kept = [(f, x) for f, x in zip(factors, terms, strict=True) if f]
    return " + ".join(x if f == 1.0 else f"({f!r})*{x}" for f, x in kept) or "0"
