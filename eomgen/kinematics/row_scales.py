"""Stage kinematics: constraint rows -> the typical size of each one's residual.

A gap of a joint or contact changes by about as much as the coordinates that make it: its size is that of its kind, the
length scale of the mechanism or 1.  That of a loop far smaller than the mechanism, a thousandth or less, is the length
of its own scaled gradient, or its rows would be lost beside the others.  The three rows of a gap in a loop of many
links have the typical length of their columns as their size, or all others would be lost beside them.  A relation
written by a user may be multiplied by anything, areas in m^2 or numbers of teeth; its size is the length of its scaled
gradient, so that a factor does not matter (row equilibration: A. van der Sluis, Numerische Mathematik 14, 1969).  A
gradient that is not told from rounding of the terms that were added in it (:mod:`~..graph.rounding_bounds`) is no size:
such a row counts as nothing beside those terms.  Factors that are parameters stay symbols.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..base.limits.numbers import BY_CHANCE, LARGE_LOOP, ROUNDED, SMALL_LOOP, TINY_ROOT
from ..graph.core import Expr
from ..graph.rounding_bounds import is_rounding, terms_of, with_bounds, with_likely_bounds
from ..graph.substitute import substitute, symbols_of
from ..graph.traverse import reachable
from .kinematics import Kinematics
from .row_groups import row_groups

PLAIN = 4.0  #: a row whose gradient is a number within this factor of the kind's size keeps that


class Length(NamedTuple):
    """The length of a gradient at one place, 0 where it is rounding, and of the terms that were added in it."""

    value: float
    terms: float


def row_scales(kinematics: Kinematics) -> tuple[Expr, ...]:
    """The size of each row (m,), an expression of parameters; found once for each Kinematics."""
    kept: dict[str, tuple[Expr, ...]] = vars(kinematics)
    if "_row_scales" not in kept:
        kept["_row_scales"] = _find_scales(kinematics)
    return kept["_row_scales"]


def _find_scales(kinematics: Kinematics) -> tuple[Expr, ...]:
    graph, c = kinematics.graph, kinematics.constraints
    sizes = {"length": kinematics.length_scale, "angle": graph.one}
    found = [sizes[kind] for kind in c.kinds]
    zero = graph.zero.id
    measured: dict[int, list[Expr]] = {}  # gradients whose lengths are looked at, by row
    for i, row in enumerate(c.jacobian):
        held = ((x, kind) for x, kind in zip(row, kinematics.velocity_kinds, strict=True) if x.id != zero)
        gradient = [x * sizes[kind] for x, kind in held]
        written = c.written[i]
        if not gradient or (not written and c.kinds[i] != "length"):
            continue
        if written and _is_plain([x / found[i] for x in gradient]):
            continue
        if written and not _moves(kinematics, row):
            found[i] = _coefficient_size(gradient)
            continue
        measured[i] = gradient
    if not measured:
        return tuple(found)
    places = _places(kinematics)
    gradients = [[kinematics.length_scale], *measured.values()]
    (usual, *at_first), (_, *at_second) = (_lengths_at(gradients, _numbers(kinematics, place)) for place in places)
    for (i, gradient), first, second in zip(measured.items(), at_first, at_second, strict=True):
        written = c.written[i]
        largest = max(first.value, second.value)
        terms = max(first.terms, second.terms)
        if written and largest <= TINY_ROOT and terms > 0.0:
            found[i] = graph.constant(terms)
        elif written and largest <= TINY_ROOT:  # nothing at the declared values of its factors
            found[i] = _length(substitute(gradient, places[1]))
        elif written or TINY_ROOT < largest < SMALL_LOOP * usual.value:
            place = places[first.value < BY_CHANCE * second.value]
            found[i] = _length(substitute(gradient, place))
    lengths = dict(zip(measured, at_first, strict=True))
    for rows in _gaps(kinematics, measured):
        total = sum(lengths[i].value ** 2 for i in rows)
        if total <= (LARGE_LOOP * usual.value) ** 2:
            continue
        columns = len({k for i in rows for k, x in enumerate(c.jacobian[i]) if not x.is_zero})
        if total > columns * (LARGE_LOOP * usual.value) ** 2:
            typical = _length(substitute([x for i in rows for x in measured[i]], places[0])) * (1.0 / columns**0.5)
            for i in rows:
                found[i] = typical
    return tuple(found)


def _gaps(kinematics: Kinematics, measured: Mapping[int, object]) -> list[list[int]]:
    """The measured rows of each gap."""
    members: dict[int, list[int]] = {}
    for i, group in enumerate(row_groups(kinematics)):
        if group > 0 and i in measured:
            members.setdefault(group, []).append(i)
    return list(members.values())


def _moves(kinematics: Kinematics, row: Sequence[Expr]) -> bool:
    moving = {*kinematics.names, *kinematics.velocity_names, *kinematics.input_names, "t"}
    return not symbols_of(row).isdisjoint(moving)


def _is_plain(gradient: Sequence[Expr]) -> bool:
    values = [x.value for x in gradient]
    numbers = [x for x in values if x is not None]
    return len(numbers) == len(values) and (not numbers or 1 / PLAIN <= float(np.linalg.norm(numbers)) <= PLAIN)


def _coefficient_size(gradient: Sequence[Expr]) -> Expr:
    """The length of a gradient of parameters only, or of its terms where their values make it rounding."""
    size, graph = _length(gradient), gradient[0].graph
    if not any(graph.nodes[i][0] in ("add", "sub") for i in reachable(graph, [x.id for x in gradient])):
        return size
    terms = _length([terms_of(x) for x in gradient])
    return graph.apply("select", graph.apply("lt", terms * ROUNDED, size), size, terms)


def _length(gradient: Sequence[Expr]) -> Expr:
    total = gradient[0] * gradient[0]
    for x in gradient[1:]:
        total = total + x * x
    graph = total.graph
    return graph.apply("max", graph.apply("sqrt", total), graph.constant(TINY_ROOT))


def _places(kinematics: Kinematics) -> list[dict[Expr, Expr]]:
    """The initial values, and a place beside them where nothing vanishes by chance."""
    graph, m = kinematics.graph, kinematics.mechanism
    inputs = {graph.symbol(u.name): graph.constant(u.value) for u in m.inputs}
    given = {**m.guess, **m.initial}
    known = dict(zip(given, substitute(list(given.values()), inputs), strict=True))
    unit = {"length": kinematics.length_scale, "angle": graph.one}
    first: dict[Expr, Expr] = {}
    second: dict[Expr, Expr] = {}
    real = {i for i, _ in kinematics.quaternion_slots}
    for j, (symbol, name, kind) in enumerate(zip(kinematics.q, kinematics.names, kinematics.kinds, strict=True)):
        first[symbol] = known.get(name, graph.one if j in real else graph.zero)
        second[symbol] = first[symbol] + unit.get(kind, graph.one) * (0.3 + 0.07 * j)
    still = {kinematics.t: graph.zero} | dict.fromkeys(kinematics.v, graph.zero) | inputs
    return [first | still, second | still]


def _numbers(kinematics: Kinematics, place: Mapping[Expr, Expr]) -> dict[str, float]:
    """A place in numbers, with the declared parameter values, 1 where there is none."""
    numbers = {p.name: 1.0 if p.value is None else float(p.value) for p in kinematics.mechanism.parameters}
    return numbers | dict(zip((x.node[1] for x in place), with_bounds(list(place.values()), numbers)[0], strict=True))


def _lengths_at(gradients: Sequence[Sequence[Expr]], numbers: Mapping[str, float]) -> list[Length]:
    """The lengths of some gradients at one place; what they share is evaluated once."""
    values, bounds = with_likely_bounds([x for gradient in gradients for x in gradient], numbers)
    ends = np.cumsum([len(gradient) for gradient in gradients])[:-1]
    return [_length_of(*parts) for parts in zip(np.split(values, ends), np.split(bounds, ends), strict=True)]


def _length_of(values: np.ndarray, bounds: np.ndarray) -> Length:
    nothing = not np.isfinite(values).all() or bool(is_rounding(values, bounds).all())
    terms = float(np.linalg.norm(bounds)) if np.isfinite(bounds).all() else 0.0
    return Length(0.0 if nothing else float(np.linalg.norm(values)), terms)
