"""Stage describe, equations that SymPy's mechanics formed: a method object -> Description with given equations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..errors import ModelError, Problem, ill_typed
from .description import Description
from .names import nearest
from .printed_names import give_latex
from .scope import RATES
from .sympy_auxiliary import put, solve_auxiliary
from .sympy_face import function_name, is_sympy, name_of, named, names_of, one_or_several
from .sympy_forms import Forms, read_forms
from .sympy_names import SympyNames


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
    if not isinstance(inputs, Mapping):
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
    known = _Known(forms)
    given_parameters = named("parameters", parameters)
    given_inputs = (
        named("inputs", inputs)
        if isinstance(inputs, Mapping)
        else dict.fromkeys(names_of("inputs", inputs, "an input"), 0.0)
    )
    forces = solve_auxiliary(forms, {*known.motion, *given_inputs}, given_parameters)
    extra = {name: put(expression, forces) for name, expression in extra.items()}
    noncontributing = {str(name_of(force)): value for force, value in forces.items()}
    contents = [*_contents(forms), *forms.intermediates.values(), *extra.values(), *noncontributing.values()]
    constants, functions = known.sort(contents, given_inputs)
    problems = known.problems
    for key in given_parameters:
        if key not in constants:
            near = nearest(str(key), constants, "constants")
            problems.append(
                Problem(f"parameters.{key}", f"the equations have no constant {key!r}", near, code="EG-NAME-UNKNOWN")
            )
    if problems:
        raise ModelError(problems)

    taken = {*constants, *functions, *known.names}
    configuration, motion, independent = _independent_rows(forms, constants, functions)
    rows = [*configuration, *motion]
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


def _contents(forms: Forms) -> list[Any]:
    """Everything the equations are made of."""
    flat = [x for row in forms.mass_matrix for x in row]
    rest = [forms.kinetic, forms.potential]
    return [*forms.rates.values(), *flat, *forms.forcing, *forms.configuration, *forms.motion, *rest]


class _Known:
    """Coordinates and speeds by name, and what else stands in expressions."""

    def __init__(self, forms: Forms) -> None:
        self.problems: list[Problem] = []
        self.intermediates = [symbol.name for symbol in forms.intermediates]
        self.names: dict[str, Any] = {}
        for k, x in enumerate([*forms.q, *forms.v]):
            name = name_of(x)
            if not isinstance(name, str):
                self.problems.append(
                    Problem("equations", f"{x} is not a function of the time t", "use dynamicsymbols", code="EG-TYPE")
                )
            elif name in self.names:
                self.problems.append(
                    Problem("equations", f"the name {name!r} is given twice", "rename one", code="EG-NAME-TAKEN")
                )
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
                near = nearest(str(name), [*functions, *symbols], "known")
                self.problems.append(
                    Problem(f"inputs.{name}", f"the equations do not contain {name!r}", near, code="EG-NAME-UNKNOWN")
                )
        constants = [name for name in symbols if name not in self.names and name not in driven]
        return sorted(set(constants) - functions), sorted({*functions, *driven})


def _specify(forms: Forms, outputs: dict[str, Any], specified: Mapping[Any, Any]) -> None:
    """Replace functions of time by expressions, their derivatives by those of the expressions."""
    for key in specified:
        if not is_sympy(key) or function_name(key) is None:
            raise ill_typed(f"specified takes functions of time f(t), not {key!r}")

    vars(forms).update(put(vars(forms), specified))
    outputs.update(put(outputs, specified))


def _independent_rows(
    forms: Forms, constants: Sequence[str], functions: Sequence[str]
) -> tuple[list[Any], list[Any], bool]:
    """Constraints without those of velocities that follow from the others, and whether the rest are independent.

    Judged on the graph at a generic place, where rows depend on each other only if they do everywhere.
    """
    from .constraint_rank import independent_rows

    if not forms.motion and not forms.configuration:
        return [], [], True
    kept, independent = independent_rows(forms, constants, functions)
    return forms.configuration, [forms.motion[k] for k in kept], independent
