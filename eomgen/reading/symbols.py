"""Names of unknowns that a model leaves free, and values that users give for names, as expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..base.texts import acceleration_name
from ..errors import ExpressionError, UsageError, at_odds, ill_typed
from ..expr.core import Expr, Graph, reachable, substitute, symbols_of
from ..expr.evaluate import evaluate
from ..expr.notation import Notation
from ..expr.texts import quoted
from ..mechanics import Kinematics
from ..model.expressions import parse
from ..model.sympy_face import free_names, is_sympy, lower_sympy, name_of, symbol
from ..model.values import MULTIPLIERS, numbered
from ..model.visit import rewritten
from ..runtime.argument_checks import unknown

# -- names of unknowns -------------------------------------------------------------------------------------------------

# A parameter ``p_theta`` is another thing than the momentum of theta, and ``lambda1`` is printed as ``lambda_1`` is.
# Where a name of the model is or is printed as the usual name, a longer word takes its place: ``momentum_theta``.


def model_notation(kinematics: Kinematics, more: Iterable[str] = ()) -> Notation:
    """How the names of a model are printed, and further names after them."""
    k, m = kinematics, kinematics.mechanism
    velocities = [*k.velocity_names, *k.state_names]
    rates = [*velocities, *map(acceleration_name, velocities)]
    outputs = [output.name for output in m.outputs]
    outputs += m.given.multipliers if m.given is not None else ()
    names = [*k.names, *k.loop_coordinates.names, *k.parameter_names, *k.input_names, *outputs, *rates, *more]
    return Notation(names, m.presentation.latex, m.presentation.instances)


def momentum_names(kinematics: Kinematics) -> tuple[str, ...]:
    """``p_theta``, ...: what momenta are called, one a velocity."""
    return _free(kinematics, ("p", "momentum"), lambda p: [f"{p}_{label}" for label in kinematics.velocity_labels])


def multiplier_names(kinematics: Kinematics, count: int) -> tuple[str, ...]:
    """``lambda_1``, ...: what multipliers of constraint equations are called, unless given equations name them."""
    equations = kinematics.mechanism.given
    if equations is not None and count == len(equations.multipliers):
        return equations.multipliers
    return _free(kinematics, MULTIPLIERS, lambda word: numbered(word, count))


def wrench_names(kinematics: Kinematics, joint: str) -> tuple[str, ...]:
    """``A_M_x``, ..., ``A_F_x``, ...: components of the moment and of the force of a joint."""
    moment = _free(kinematics, ("M", "moment"), lambda word: _axes(f"{joint}_{word}"))
    return (*moment, *_free(kinematics, ("F", "force"), lambda word: _axes(f"{joint}_{word}")))


def twist_rate_names(kinematics: Kinematics, body: str) -> tuple[str, ...]:
    """``rod_alpha_x``, ..., ``rod_a_x``, ...: components of the rate of a body's twist."""
    turning = _free(kinematics, ("alpha", "angular"), lambda word: _axes(f"{body}_{word}"))
    return (*turning, *_free(kinematics, ("a", "linear"), lambda word: _axes(f"{body}_{word}")))


def _axes(stem: str) -> list[str]:
    return [f"{stem}_{axis}" for axis in "xyz"]


def _free(kinematics: Kinematics, labels: Sequence[str], names: Callable[[str], list[str]]) -> tuple[str, ...]:
    """The names with the first word with which they are free."""
    notation = model_notation(kinematics)
    taken = {form for name in notation.names for form in (notation.latex(name), notation.text(name))}
    word, *others = labels
    while True:
        result = names(word)
        forms = {form for name in result for form in (notation.latex(name), notation.text(name))}
        if taken.isdisjoint(forms) and set(result).isdisjoint(notation.names):
            return tuple(result)
        word, others = (others[0], others[1:]) if others else (f"{word}_", [])


# -- values for names --------------------------------------------------------------------------------------------------


QUARTER = "quarter()"  #: symbol of a quarter of a turn during substitution


