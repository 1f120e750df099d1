"""Stage explain, sections: the shown formulas line by line at one state, the comparison with the module, counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from .author import Author, in_numbers, nodes
from .document import Folded, FormulaLine, Piece, Section, Sentence, Table
from .shown_against_module import Difference
from .shown_values import is_rounding, known_values, value_of

LONG = 60  #: nodes of an expression up to which its numbers are put in
MOST = 400  #: lines of the calculation


def calculation(author: Author, state: Mapping[str, float], reason: str, moved: bool = False) -> Section:
    """One state, and every formula that was shown with its numbers.

    Parameters
    ----------
    author : Author
    state : mapping of str to float
        Numbers by name; empty where there are none, for the ``reason``.
    reason : str
    moved : bool
        Whether the independent velocities are 1 in place of the declared ones, which all are 0.
    """
    title = "Numbers: one state, line by line"
    if not state:
        return Section(title, (Sentence(f"No numbers: {reason}"),))
    eqs = author.equations
    k = eqs.kinematics
    names = [*k.names, *k.velocity_names, *k.state_names, *k.parameter_names, *k.input_names]
    rows = tuple(
        (f"${author.symbol(name)}$", f"{state[name]:.6g}")
        for name in names
        if name in state and name not in author.put_in
    )
    numbers = dict(state)
    pieces: list[Piece] = [
        Sentence(
            (
                "The declared initial position and the declared parameters. The declared velocities are all 0, which "
                "would hide most terms; here the independent velocities are 1. "
                if moved
                else "The declared initial state, with closed loops and consistent velocities, and the declared "
                "parameters. "
            )
            + "Each line repeats the left side of a formula, then the formula with its numbers, then its value. A "
            "value that is no more than the rounding of the numbers in it is told as 0."
        ),
        Table(("symbol", "value"), rows),
    ]
    lines: list[Piece] = []
    left_out = 0
    for shown in author.shown:
        try:
            known = known_values(shown.named, numbers)
            found = []
            here = {str(symbol): float(value) for symbol, value in known.items() if isinstance(symbol, sympy.Symbol)}
            for symbol, expression in shown.named:
                found.append(_line(author.printer.latex(symbol), expression, shown.named, here, known, numbers))
            entries = [entry for entry in shown.entries if entry[1].free_symbols]
            found += [_line(left, x, shown.named, here, known, numbers) for left, x in entries]
        except (TypeError, ValueError):  # reactions, variations and momenta have no number of their own
            continue
        room = max(0, MOST - len(lines))
        left_out += max(0, len(found) - room)
        lines += found[:room]
    lines += _accelerations(author, state)
    if left_out:
        lines.append(Sentence(f"{left_out} further lines are left out; the formulas are evaluated all the same below."))
    if len(lines) > 120:
        pieces.append(Folded(f"{len(lines)} lines of the calculation", tuple(lines)))
    else:
        pieces += lines
    return Section(title, tuple(pieces))


def _line(
    left: str,
    expression: Any,
    named: Sequence[tuple[Any, Any]],
    here: dict[str, float],
    known: dict[Any, Any],
    numbers: dict[str, float],
) -> FormulaLine:
    value = float(value_of(expression, known))
    if is_rounding(expression, value, named, numbers):
        value = 0.0
    if nodes(expression) > LONG:
        return FormulaLine((left, value))
    return in_numbers(left, expression, here, value)


def _accelerations(author: Author, state: Mapping[str, float]) -> list[Piece]:
    """The accelerations that the compiled module finds at the state."""
    eqs = author.equations
    names = [n for n in _acceleration_names(eqs) if n in state]
    if not names:
        return []
    told = Sentence("The equations of motion then give the accelerations")
    return [told, *(FormulaLine((author.symbol(name), state[name])) for name in names)]


def _acceleration_names(eqs: Any) -> list[str]:
    from ..kinematics.state import acceleration_name

    return [acceleration_name(name) for name in eqs.kinematics.velocity_names]


def counts(author: Author) -> Section:
    """Operations of each part of the equations."""
    rows = tuple(
        (name, str(c.multiplications), str(c.additions), str(c.divisions), str(c.total))
        for name, c in author.source.operations.items()
    )
    text = f"Operations of each part of the equations of the tree, derived by method `{author.equations.method}`."
    head = ("part", "multiplications", "additions", "divisions", "together")
    return Section("Operations", (Sentence(text), Table(head, rows)))


def difference(found: Difference | None, reason: str) -> Section:
    """How far the shown formulas are from the compiled module."""
    title = "Shown and compiled"
    if found is None:
        return Section(title, (Sentence(f"Not compared: {reason}"),))
    if not found.each:
        return Section(title, (Sentence("There is no formula here that the compiled module has too."),))
    rows = tuple((f"`{name}`", f"{value:.1e}") for name, value in found.each.items())
    text = (
        f"Each of these formulas was evaluated through SymPy at {found.states} random consistent states and "
        f"compared with the "
        f"module that is generated from the same equations. The largest difference, as a share of the largest entry or "
        f"term, is {found.largest:.1e}. Numbers of more digits than are printed are compared with all of them."
    )
    return Section(title, (Sentence(text), Table(("formula", "largest difference"), rows)))
