"""Stage kinematics: constraint rows -> the typical size of each one's residual.

A gap of a joint or contact changes by about as much as the coordinates that make it: its size is that of its kind, the
length scale of the mechanism or 1.  That of a loop far smaller than the mechanism, a thousandth or less, is the length
of its own scaled gradient, or its rows would be lost beside the others.  A relation written by a user may be multiplied
by anything, areas in m^2 or numbers of teeth; its size is the length of its scaled gradient, so that a factor does not
matter (row equilibration: A. van der Sluis, Numerische Mathematik 14, 1969).  Factors that are parameters stay symbols.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..graph.substitute import substitute, symbols_of
from .kinematics import Kinematics

PLAIN = 4.0  #: a row whose gradient is a number within this factor of the kind's size keeps that
SMALL = 1e-3  #: a gap whose gradient is below this part of its kind's size is of a loop that small
LEAST = 1e-3  #: gradients at the initial values that are this part of those beside them vanish there by chance
TINY = 1e-150  #: stands for the size of a row whose factors are all 0


def row_scales(kinematics: Kinematics) -> tuple[Expr, ...]:
    """The size of each row (m,), an expression of parameters."""
    graph, c = kinematics.graph, kinematics.constraints
    sizes = {"length": kinematics.length_scale, "angle": graph.one}
    found = [sizes[kind] for kind in c.kinds]
    places: list[dict[Expr, Expr]] | None = None
    gaps: dict[int, list[Expr]] = {}
    for i, row in enumerate(c.jacobian):
        gradient = [x * sizes[kind] for x, kind in zip(row, kinematics.velocity_kinds, strict=True) if not x.is_zero]
        if not c.written[i]:
            gaps |= {i: gradient} if c.kinds[i] == "length" and gradient else {}
            continue
        if _is_plain([x / found[i] for x in gradient]):
            continue
        if not _moves(kinematics, row):
            found[i] = _length(gradient)
            continue
        places = _places(kinematics) if places is None else places
        there = [_length(substitute(gradient, place)) for place in places]
        values = [x if np.isfinite(x) and x > TINY else 0.0 for x in _values(kinematics, there)]
        if max(values) > 0.0:
            found[i] = there[0] if values[0] >= LEAST * values[1] else there[1]
    if gaps:
        for i, size in _small_gaps(kinematics, gaps, places or _places(kinematics)).items():
            found[i] = size
    return tuple(found)


def _small_gaps(
    kinematics: Kinematics, gaps: Mapping[int, list[Expr]], places: Sequence[dict[Expr, Expr]]
) -> dict[int, Expr]:
    """The own sizes of the rows, with their gradients, that are far below the size of their kind."""
    every = [x for gradient in gaps.values() for x in gradient]
    there = [iter(substitute(every, place)) for place in places]
    sizes = [_length([next(values) for _ in gradient]) for gradient in gaps.values() for values in there]
    *numbers, usual = (x if np.isfinite(x) else np.inf for x in _values(kinematics, [*sizes, kinematics.length_scale]))
    found = {}
    for k, i in enumerate(gaps):
        first, second = numbers[2 * k : 2 * k + 2]
        if TINY < max(first, second) < SMALL * usual:
            found[i] = sizes[2 * k + (first < LEAST * second)]
    return found


def coefficient_rows(kinematics: Kinematics) -> tuple[int, ...]:
    """Rows whose size is the length of a gradient that depends on parameters only."""
    c = kinematics.constraints
    found = []
    for i, row in enumerate(c.jacobian):
        sized = c.written[i] and not symbols_of(row).isdisjoint(kinematics.parameter_names)
        if sized and not _moves(kinematics, row):
            found.append(i)
    return tuple(found)


def _moves(kinematics: Kinematics, row: Sequence[Expr]) -> bool:
    moving = {*kinematics.names, *kinematics.velocity_names, *kinematics.input_names, "t"}
    return not symbols_of(row).isdisjoint(moving)


def _is_plain(gradient: Sequence[Expr]) -> bool:
    values = [x.value for x in gradient]
    numbers = [x for x in values if x is not None]
    return len(numbers) == len(values) and (not numbers or 1 / PLAIN <= float(np.linalg.norm(numbers)) <= PLAIN)


def _length(gradient: Sequence[Expr]) -> Expr:
    total = gradient[0] * gradient[0]
    for x in gradient[1:]:
        total = total + x * x
    graph = total.graph
    return graph.apply("max", graph.apply("sqrt", total), graph.constant(TINY))


def _places(kinematics: Kinematics) -> list[dict[Expr, Expr]]:
    """The initial values, and a place beside them where nothing vanishes by chance."""
    graph, m = kinematics.graph, kinematics.mechanism
    inputs = {graph.symbol(u.name): graph.constant(u.value) for u in m.inputs}
    given = {**m.guess, **m.initial}
    known = dict(zip(given, substitute(list(given.values()), inputs), strict=True))
    unit = {"length": kinematics.length_scale, "angle": graph.one}
    first: dict[Expr, Expr] = {}
    second: dict[Expr, Expr] = {}
    real = {i for i, _ in kinematics.balls}
    for j, (symbol, name, kind) in enumerate(zip(kinematics.q, kinematics.names, kinematics.kinds, strict=True)):
        first[symbol] = known.get(name, graph.one if j in real else graph.zero)
        second[symbol] = first[symbol] + unit.get(kind, graph.one) * (0.3 + 0.07 * j)
    still = {kinematics.t: graph.zero} | dict.fromkeys(kinematics.v, graph.zero) | inputs
    return [first | still, second | still]


def _values(kinematics: Kinematics, sizes: Sequence[Expr]) -> list[float]:
    """Numbers with the declared parameter values, 1 where there is none."""
    m = kinematics.mechanism
    numbers = {p.name: 1.0 if p.value is None else float(p.value) for p in m.parameters}
    with np.errstate(all="ignore"):
        return [float(x) for x in compile_evaluator(list(sizes), tuple(numbers))(list(numbers.values()))]
