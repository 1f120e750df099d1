"""Stage kinematics: a relative rotation about one axis -> its angle as a sum of joint angles, which does not wrap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.limits.numbers import PLANE
from ..graph.core import Expr, Graph, atan2
from ..graph.differentiate import gradient
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import substitute, symbols_of
from ..graph.vectors import Mat3

Turns = tuple[Expr, list[tuple[int, float]]]  #: an angle, and the coordinates in it with their factors
TRIALS = 3  #: random points at which an identity is tried


def sum_of_turns(graph: Graph, rotation: Mat3, q: Sequence[Expr]) -> Turns | None:
    """The angle about z of a rotation that is about z at every q, else None.

    Whether it is, is tried at random values of all symbols: an identity that holds there holds everywhere.

    Returns
    -------
    angle : Expr
        A constant plus coordinates with factors 1 and -1; equal to ``atan2(R_10, R_00)`` up to full turns.
    terms : list of (index into q, factor)
    """
    angle = atan2(rotation[1][0], rotation[0][0])
    places = {x.id: j for j, x in enumerate(q)}
    held = (graph.symbol(name).id for name in symbols_of([angle]))
    turning = sorted(places[i] for i in held if i in places)
    slopes = gradient(angle, [q[j] for j in turning])
    tried = [rotation[2][2], *slopes]
    names = sorted(symbols_of(tried))
    evaluate = compile_evaluator(tried, names)
    random = np.random.default_rng(7)
    found = []
    for _ in range(TRIALS):
        with np.errstate(all="ignore"):
            found.append(np.array(evaluate(random.uniform(0.2, 1.4, len(names))), dtype=float))
    steps = np.round(found[0][1:])
    if any(not abs(x[0] - 1.0) < PLANE or not (np.abs(x[1:] - steps) < PLANE).all() for x in found):
        return None
    terms = [(j, float(step)) for j, step in zip(turning, steps, strict=True) if step]
    start = substitute([angle], {q[j]: graph.zero for j in turning})[0]
    for j, factor in terms:
        start = start + factor * q[j]
    return start, terms
