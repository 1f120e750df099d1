"""The symbols of a model at a state in many digits, and at states nearby."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import count
from typing import TYPE_CHECKING

from ..expr.core import Expr
from . import bodies
from .digits import FIRST, SECOND, Digits, Number, Numbers, context

if TYPE_CHECKING:
    from ..codegen.terms import SystemTerms
    from ..reading.derivation import Derivation
    from .random_states import SystemState

Values = dict[str, Number]


class PreciseSystem:
    """A model's expressions in many digits, and its description: what a :class:`~.truth.Truth` is found from.

    Parameters
    ----------
    terms : SystemTerms
        Of the same equations.
    """

    def __init__(self, equations: Derivation, terms: SystemTerms) -> None:
        self.equations, self.terms = equations, terms
        self.kinematics = equations.kinematics
        self.mechanism = equations.kinematics.mechanism
        self.mp = context()
        self._ready: dict[str, Digits] = {}

    def evaluate(self, name: str, outputs: Callable[[], Sequence[Expr]], values: Mapping[str, Number]) -> Numbers:
        """Values of expressions that are prepared once, under a name."""
        if name not in self._ready:
            self._ready[name] = Digits(self.mp, list(outputs()))
        return self._ready[name](values)

    def values(self, case: SystemState) -> Values:
        """All symbols at a case, exactly as the doubles are."""
        terms, number = self.terms, self.mp.mpf
        names = (*terms.q, *terms.v, *terms.a, *terms.p, *terms.u, terms.t)
        numbers = (*case.x, *case.a, *case.p, *case.u, case.t)
        return {name: number(float(x)) for name, x in zip(names, numbers, strict=True)}


class PreciseState:
    """One state of a model, and the ways that lead through it.

    Parameters
    ----------
    system : PreciseSystem
    case : SystemState
    """

    def __init__(self, system: PreciseSystem, case: SystemState) -> None:
        self.system, self.case, self.mp = system, case, system.mp
        self.values = system.values(case)
        self.n = len(system.terms.v)
        self.zero = self.mp.mpf(0)

    # -- moving the state ---------------------------------------------------------------------------------------------
    def rates(self, values: Values) -> Numbers:
        """q' at some values."""
        terms = self.system.terms
        if not terms.rates:
            return [values[name] for name in terms.v[: self.n - terms.n_states]]
        return self.system.evaluate("rates", lambda: terms.rates, values)

    @cached_property
    def columns(self) -> list[Numbers]:
        """N: q' of each velocity alone."""
        terms = self.system.terms
        still = self.values | dict.fromkeys(terms.v, self.zero)
        base = self.rates(still)
        one = self.mp.mpf(1)
        return [bodies.sub(self.rates(still | {name: one}), base) for name in terms.v]

    def displaced(self, j: int, step: Number) -> Values:
        """The coordinates moved along velocity j."""
        q = self.system.terms.q
        moved = {name: self.values[name] + step * d for name, d in zip(q, self.columns[j], strict=True)}
        return self.values | moved

    def later(self, step: Number, a: Sequence[Number] | None = None, frozen: bool = False) -> Values:
        """The state a time later, with accelerations a (0 by default): q + s q' + s^2 q'' / 2, v + s a, t + s.

        ``frozen``: time and inputs stand still.
        """
        terms = self.system.terms
        a = [self.zero] * self.n if a is None else a
        rates, bend = self.rates(self.values), self._second_rates(a)
        moved = {
            name: self.values[name] + step * r + step * step * b / 2
            for name, r, b in zip(terms.q, rates, bend, strict=True)
        }
        moved |= {name: self.values[name] + step * x for name, x in zip(terms.v, a, strict=True)}
        if not frozen:
            moved[terms.t] = self.values[terms.t] + step
            moved |= self._moved_inputs(step)
        return self.values | moved

    def _moved_inputs(self, step: Number) -> Values:
        """Inputs whose rates are inputs too move with them, by Taylor's series up to the last rate."""
        next_of, moved = dict(self.system.terms.input_rates), dict[str, Number]()
        for name in next_of:
            total, factor, rate = self.values[name], self.mp.mpf(1), next_of.get(name)
            for order in count(1):
                if rate is None:
                    break
                factor *= step / order
                total += factor * self.values[rate]
                rate = next_of.get(rate)
            moved[name] = total
        return moved

    def _second_rates(self, a: Sequence[Number]) -> Numbers:
        """q'' along q', v' = a."""
        terms = self.system.terms
        if not terms.rates:
            return list(a)[: self.n - terms.n_states]
        h, rates = self.mp.mpf(FIRST), self.rates(self.values)
        ends = []
        for s in (h, -h):
            moved = {name: self.values[name] + s * r for name, r in zip(terms.q, rates, strict=True)}
            moved |= {name: self.values[name] + s * x for name, x in zip(terms.v, a, strict=True)}
            ends.append(self.rates(self.values | moved | {terms.t: self.values[terms.t] + s}))
        return [(x - y) / (2 * h) for x, y in zip(*ends, strict=True)]

    def slope(self, f: Callable[[Values], Numbers], along: Callable[[Number], Values]) -> Numbers:
        """Central difference of a function along a way."""
        h = self.mp.mpf(FIRST)
        return [(x - y) / (2 * h) for x, y in zip(f(along(h)), f(along(-h)), strict=True)]

    def bend(self, f: Callable[[Values], Numbers], along: Callable[[Number], Values]) -> Numbers:
        """Second difference of a function along a way."""
        h = self.mp.mpf(SECOND)
        ends = zip(f(along(h)), f(along(self.zero)), f(along(-h)), strict=True)
        return [(x - 2 * y + z) / (h * h) for x, y, z in ends]
