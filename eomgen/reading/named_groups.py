"""Stage reading, groups: named parts of equations -> groups of one meaning, in an order in which each can be read."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from enum import IntEnum
from typing import Any

import sympy


class PartMeaning(IntEnum):
    """What a named part is, in the order in which parts are told."""

    CONSTANT = 0  #: of parameters alone
    TURN = 1  #: sine or cosine
    ROTATION = 2
    POSITION = 3  #: of what bodies and constraints share
    INERTIA = 4  #: of the mass matrix
    CONSTRAINT = 5  #: of the Jacobian of the constraints
    ANGULAR_VELOCITY = 6
    VELOCITY = 7  #: of what bodies and constraints share
    FORCE = 8  #: of the right side
    CONSTRAINT_RATE = 9  #: of gamma


#: Names that tell what they are: ``R_rod_12``, ``omega_rod_x``.
NAMES = (
    (re.compile(r"R_(?:.+_)?[123]{2}"), PartMeaning.ROTATION),
    (re.compile(r"omega_.+_[xyz]"), PartMeaning.ANGULAR_VELOCITY),
)
Named = Sequence[tuple[Any, Any]]


def grouped(
    named: Named,
    outputs: Mapping[PartMeaning, Sequence[Any]],
    constants: Collection[str],
    moving: Collection[str],
) -> dict[PartMeaning, list[tuple[Any, Any]]]:
    """Named parts by meaning.

    Parameters
    ----------
    named : sequence of (sympy.Symbol, sympy.Expr)
        In an order in which each uses only those before it; so are those of each group, and the groups.
    outputs : mapping of PartMeaning to sequence of sympy.Expr
        What uses the parts: entries of the mass matrix, of the right side, of the constraints.
    constants, moving : collection of str
        Names of parameters; of velocities and inputs.
    """
    known = {symbol.name: meaning for symbol, _ in named for form, meaning in NAMES if form.fullmatch(symbol.name)}
    inside = {symbol: x.free_symbols for symbol, x in named}
    uses = _uses(named, outputs, known, inside)
    level: dict[Any, int] = {}  # 0 of parameters, 1 of coordinates, 2 of velocities
    meaning: dict[Any, PartMeaning] = {}
    groups: dict[PartMeaning, list[tuple[Any, Any]]] = {}
    for symbol, x in named:
        below = [level[s] if s in level else _level(s.name, constants, moving) for s in inside[symbol]]
        level[symbol] = max(below, default=0)
        own = known.get(symbol.name) or _meaning(x, level[symbol], uses[symbol])
        meaning[symbol] = max([own, *(meaning[s] for s in inside[symbol] if s in meaning)])
        groups.setdefault(meaning[symbol], []).append((symbol, x))
    return dict(sorted(groups.items()))


def _uses(
    named: Named,
    outputs: Mapping[PartMeaning, Sequence[Any]],
    known: Mapping[str, PartMeaning],
    inside: Mapping[Any, set[Any]],
) -> dict[Any, set[PartMeaning]]:
    """For what each part is used in the end, on the way to a known part too."""
    uses: dict[Any, set[PartMeaning]] = {symbol: set() for symbol, _ in named}
    for meaning, entries in outputs.items():
        for x in entries:
            for symbol in x.free_symbols & uses.keys():
                uses[symbol].add(meaning)
    for symbol, _ in reversed(named):
        own = {known[symbol.name]} if symbol.name in known else uses[symbol]
        for part in inside[symbol] & uses.keys():
            uses[part] |= own
    return uses


def _level(name: str, constants: Collection[str], moving: Collection[str]) -> int:
    return 0 if name in constants else 2 if name in moving else 1


def _meaning(x: Any, level: int, uses: set[PartMeaning]) -> PartMeaning:
    if level == 0:
        return PartMeaning.CONSTANT
    if isinstance(x, sympy.sin | sympy.cos):
        return PartMeaning.TURN
    for known, at in ((PartMeaning.ROTATION, 1), (PartMeaning.ANGULAR_VELOCITY, 2)):
        if known in uses and level <= at:
            return known
    body, row = (
        uses & {PartMeaning.INERTIA, PartMeaning.FORCE},
        uses & {PartMeaning.CONSTRAINT, PartMeaning.CONSTRAINT_RATE},
    )
    if body and row:
        return PartMeaning.POSITION if level == 1 else PartMeaning.VELOCITY
    own = body or row
    if level == 1 and len(own) > 1:
        own = own & {PartMeaning.INERTIA, PartMeaning.CONSTRAINT}
    return max(own, default=PartMeaning.FORCE)
