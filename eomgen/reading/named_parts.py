"""SymPy matrices that are sums with named parts -> groups and blocks of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from enum import IntEnum
from typing import Any

import sympy

from ..runtime.argument_checks import unknown

# -- named parts -------------------------------------------------------------------------------------------------------


class NamedSum(sympy.Matrix):  # type: ignore[misc]  # SymPy has no types
    """A column that is the sum of the columns in ``parts``; ``sum["motor"]`` is the part of that name.

    Attributes
    ----------
    parts : dict of str to sympy.Matrix
    """

    parts: Mapping[str, Any] = {}
    _plain: Callable[[str], str] = str

    @classmethod
    def of(cls, total: Sequence[Any], parts: Mapping[str, Any], plain: Callable[[str], str]) -> NamedSum:
        """The column of the total, with its parts; ``plain`` gives ``left_motor`` of ``left.motor``."""
        made = cls(len(total), 1, list(total))
        made.parts, made._plain = dict(parts), plain
        return made

    def __getitem__(self, key: Any) -> Any:
        if not isinstance(key, str):
            return super().__getitem__(key)
        name = key if key in self.parts else self._plain(key)
        if name not in self.parts:
            raise unknown("force element", name, self.parts)
        return self.parts[name]


# -- groups ------------------------------------------------------------------------------------------------------------


class PartMeaning(IntEnum):
    """What a named part is, in the order in which parts are listed."""

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
    """Named parts by meaning, each after those that it uses, in groups and among them.

    ``outputs`` are what uses the parts: entries of the mass matrix, of the right side, of the constraints.
    ``constants`` are names of parameters, ``moving`` those of velocities and inputs.
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
        known_meaning = known.get(symbol.name) or _meaning(x, level[symbol], uses[symbol])
        meaning[symbol] = max([known_meaning, *(meaning[s] for s in inside[symbol] if s in meaning)])
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
        users = {known[symbol.name]} if symbol.name in known else uses[symbol]
        for part in inside[symbol] & uses.keys():
            uses[part] |= users
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
    chosen = body or row
    if level == 1 and len(chosen) > 1:
        chosen = chosen & {PartMeaning.INERTIA, PartMeaning.CONSTRAINT}
    return max(chosen, default=PartMeaning.FORCE)


# -- blocks of matrices ------------------------------------------------------------------------------------------------

# Coordinates of one branch of the tree belong together, as those of one leg of a platform do; rows of the constraints
# that are of one joint do too.


MOST = 10  #: blocks in a row that are shown


def find_blocks(
    inertia: Sequence[Sequence[bool]],
    constraints: Sequence[Sequence[bool]],
    labels: Sequence[str],
    branches: Sequence[int],
) -> tuple[list[list[int]], list[list[bool]]] | None:
    """Groups of coordinates, and which blocks of the Jacobian do not vanish, by joints and groups.

    None where there is one group of coordinates, where there are too many groups, and where no block vanishes.
    ``inertia`` and ``constraints`` tell where mass matrix (n, n) and Jacobian (m, n) do not vanish, whose rows have
    labels, the joint before the first dot.  Coordinates of one branch of the tree, counted at ground, stay together.
    """
    n = len(inertia)
    group = [branches.index(branch) for branch in branches]
    for i in range(n):
        for j in range(i):
            if inertia[i][j] and group[i] != group[j]:
                old, new = max(group[i], group[j]), min(group[i], group[j])
                group = [new if k == old else k for k in group]
    groups = [[j for j in range(n) if group[j] == k] for k in dict.fromkeys(group)]
    rows: dict[str, list[Sequence[bool]]] = {}
    for label, row in zip(labels, constraints, strict=True):
        rows.setdefault(label.partition(".")[0], []).append(row)
    if not 1 < len(groups) <= MOST or not 1 < len(rows) <= MOST or len(groups) == n:
        return None
    filled = [[any(row[j] for row in of_joint for j in places) for places in groups] for of_joint in rows.values()]
    return None if all(map(all, filled)) else (groups, filled)
