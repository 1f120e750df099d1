"""Importers, equations that SymPy's mechanics formed: a method object -> Description with given equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base import algebra
from ..base.limits.constraints import GIVEN as SMALL
from ..base.limits.numbers import ROUNDED
from ..base.notation import rate_of
from ..describe.description import Description
from ..describe.names import nearest
from ..describe.printed_names import give_latex
from ..describe.scope import RATES
from ..describe.sympy_face import function_name, is_sympy, lower_sympy, name_of, named, names_of, one_or_several
from ..describe.sympy_text import SympyNames
from ..errors import ExpressionError, ModelError, Problem, ill_typed
from ..graph.core import Expr, Graph, substitute, symbols_of
from ..graph.differentiate import jacobian, jvp
from ..graph.evaluate import evaluate
from ..graph.rounding_bounds import with_bounds
from .sympy_mechanics import Forms, read_forms, replaced, solve_auxiliary

TRIES = 5  #: places at which the rank of constraints is looked for


def describe_method(
    method: Any,
    name: str = "system",
    parameters: Mapping[Any, Any] | None = None,
    inputs: Mapping[Any, Any] | Sequence[Any] = (),
    outputs: Mapping[str, Any] | None = None,
    initial: Mapping[Any, Any] | None = None,
    specified: Mapping[Any, Any] | None = None,
    potential_energy: Any = None,
    guess: Mapping[Any, Any] | None = None,
) -> Description:
    """The description behind :func:`from_sympy`, which see."""
    forms = read_forms(method)
    if listed := not isinstance(inputs, Mapping):
        inputs = one_or_several(inputs)
    arguments = (parameters, inputs, outputs, initial, specified, potential_energy, guess)
    renamed = SympyNames([vars(forms), *arguments], forms.q)
    vars(forms).update(renamed.put(vars(forms)))
    parameters, inputs, outputs, initial, specified, potential_energy, guess = map(renamed.put, arguments)
    if potential_energy is not None:
        forms.potential = potential_energy
    extra = named("outputs", outputs)
    if specified is not None and named("specified", specified):
        _specify(forms, extra, specified)
    known = _Names(forms)
    given_parameters = named("parameters", parameters)
    given_inputs = dict.fromkeys(names_of("inputs", inputs, "an input"), 0.0) if listed else named("inputs", inputs)
    forces = solve_auxiliary(forms, {*known.motion, *given_inputs}, given_parameters)
    extra = {name: replaced(expression, forces) for name, expression in extra.items()}
    noncontributing = {str(name_of(force)): value for force, value in forces.items()}
    flat = [x for row in forms.mass_matrix for x in row]
    contents = [*forms.rates.values(), *flat, *forms.forcing, *forms.configuration, *forms.motion, forms.kinetic]
    contents += [forms.potential, *forms.intermediates.values(), *extra.values(), *noncontributing.values()]
    constants, functions = known.sort(contents, given_inputs)
    problems = known.problems
    for key in given_parameters:
        if key not in constants:
            near = nearest(str(key), constants, "constants")
            message = f"the equations have no constant {key!r}"
            problems.append(Problem(f"parameters.{key}", message, near, code="EG-NAME-UNKNOWN"))
    if problems:
        raise ModelError(problems)

    taken = {*constants, *functions, *known.names}
    kept, independent = _independent_rows(forms, constants, functions)
    rows = [*forms.configuration, *(forms.motion[k] for k in kept)]
    equations: dict[str, Any] = {
        "coordinates": [name_of(x) for x in forms.q],
        "velocities": [name_of(x) for x in forms.v],
        "rates": {name_of(x): rate for x, rate in zip(forms.q, forms.rates.values(), strict=True)},
        "mass_matrix": forms.mass_matrix,
        "forcing": forms.forcing,
        "kinetic_energy": forms.kinetic,
        "potential_energy": forms.potential,
    }
    description = Description(values={"name": name, "equations": equations}, notes=forms.notes)
    if rows:
        equations["constraints"] = rows
    if forms.intermediates:
        equations["intermediates"] = {symbol.name: part for symbol, part in forms.intermediates.items()}
    names = forms.multipliers or [f"lam{k + 1}" for k in range(len(rows))]
    if not independent or len(names) != len(rows):
        description.notes.append(
            "multipliers are no outputs: the constraints are redundant, or their rank cannot be judged"
        )
    elif not taken.isdisjoint(names):
        clash = ", ".join(sorted(taken.intersection(names)))
        description.notes.append(f"multipliers are no outputs: the equations use the names {clash}")
    elif rows:
        equations["multipliers"] = names
        extra |= {name: name for name in names if name not in extra}
    for constant in constants:
        value = given_parameters.get(constant)
        description.add("parameters", constant, {} if value is None else {"value": value})
    for function in functions:
        description.add("inputs", function, {"value": given_inputs.get(function, 0.0)})
    for output, expression in {**noncontributing, **extra}.items():
        description.add("outputs", output, {"expression": expression})
    for key, values in (("initial", initial), ("guess", guess)):
        if found := named(key, values):
            description.values[key] = found
    give_latex(description, "equations", renamed.latex())
    return renamed.noted(description)


class _Names:
    """Coordinates and speeds by name, and what else stands in expressions."""

    def __init__(self, forms: Forms) -> None:
        self.problems: list[Problem] = []
        self.intermediates = [symbol.name for symbol in forms.intermediates]
        self.names: dict[str, Any] = {}
        for k, x in enumerate([*forms.q, *forms.v]):
            name = name_of(x)
            if not isinstance(name, str):
                message = f"{x} is not a function of the time t"
                self.problems.append(Problem("equations", message, "use dynamicsymbols", code="EG-TYPE"))
            elif name in self.names:
                message = f"the name {name!r} is given twice"
                self.problems.append(Problem("equations", message, "rename one", code="EG-NAME-TAKEN"))
            self.names[str(name) if isinstance(name, str) else f"?{k}"] = x
        motion = [f"{name_of(x)}{suffix}" for x in forms.q for suffix in RATES]
        self.motion = {*motion, *(f"{name_of(x)}_dot" for x in forms.v), *self.names}

    def sort(self, expressions: Iterable[Any], inputs: Mapping[str, Any]) -> tuple[list[str], list[str]]:
        """Names of the constants, and of what is given over time."""
        import sympy
        from sympy.core.function import AppliedUndef

        symbols: dict[str, set[Any]] = {}
        functions: set[str] = set()
        for expression in expressions:
            if not is_sympy(expression):
                continue
            walk = sympy.preorder_traversal(expression)
            for part in walk:
                if isinstance(part, sympy.Symbol):
                    symbols.setdefault(part.name, set()).add(part)
                elif isinstance(part, AppliedUndef | sympy.Derivative) and (found := function_name(part)) is not None:
                    walk.skip()  # f' is not f
                    if found not in self.motion:
                        functions.add(found)
        for name in ("t", *self.intermediates):
            symbols.pop(name, None)
        for symbol, different in symbols.items():
            if symbol in self.names or symbol in functions:
                what = "a coordinate or speed" if symbol in self.names else "a function of time"
                message = f"{symbol!r} is both a constant and {what}"
                self.problems.append(Problem(f"equations.{symbol}", message, "rename one", code="EG-NAME-TAKEN"))
            elif len(different) > 1:
                message = f"{len(different)} different symbols are called {symbol!r}"
                remedy = "make one symbol and use it everywhere (assumptions such as positive=True make another)"
                self.problems.append(Problem(f"equations.{symbol}", message, remedy, code="EG-NAME-TAKEN"))
        driven = [name for name in symbols if name in inputs]
        for name in inputs:
            if name not in functions and name not in symbols:
                near, message = (
                    nearest(str(name), [*functions, *symbols], "known"),
                    f"the equations do not contain {name!r}",
                )
                self.problems.append(Problem(f"inputs.{name}", message, near, code="EG-NAME-UNKNOWN"))
        constants = [name for name in symbols if name not in self.names and name not in driven]
        return sorted(set(constants) - functions), sorted({*functions, *driven})


def _specify(forms: Forms, outputs: dict[str, Any], specified: Mapping[Any, Any]) -> None:
    """Replace functions of time by expressions, their derivatives by those of the expressions."""
    for key in specified:
        if not is_sympy(key) or function_name(key) is None:
            raise ill_typed(f"specified takes functions of time f(t), not {key!r}")

    vars(forms).update(replaced(vars(forms), specified))
    outputs.update(replaced(outputs, specified))


def _independent_rows(forms: Forms, constants: Sequence[str], functions: Sequence[str]) -> tuple[list[int], bool]:
    """Which rows of ``forms.motion`` do not follow from others or from the configuration constraints.

    And whether these rows and the configuration constraints are independent of each other.  Judged on the graph at a
    generic place, where rows depend on each other only if they do everywhere.
    """
    if not forms.motion and not forms.configuration:
        return [], True
    graph = Graph()
    names = {name_of(x): graph.symbol(name_of(x)) for x in (*forms.q, *forms.v)}

    def resolve(name: str) -> Expr:
        return {**rates, **names}.get(name, graph.symbol(name))

    rates: dict[str, Expr] = {}
    try:
        for symbol, part in forms.intermediates.items():
            names[symbol.name] = lower_sympy(graph, part, resolve)
        slopes = [lower_sympy(graph, rate, resolve) for rate in forms.rates.values()]
        for x, rate in zip(forms.q, slopes, strict=True):
            rates[f"{name_of(x)}_dot"] = rate
        configuration = [lower_sympy(graph, row, resolve) for row in forms.configuration]
        motion = [lower_sympy(graph, row, resolve) for row in forms.motion]
    except ExpressionError:  # the check of the model tells what is wrong
        return list(range(len(forms.motion))), False
    along = {names[name_of(x)]: rate for x, rate in zip(forms.q, slopes, strict=True)}
    along |= {graph.symbol(f): graph.symbol(rate_of(f)) for f in functions} | {graph.symbol("t"): graph.one}
    rows = [*jvp(configuration, along), *motion]
    v = [names[name_of(x)] for x in forms.v]
    entries = jacobian(rows, v)
    constant = substitute(rows, dict.fromkeys(v, graph.zero))
    used = symbols_of([*constant, *entries.values()])
    random = np.random.default_rng(0)
    for _ in range(TRIES):  # a place may lie outside the domain of a root
        values = {name: float(random.uniform(0.3, 1.2)) for name in sorted(used)}
        matrix, rounding = np.zeros((len(rows), len(v))), np.zeros((len(rows), len(v)))
        for place, value, bound in zip(entries, *with_bounds(list(entries.values()), values), strict=True):
            matrix[place], rounding[place] = value, ROUNDED * bound
        right = np.array(evaluate(constant, values), dtype=float)
        if np.isfinite(matrix).all() and np.isfinite(right).all():
            break
    else:
        return list(range(len(motion))), False
    basis = np.empty((0, len(v)))
    fresh: list[bool] = []
    for row, noise in zip(matrix, rounding, strict=True):
        length = np.linalg.norm(row)
        left = row - basis.T @ (basis @ row)
        left -= basis.T @ (basis @ left)
        size = np.linalg.norm(left)
        fresh.append(bool(size > SMALL * length and size > np.linalg.norm(noise)))
        if fresh[-1]:
            basis = np.vstack([basis, left / size])
    h = len(configuration)
    own = [k for k, new in enumerate(fresh) if new]
    for k in [k for k, new in enumerate(fresh) if not new]:
        factors = algebra.lstsq(matrix[own].T, matrix[k], rcond=None)
        largest = max(1.0, float(abs(right[k])), float(np.abs(factors).max(initial=0)))
        if abs(right[k] - factors @ right[own]) > SMALL * largest:
            which = f"configuration constraint {k + 1}" if k < h else f"velocity constraint {k - h + 1}"
            message = (
                f"{which} contradicts the others: it has the same velocity terms as they have, but other "
                "remaining terms"
            )
            raise ModelError([Problem("equations.constraints", message, f"check the {which}", code="EG-REDUNDANT")])
    return [k for k in range(len(motion)) if fresh[h + k]], all(fresh[:h])