def read_value(graph: Graph, name: str, value: Any) -> Expr:
    """The expression of a number, a text or a SymPy expression; functions of time stand for what they are called."""
    try:
        if isinstance(value, str):
            return parse(value, graph, graph.symbol)
        if is_sympy(value):
            return lower_sympy(graph, value, graph.symbol)
        return graph.constant(float(value))
    except ExpressionError as error:
        raise UsageError(f"{name}: {error}", code="EG-EXPRESSION") from None
    except (TypeError, ValueError, OverflowError):
        raise ill_typed(f"{name} must be a number, a text or a SymPy expression, not {quoted(value)}") from None


def read_values(by_name: Any, allowed: Sequence[str], what: str, plain: Callable[[str], str]) -> dict[str, Any]:
    """Values by name; refused are unknown names, those given twice, and values that are no expressions.

    ``what`` is what the names are, in messages; ``plain`` makes ``left_hinge`` of ``left.hinge`` in an instance of a
    component.
    """
    if not isinstance(by_name, Mapping):
        raise ill_typed(f"values are given by name, as a mapping does, not {quoted(by_name)}")
    values: dict[str, Any] = {}
    for key, value in by_name.items():
        name = name_of(key)
        name = plain(name) if isinstance(name, str) and name not in allowed else name
        if name not in allowed:
            raise unknown(what, name, allowed)
        if name in values:
            raise at_odds(f"{what} {name!r} is given twice; give it one value")
        values[name] = _without_dots(value, plain)
        read_value(Graph(), name, values[name])
    return values


def _without_dots(value: Any, plain: Callable[[str], str]) -> Any:
    """A value whose names of instances have no dots."""
    if isinstance(value, str):
        return rewritten(value, plain, str)
    if not is_sympy(value):
        return value
    return value.xreplace({symbol(name): symbol(plain(name)) for name in free_names([value]) if "." in name})


def substitute_values(expressions: Sequence[Expr], values: Mapping[str, Any]) -> list[Expr]:
    """The expressions with values in the place of names, all at once; the graph simplifies what follows.

    Sines and cosines of quarter turns come out as 0, 1 and -1, which those of doubles would miss by rounding.
    """
    if not expressions or not values:
        return list(expressions)
    graph = expressions[0].graph
    quarter = graph.symbol(QUARTER)
    read = [read_value(graph, name, value) for name, value in values.items()]
    read = substitute(read, {x: k * quarter for x, k in _quarters(read)})
    result = substitute(expressions, dict(zip(map(graph.symbol, values), read, strict=True)))
    return substitute(_turned(result), {quarter: graph.constant(math.pi / 2)})


def _quarters(expressions: Sequence[Expr]) -> list[tuple[Expr, float]]:
    """Constants that are a few quarters of a turn, and how many."""
    graph = expressions[0].graph
    constants = [i for i in reachable(graph, (x.id for x in expressions)) if graph.nodes[i][0] == "const"]
    counts = [(i, round(graph.nodes[i][1] / (math.pi / 2))) for i in constants]
    return [(Expr(graph, i), float(k)) for i, k in counts if 0 < abs(k) <= 8 and graph.nodes[i][1] == k * math.pi / 2]


def _turned(expressions: Sequence[Expr]) -> list[Expr]:
    """Sines and cosines of whole numbers of quarter turns, exactly."""
    graph = expressions[0].graph
    exact: dict[Expr, Expr] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation, *operands = graph.nodes[i]
        if operation not in ("sin", "cos") or symbols_of([argument := Expr(graph, operands[0])]) != {QUARTER}:
            continue
        turns = float(evaluate([argument], {QUARTER: 1.0})[0])  # numbers beside it would not come out whole
        straight = float(evaluate([argument], {QUARTER: 0.0})[0])
        if straight == 0.0 and turns.is_integer():
            k = int(turns) % 4
            value = (0.0, 1.0, 0.0, -1.0)[k] if operation == "sin" else (1.0, 0.0, -1.0, 0.0)[k]
            exact[Expr(graph, i)] = graph.constant(value)
    return substitute(expressions, exact)
