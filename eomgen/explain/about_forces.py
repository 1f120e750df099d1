"""Stage explain, sections: the law, the virtual work and the generalized forces of each force element."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import sympy

from ..describe.build_switches import CLOSES, OPENS
from ..describe.mechanism import Switched
from ..errors import UnavailableError
from ..graph.core import Expr
from .author import Author
from .document import FormulaLine, Piece, Section, Sentence

MANY = 12  #: force elements from which those of one type share one sentence


def forces(author: Author) -> list[Section]:
    """A section of all forces and one of each element."""
    eqs, m = author.equations, author.mechanism
    if m.bare:
        return []
    try:
        named, total = eqs.written("generalized_forces")
    except UnavailableError:
        return []
    parts = total.parts
    if not eqs.mobility.n_dof or not parts:
        text = "There are no degrees of freedom for forces to act on." if parts else "No forces act."
        return [Section("Forces", (Sentence(text),))]
    text = (
        "The virtual work of an element is $\\delta W = \\mathbf{Q}^T \\delta \\mathbf{q}_i$; the factors of "
        "the variations of "
        "the independent coordinates are its generalized forces."
    )
    found = [Section("Forces and their virtual work", (Sentence(text),))]
    elements = {force.name: force for force in m.forces}
    for name, column in parts.items():
        pieces = _law(author, elements[name]) if name in elements else _weight(author, name)
        if not any(x != 0 for x in column):
            pieces.append(Sentence("Its virtual work vanishes: it does not act along the independent coordinates."))
        else:
            left = author.of(r"\delta W", name)
            pieces += author.formulas(left, _work(author, column), named, ("generalized_forces", name))
        found.append(Section(f"`{name}`", tuple(pieces), level=2))
    return found


def states(author: Author) -> Section | None:
    """The rates of the first-order states, None without any."""
    k = author.equations.kinematics
    held = {name for clock in k.mechanism.clocks for name in (*clock.states, clock.counter)}
    rates = [(name, x) for name, x in zip(k.state_names, k.state_rates, strict=True) if name not in held]
    if not k.state_names:
        return None
    text = "Beside the coordinates and velocities the model has states of its own, with these equations of first order."
    pieces: list[Piece] = [Sentence(text), *_lines(author, "rates of first-order states", rates, "S_", "_dot")]
    if k.sampled:
        told = (
            "These states are sampled: they keep their values until the time t, where they become, one after the other,"
        )
        pieces = pieces if rates else []
        pieces += [Sentence(told), *_lines(author, "new values of sampled states", k.sampled, "D_")]
        counters = ", ".join(f"`{clock.counter}`" for clock in k.mechanism.clocks)
        pieces.append(Sentence(f"Each time {counters} grows by 1."))
    return Section("First-order states", tuple(pieces))


def _lines(
    author: Author, what: str, pairs: Sequence[tuple[str, Expr]], prefix: str, suffix: str = ""
) -> Iterator[Piece]:
    """Named quantities and their formulas, after what stands in these."""
    written = author.write(what, [x for _, x in pairs], prefix)
    author.printer.meet(str(symbol) for symbol, _ in written.intermediates)
    yield from (FormulaLine((author.printer.latex(s), x)) for s, x in written.intermediates)
    left = (author.symbol(f"{name}{suffix}") for name, _ in pairs)
    yield from (FormulaLine(pair) for pair in zip(left, written.expressions, strict=True))


def _work(author: Author, column: Any) -> Any:
    """Q^T delta q_i as a sum."""
    total = zip(column, author.equations.independent, strict=True)
    return sympy.Add(*(x * author.variation(name) for x, name in total))


def _weight(author: Author, name: str) -> list[Piece]:
    """Gravity, and other parts that are no elements."""
    for switch in author.mechanism.switched:
        if switch.constraint is not None and switch.constraint.name == name:
            return _held(author, name, switch)
    if name != "gravity":
        return [Sentence(f"`{name}` of the model.")]
    gravity = author.write("gravity", list(author.mechanism.gravity)).expressions
    return [
        Sentence(
            "The weight of each body acts at its centre of mass, $\\delta W = m \\mathbf{g}^T \\delta "
            "\\mathbf{r}_c$, with "
            "the field of gravity in ground axes"
        ),
        FormulaLine((r"\mathbf{g}", sympy.Matrix(3, 1, gravity))),
    ]


def _held(author: Author, name: str, switch: Switched) -> list[Piece]:
    """What a constraint that closes and opens demands, and when."""
    assert switch.constraint is not None
    events = {event.name: event for event in author.mechanism.events}
    told = f"{switch.constraint.sentence} This holds for a time, while `{switch.state}` is 1; else its force is 0."
    pieces: list[Piece] = [Sentence(told)]
    for ending, what in ((CLOSES, "It closes by a plastic impact"), (OPENS, "It opens")):
        if (event := events.get(f"{name}{ending}")) is not None:
            (value,) = author.write("events", [event.expression]).expressions
            pieces += [
                Sentence(f"{what} where this falls to 0:"),
                FormulaLine((rf"\mathrm{{{what.split()[1]}}}", value)),
            ]
    return pieces


def _law(author: Author, force: Any) -> list[Piece]:
    """The sentence and the formula of an element's type, and what its letters are."""
    pieces: list[Piece] = [Sentence(" ".join([force.sentence, *(f"${formula}$" for formula in force.formulas)]))]
    for part in (force, *force.laws):
        for key, value in vars(part).items():
            if isinstance(value, Expr) and not key.startswith("_"):
                (expression,) = author.write("laws of force elements", [value]).expressions
                pieces.append(FormulaLine((rf"\mathrm{{{key.replace('_', '.')}}}", expression)))
    return pieces
