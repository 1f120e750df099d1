"""SymPy expressions -> graph, names -> SymPy symbols; SymPy loads on first use."""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partialmethod
from itertools import count
from typing import Any
from unicodedata import normalize

from ..base.operations import OPERATIONS
from ..base.texts import quote
from ..errors import ExpressionError, ModelError, Problem, cannot, ill_typed
from ..expr.core import Expr, Graph
from ..expr.functions import Function
from ..expr.latex import GREEK, NotationError, read_latex
from ..expr.notation import split_rate
from ..expr.texts import parts_of, quoted, shortened
from .description import Description, items
from .expressions import parse
from .names import RATES, fault_of_name, unique
from .quantities import Named

Resolve = Callable[[str], Expr]


def require_name(what: str, name: Any) -> str:
    """The name that was given for something; UsageError if it is no text."""
    if not isinstance(name, str):
        raise ill_typed(f"{what}: a name is a text, such as 'A', not {quote(name)}")
    return name


def named(what: str, raw: Any) -> dict[Any, Any]:
    """Values by name, of a mapping by symbol or name; none of None, UsageError if it is no mapping."""
    if raw is None:
        return {}
    if not isinstance(raw, Mapping):
        raise ill_typed(f"{what} must be a mapping of names to values, such as {{'m': 2.0}}, not {quote(raw)}")
    return {require_name(what, name_of(key)): value for key, value in raw.items()}


def one_or_several(raw: Any) -> list[Any]:
    """The items of a list, array, set, view of a mapping or generator; anything else is one item, None none."""
    if raw is None:
        return []
    if (listed := items(raw)) is not None:
        return listed
    one = isinstance(raw, str | bytes | Mapping) or hasattr(raw, "tolist")  # an array without axes
    return [raw] if one or not isinstance(raw, Iterable) else list(raw)


def names_of(path: str, raw: Any, what: str) -> list[str]:
    """Names of what is given as symbols, functions of time or texts, one or several; ModelError for anything else."""
    listed = one_or_several(raw)
    remedy = "give symbols q or functions q(t) of the time t"
    wrong = [
        Problem(f"{path}[{k}]", f"{shortened(q)} is not {what}", remedy, code="EG-TYPE")
        for k, q in enumerate(listed)
        if not isinstance(q, str) and sympy_name(q) is None
    ]
    if wrong:
        raise ModelError(wrong)
    return [name_of(q) for q in listed]


def symbol(name: str) -> Any:
    """The plain SymPy symbol that stands for a name."""
    import sympy

    return sympy.Symbol(require_name("symbol", name))


def function(name: str) -> Any:
    """The SymPy function that stands for a declared function."""
    import sympy

    return sympy.Function(name)


def is_sympy(value: object) -> bool:
    """Whether a value is a SymPy object; never imports SymPy."""
    sympy = sys.modules.get("sympy")
    return sympy is not None and isinstance(value, sympy.Basic)


def values_in(raw: Any, keys: bool = False) -> Iterator[Any]:
    """Texts and SymPy expressions in lists, matrices and mappings, of these the keys too if asked for."""
    if isinstance(raw, str) or is_sympy(raw):
        yield raw
        return
    parts = (*(raw if keys else ()), *raw.values()) if isinstance(raw, Mapping) else items(raw) or ()
    for part in parts:
        yield from values_in(part, keys)


