"""Expressions and a rule -> faults now, and what late values must keep too.

Each rule of :mod:`..base.value_rules` is the only home of its condition: here it judges the declared values of
parameters, and a compiled module judges by it what parameters are given later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.algebra import Array
from ..base.value_rules import LIMITS, NOT_ZERO, POINTS, RANGE, RULES, Allowed
from ..expr.core import Expr, symbols_of
from ..expr.evaluate import evaluate
from .description import as_written


class Requirement(NamedTuple):
    """A rule that numbers of an element keep, whatever the parameters are."""

    path: str  #: dotted place in the model
    rule: str  #: a name of :data:`~..base.value_rules.RULES`
    expressions: tuple[Expr, ...]  #: the numbers, of parameters and of local names
    data: tuple[Any, ...] = ()  #: what else the rule takes
    local: tuple[str, ...] = ()  #: names that stand for the points at which the rule looks


class Requirements:
    """The requirements of one description: ``all`` that depend on parameters, and the declared ``numbers`` of these."""

    def __init__(self, faults: Any) -> None:
        self.faults, self.all = faults, list[Requirement]()
        self.numbers: dict[str, float] = {}
        self.parameters: frozenset[str] = frozenset()

    def declare(self, values: Mapping[str, float | None]) -> None:
        """Take in the parameters, with their declared values as far as they have one."""
        self.parameters = frozenset(values)
        self.numbers = {name: value for name, value in values.items() if value is not None}

    def judge(
        self,
        path: str,
        rule: str,
        expressions: Sequence[Expr],
        data: Sequence[Any] = (),
        local: Sequence[str] = (),
        where: str = "",
    ) -> bool:
        """Note what is wrong at the declared values, and keep the rule for late ones; True where something is wrong.

        Numbers that depend on more than parameters and local names are not judged.  ``where`` ends the messages.
        """
        values = self.known(expressions, dict(zip(local, POINTS[rule](), strict=True)) if local else {})
        flaws = [] if values is None else RULES[rule](values, *data)
        for flaw in flaws:
            self.faults.add(path + flaw.key, flaw.message + where, flaw.remedy, "EG-RANGE")
        if not flaws:
            self.keep(path, rule, expressions, data, local)
        return bool(flaws)

    def keep(
        self, path: str, rule: str, expressions: Sequence[Expr], data: Sequence[Any] = (), local: Sequence[str] = ()
    ) -> None:
        """Keep a rule for late values, where any of the numbers depends on parameters, and on nothing else."""
        names = symbols_of(expressions) - {*local}
        if names and names <= self.parameters:
            path = as_written(path, self.faults.written_paths)
            self.all.append(Requirement(path, rule, tuple(expressions), tuple(data), tuple(local)))

    def known(self, expressions: Sequence[Expr], points: Mapping[str, Array] | None = None) -> Array | None:
        """Numbers, a row each, at the declared values and at points of local names; None if these do not tell."""
        if not points:  # most are numbers already
            numbers = [x.value for x in expressions]
            if None not in numbers:
                values = np.array(numbers, dtype=float)
                return values if np.isfinite(values).all() else None
        raw = {**self.numbers, **(points or {})}
        if not symbols_of(expressions) <= raw.keys():
            return None
        with np.errstate(all="ignore"):
            result = evaluate(expressions, raw)
        if points:
            return np.array(np.broadcast_arrays(*result, *points.values())[: len(result)], dtype=float)
        values = np.array(result, dtype=float)
        return values if np.isfinite(values).all() else None

    # -- rules of one and two numbers -----------------------------------------------------------------------------
    def inside(self, path: str, value: Expr, allowed: Allowed, remedy: str, message: str = "") -> bool:
        """Require a number in a range; ``{:g}`` in a message of its own stands for it."""
        return self.judge(path, RANGE, [value], (*allowed, remedy, message))

    def not_zero(self, path: str, value: Expr, remedy: str, message: str = "is 0") -> bool:
        """Require a number other than 0."""
        return self.judge(path, NOT_ZERO, [value], (message, remedy))

    def in_order(self, path: str, first: Expr, second: Expr, message: str, remedy: str) -> bool:
        """Require that the first number does not exceed the second; ``{:g}`` in the message stands for each."""
        return self.judge(path, LIMITS, [first, second], (message, remedy))