def with_sympy(value: Any, change: Callable[[Any], Any]) -> Any:
    """A value whose SymPy expressions are changed, whatever lists and mappings they stand in."""
    if is_sympy(value):
        return change(value)
    if isinstance(value, Mapping):
        return {key: with_sympy(part, change) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return getattr(value, "_make", type(value))(with_sympy(part, change) for part in value)
    if hasattr(value, "todok"):  # a mutable matrix of SymPy
        return type(value)(*value.shape, [with_sympy(part, change) for part in value])
    listed = items(value)
    return value if listed is None else [with_sympy(part, change) for part in listed]


def name_of(value: object) -> Any:
    """The name behind a coordinate given as a symbol or as a function of time; else a text that is no name.

    Texts, numbers and plain lists are left as they are.
    """
    if value is None or isinstance(value, str | int | float | list | tuple | dict):
        return value
    return sympy_name(value) or quoted(value)


def sympy_name(value: object) -> str | None:
    """The name of a SymPy symbol or function of time; None for anything else."""
    if not is_sympy(value):
        return None
    if isinstance(value, sys.modules["sympy"].Symbol):
        return str(value.name)
    return function_name(value)


def in_order(raw: Mapping[Any, Any], known: Sequence[str]) -> list[tuple[Any, Any]]:
    """Names and values of a mapping in the order of the known names, others last, however it was written."""
    places = {name: k for k, name in enumerate(known)}
    named = [(name_of(key), value) for key, value in raw.items()]
    return sorted(named, key=lambda pair: places.get(pair[0], len(places)))


def function_name(value: Any) -> str | None:
    """``"q"`` for ``q(t)`` and ``"q_dot"``, ``"q_ddot"`` for its derivatives; None for anything else."""
    from sympy import Derivative
    from sympy.core.function import AppliedUndef

    if isinstance(value, AppliedUndef):
        return str(value.func.__name__) if _is_time(value.args) else None
    if isinstance(value, Derivative) and isinstance(value.expr, AppliedUndef) and _is_time(value.expr.args):
        (variable, order), *rest = value.variable_count
        if not rest and _is_time((variable,)) and order in (1, 2):
            return f"{value.expr.func.__name__}_{'d' * int(order)}ot"
    return None


def _is_time(arguments: Any) -> bool:
    return len(arguments) == 1 and getattr(arguments[0], "name", None) == "t"


def lower_sympy(graph: Graph, expression: Any, resolve: Resolve) -> Expr:
    """The graph expression of a SymPy expression; ExpressionError if a part of it has no meaning.

    It is in plain symbols, in functions of time ``q(t)`` with their derivatives, or both; ``resolve`` gives the
    expression of a name.
    """
    from ..expr.sympy_bridge import LoweringError, lower

    def meaning(part: Any) -> Expr | None:  # declared functions, also f(t), are calls and do not come here
        name = sympy_name(part)
        return None if name is None else resolve(name)

    try:
        return lower(graph, expression, meaning)
    except LoweringError as error:
        raise ExpressionError(str(error.args[0]).replace("\n", "; ")) from None


def _names(expressions: list[Any], kind: Any, name: Callable[[Any], str | None]) -> list[str]:
    """Names of all parts of a class in the SymPy expressions among the values, sorted."""
    parts = (part for x in expressions if is_sympy(x) for part in parts_of(x) if isinstance(part, kind))
    return sorted({*filter(None, map(name, parts))})


def free_names(expressions: list[Any]) -> list[str]:
    """Names of all symbols in SymPy expressions, the time excepted, sorted."""
    import sympy

    return [name for name in _names(expressions, sympy.Symbol, sympy_name) if name != "t"]


def function_names(expressions: list[Any]) -> list[str]:
    """Names of all functions of time in SymPy expressions, sorted."""
    from sympy.core.function import AppliedUndef

    return _names(expressions, AppliedUndef, function_name)


def derivative_names(expressions: list[Any]) -> list[str]:
    """Names of all derivatives of functions of time in SymPy expressions, sorted."""
    import sympy

    return _names(expressions, sympy.Derivative, function_name)


# -- names and texts ---------------------------------------------------------------------------------------------------


LARGE = 200  #: operations of an expression from which given equations are written with intermediates
_SPELLED = {sign: word for word, sign in GREEK.items()}


class SympyNames:
    """What SymPy's names are called in a model; only those that it cannot use are changed.

    ``given`` is everything in which names stand; where coordinates are functions, their argument is the time, whatever
    it is called.
    """

    def __init__(self, raw: Any, coordinates: Any) -> None:
        import sympy
        from sympy.core.function import AppliedUndef

        result: dict[Any, str] = {}
        listed = [x for x in one_or_several(coordinates) if isinstance(x, AppliedUndef) and len(x.args) == 1]
        time = sympy.Symbol("t")
        clock = next((x.args[0] for x in listed if isinstance(x.args[0], sympy.Symbol) and x.args[0].name != "t"), time)
        self.replaced: dict[Any, Any] = {} if clock == time else {clock: time}
        for expression in filter(is_sympy, values_in(raw, keys=True)):
            for part in parts_of(expression):
                if isinstance(part, sympy.Symbol) and part.name != clock.name:
                    result[part] = part.name
                elif isinstance(part, AppliedUndef) and [getattr(x, "name", "") for x in part.args] == [clock.name]:
                    result[part] = part.func.__name__
        self.renamed: dict[str, str] = {}
        taken = {name + rate for name in result.values() if not fault_of_name(name, symbol=True) for rate in RATES}
        for name in sorted(set(result.values())):
            if fault_of_name(name, symbol=True):
                stem = split_rate(name)[0]
                self.renamed[stem] = self.renamed.get(stem) or unique(_plain(stem), "symbol", taken, RATES)
        for part, name in result.items():
            if (new := self.name(name)) != name:
                if isinstance(part, sympy.Symbol):
                    self.replaced[part] = sympy.Symbol(new, **part.assumptions0)
                else:
                    self.replaced[part] = sympy.Function(new)(time)

    def name(self, name: str) -> str:
        """The name in the model; of a rate by that of its coordinate."""
        stem = name if name in self.renamed else split_rate(name)[0]
        return self.renamed[stem] + name[len(stem) :] if stem in self.renamed else name

    def put(self, value: Any) -> Any:
        """A value with the names of the model; texts are left as they are, unless they are keys."""
        if not self.replaced:
            return value
        if isinstance(value, Mapping):
            keys = (self.name(key) if isinstance(key, str) else self.put(key) for key in value)
            return dict(zip(keys, map(self.put, value.values()), strict=True))
        if hasattr(value, "xreplace"):  # SymPy's matrices too, which keep their shape
            return value.xreplace(self.replaced)
        listed = items(value)
        return value if listed is None else [self.put(part) for part in listed]

    def latex(self, raw: Any = None) -> Any:
        """The LaTeX of names: as it is given, else what the names were in SymPy where that is LaTeX."""
        letters: dict[str, str] = {}
        for old, new in self.renamed.items():
            text = "".join(f"\\{_SPELLED[c]} " if c in _SPELLED else c for c in normalize("NFKC", old)).strip()
            with suppress(NotationError):
                if text.startswith("\\"):
                    read_latex(text)
                    letters[new] = text
        return letters | self.put(dict(raw or {})) if letters else self.put(raw)

    def noted(self, description: Description) -> Description:
        """The description with a note of what was renamed."""
        places, raw = ("outputs", "parameters", "inputs"), description.values.get("equations", {})
        homes = {entry.name: place for place in places for entry in description.sections[place]}
        for name in (*raw.get("coordinates", ()), *raw.get("velocities", ())):  # which outputs may repeat
            homes.pop(name, None)
        renamed: dict[str, dict[str, str]] = {}
        for old, new in self.renamed.items():
            renamed.setdefault(homes.get(new, "coordinates"), {})[old] = new
        description.note_renamed(renamed)
        return description


def _plain(name: str) -> str:
    """Letters like ``theta_1`` of ``\\theta_{1}``."""
    text = "".join(_SPELLED.get(c, c) for c in normalize("NFKC", name)).replace("_{", "_")
    return text.translate({ord(c): None for c in "\\{}$"}).strip()


def sympy_text(expression: Any, functions: Collection[str] = ()) -> str:
    """A SymPy expression as a text that the expressions of a model file know, with functions that the model declares.

    Raises UsageError where it has parts that such a text cannot say.
    """
    import sympy
    from sympy.core.function import AppliedUndef
    from sympy.printing.str import StrPrinter

    def named(printer: Any, e: Any, word: str) -> str:
        return f"{word}({', '.join(printer._print(x) for x in e.args)})"

    class Printer(StrPrinter):  # type: ignore[misc]  # SymPy has no types
        """SymPy's text with the names of functions that a model file uses."""

        def _print_Float(self, e: Any) -> str:
            return repr(float(e))

        def _print_Heaviside(self, e: Any) -> str:
            if 2 * e.args[1] != 1:
                raise cannot(f"{shortened(e)} cannot be written as a text: only heaviside with the value 1/2 at 0 can")
            return f"heaviside({self._print(e.args[0])})"

        def _print_Exp1(self, e: Any) -> str:
            return "exp(1)"

        def _print_And(self, e: Any) -> str:
            return "(" + " and ".join(self._print(x) for x in e.args) + ")"

        def _print_Or(self, e: Any) -> str:
            return "(" + " or ".join(self._print(x) for x in e.args) + ")"

        def _print_Not(self, e: Any) -> str:
            return f"(not {self._print(e.args[0])})"

        def _print_Relational(self, e: Any) -> str:
            return f"({self._print(e.lhs)} {e.rel_op} {self._print(e.rhs)})"

        def _print_Piecewise(self, e: Any) -> str:
            *pieces, last = e.args
            if last.cond != True:  # noqa: E712 - SymPy's own true
                raise cannot(f"{shortened(e)} leaves cases without a value; end the Piecewise with (expression, True)")
            text = self._print(last.expr)
            for piece in reversed(pieces):
                text = f"where({self._print(piece.cond)}, {self._print(piece.expr)}, {text})"
            return str(text)

        def _print_AppliedUndef(self, e: Any) -> str:
            if e.func.__name__ not in functions:
                return function_name(e) or str(e)
            return f"{e.func.__name__}({', '.join(self._print(x) for x in e.args)})"

        def _print_Derivative(self, e: Any) -> str:
            if e.expr.func.__name__ not in functions:
                return function_name(e) or str(e)
            return self._slope(e, e.expr.args)

        def _print_Subs(self, e: Any) -> str:
            slope = e.expr
            if not isinstance(slope, sympy.Derivative) or slope.expr.func.__name__ not in functions:
                return str(e)
            places = dict(zip(e.variables, e.point, strict=True))
            return self._slope(slope, [x.xreplace(places) for x in slope.expr.args])

        def _slope(self, e: Any, operands: Any) -> str:
            wanted = dict(e.variable_count)
            orders = [wanted.get(x, 0) for x in e.expr.args]
            if sum(orders) != sum(wanted.values()) or any(set(wanted) & x.free_symbols - {x} for x in e.expr.args):
                raise cannot(f"{shortened(e)} cannot be written as a text: write out the chain rule of its derivative")
            call = f"{e.expr.func.__name__}({', '.join(self._print(x) for x in operands)})"
            return f"diff({', '.join([call, *map(str, orders)])})"

    for row in OPERATIONS.values():
        if row.word and row.sympy_class:
            setattr(Printer, f"_print_{row.sympy_class}", partialmethod(named, word=row.word))
    try:
        text = str(Printer().doprint(expression))
    except RecursionError:
        raise cannot(f"{shortened(expression)} is nested too deeply to be written as a text") from None
    except ValueError:  # Python writes whole numbers of some thousand digits and no longer ones
        raise cannot(
            f"{shortened(expression)} contains a number with too many digits to be written as a text"
        ) from None
    graph = Graph()
    for call in expression.atoms(AppliedUndef) if isinstance(expression, sympy.Basic) else ():
        if call.func.__name__ in functions:
            graph.declare(Function(call.func.__name__, len(call.args), None))
    known = {*free_names([expression]), "t"} | {f + rate for f in function_names([expression]) for rate in RATES}

    def resolve(name: str) -> Expr:
        if name not in known:  # a constant of SymPy such as I or oo
            raise ExpressionError(f"{name} is not a real number")
        return graph.symbol(name)

    def locate(quantity: Named) -> Expr:
        return resolve(str(quantity))

    try:
        parse(text, graph, resolve, locate)
    except ExpressionError as error:
        raise cannot(f"{shortened(expression)} cannot be written as a text: {shortened(error)}") from None
    return text


# -- given equations ---------------------------------------------------------------------------------------------------
def with_intermediates(equations: Mapping[str, Any]) -> Mapping[str, Any]:
    """The section with the common parts of its expressions named, if one of them is large."""
    collected = [*filter(is_sympy, values_in(equations))]
    if not collected or max(int(x.count_ops()) for x in collected) < LARGE:
        return equations
    import sympy
    from sympy.core.function import AppliedUndef

    inside: dict[Any, Any] = {}
    for name, part in equations.get("intermediates", {}).items():
        if not is_sympy(part):
            return equations
        inside[sympy.Symbol(name)] = part.xreplace(inside)
    equations = {key: value for key, value in equations.items() if key != "intermediates"}
    collected = [x.xreplace(inside) for x in values_in(equations) if is_sympy(x)]

    plain: dict[Any, Any] = {}
    names: set[str] = set()
    for expression in collected:
        names |= {symbol.name for symbol in expression.atoms(sympy.Symbol)}
        for part in expression.atoms(AppliedUndef, sympy.Derivative):
            if (name := function_name(part)) is not None:
                plain[part] = sympy.Symbol(name)
    # a velocity may hold the function of its coordinate inside
    rates = {part: symbol for part, symbol in plain.items() if isinstance(part, sympy.Derivative)}
    names |= {symbol.name for symbol in plain.values()}
    free = (sympy.Symbol(f"z{k}") for k in count(1) if f"z{k}" not in names)
    common, short = sympy.cse([x.xreplace(rates).xreplace(plain) for x in collected], symbols=free, order="none")
    replaced = iter(short)
    result: dict[str, Any] = {}
    for key, value in equations.items():
        if key == "mass_matrix":
            result["intermediates"] = {str(symbol): expression for symbol, expression in common}
        result[key] = with_sympy(value, lambda x: next(replaced))
    return result
