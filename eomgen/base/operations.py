"""The table of operations: all that eomgen knows of each operation of an expression, one row an operation.

Values, derivatives, rounding, simplification, SymPy's form, words of model files, text in C and NumPy, Taylor series
and counts are looked up here, also where a generated package runs without the graph.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

# -- what a row says ---------------------------------------------------------------------------------------------------


ARITHMETIC, FUNCTION, CHOICE, CONDITION = "arithmetic", "function", "choice", "condition"
ODD, EVEN = -1, 1
_OPERANDS = ("a", "b", "c")


class Operation(NamedTuple):
    """One operation.

    Attributes
    ----------
    name : str
    kind : {ARITHMETIC, FUNCTION, CHOICE, CONDITION}
        + - * / and signs; C and mpmath have a function of it; bends or jumps; gives 1 or 0.
    value : callable
        On floats; outside of its domain it raises ArithmeticError or ValueError.
    array : callable
        On floats and arrays, as IEEE 754 has it everywhere.
    c, numpy : str
        Text with a place for each operand, C's over ``real`` of eomgen_real.h.
    arity : int
    slopes, rates : tuple of callable
        One each for every operand; none where the derivative is zero wherever it exists.
    body : str
        What the C function named in ``c`` returns, of a, b, c; empty if it is one of math.h or of eomgen's headers.
    choice : callable
        (graph, operands...) -> condition, operand if true, operand if false.  What a branch not taken does must not
        leak into the derivative.
    rule : callable
        (graph, operands...) -> the id of what it is simplified to, or None.
    error : callable
        (y, operands, bounds of their errors) -> bound of the error of y, where first order is none; on arrays.
    rounding : callable
        (y, operands...) -> size of its own rounding, in units in the last place of 1.
    recurrence : callable
        (graph, y, operands...) -> numerators, one an operand, and divisor of y' = sum (numerator operand') / divisor,
        None for 1.  Taylor series follow from it.  None where codegen/c_series.py has a formula of its own.
    sympy : str or callable
        Name of SymPy's function, or (sympy, operands...) -> expression.
    sympy_class : str
        The class of SymPy, or of its ``codegen.cfunctions``, that is this operation.
    word : str
        As expressions of model files call it; empty if they do not.
    digits : str
        mpmath's function; empty if ``value`` holds for numbers of any kind.
    parity : {ODD, EVEN, 0}
        f(-a) = -f(a), f(-a) = f(a), or neither.
    commutative, many : bool
        Operands may change places; words and SymPy's classes take any number of them.
    dimension : {"pure", "alike", "ratio", "sign", "product", "quotient", "power", "root", "choice"}
        How that of the value follows from those of the operands: operands and value without; all operands of one, and
        the value; of one, the value without; of any, the value without; multiplied; divided; times a power; its half;
        as "alike" save for the first.
    exact, analytic, fragile, jumps : bool
        Does not round; what vanishes around a point vanishes everywhere; may give a result that is not finite; jumps
        where its operands are equal, or its one operand is 0.
    """

    name: str
    kind: str
    value: Callable[..., float]
    array: Callable[..., Any]
    c: str
    numpy: str
    arity: int = 1
    slopes: tuple[Callable[..., int], ...] = ()
    rates: tuple[Callable[..., Any], ...] = ()
    body: str = ""
    choice: Callable[..., tuple[int, int, int]] | None = None
    rule: Callable[..., int | None] | None = None
    error: Callable[..., Any] | None = None
    rounding: Callable[..., Any] = lambda y, *x: abs(y)
    recurrence: Callable[..., Any] | None = None
    sympy: str | Callable[..., Any] = ""
    sympy_class: str = ""
    word: str = ""
    digits: str = ""
    parity: int = 0
    commutative: bool = False
    many: bool = False
    dimension: str = "pure"
    exact: bool = False
    analytic: bool = False
    fragile: bool = False
    jumps: bool = False

    @property
    def bends(self) -> bool:
        return self.kind in (CHOICE, CONDITION)

    @property
    def chooses(self) -> bool:
        """Whether its first operand is a condition, the others are values."""
        return self.kind == CHOICE and self.arity == 3

    @property
    def takes_numbers(self) -> bool:
        """Whether in C a number may stand beside a ``real``: an operator between two operands."""
        return self.arity == 2 and not self.body and (self.kind == ARITHMETIC or self.jumps)

    @property
    def plain_c(self) -> str:
        """Its value in C of the doubles a, b, c."""
        if self.kind == FUNCTION:
            return f"{self.name}({', '.join(_OPERANDS[: self.arity])})"
        return self.body or self.c.format("a != 0.0" if self.chooses else "a", "b", "c")

    def raised(self, sympy: Any, *operands: Any) -> Any:
        return getattr(sympy, self.sympy)(*operands) if isinstance(self.sympy, str) else self.sympy(sympy, *operands)


def function(
    name: str,
    value: Callable[..., float],
    array: Callable[..., Any],
    slopes: tuple[Callable[..., int], ...],
    rates: tuple[Callable[..., Any], ...],
    **more: Any,
) -> Operation:
    """A row of a function that C, SymPy, mpmath and model files know by its name, unless ``more`` says otherwise."""
    places = ", ".join(["{}"] * len(slopes))
    sympy = more.get("sympy", name)
    raw: dict[str, Any] = {
        "c": f"each_{name}({places})",
        "numpy": f"np.{getattr(array, '__name__', name)}({places})",
        "recurrence": lambda g, y, *x: (tuple(slope(g, y, *x) for slope in slopes), None),
        "sympy": sympy,
        "sympy_class": sympy if isinstance(sympy, str) else "",
        "word": name,
        "digits": name,
    }
    return Operation(name, FUNCTION, value, array, arity=len(slopes), slopes=slopes, rates=rates, **(raw | more))


def choice(name: str, value: Callable[..., float], array: Callable[..., Any], c: str, **more: Any) -> Operation:
    """A row of a choice, which does not round; one operand unless ``more`` says otherwise."""
    numpy = f"np.{name if name in ('abs', 'sign') else getattr(array, '__name__', name)}{c[c.index('(') :]}"
    raw: dict[str, Any] = {"numpy": numpy, "word": name, "exact": True}
    return Operation(name, CHOICE, value, array, c, **(raw | more))


def condition(
    name: str, value: Callable[..., bool], array: Callable[..., Any], c: str, sympy: str, **more: Any
) -> Operation:
    """A row of a condition; in NumPy's text it is the condition itself, as a value 1.0 or 0.0."""
    arity = c.count("{}")
    return Operation(
        name,
        CONDITION,
        lambda *x: 1.0 if value(*x) else 0.0,
        lambda *x: array(*x) * 1.0,
        c,
        f"np.{array.__name__}({', '.join(['{}'] * arity)})",
        arity,
        sympy=sympy,
        sympy_class=sympy,
        exact=True,
        **more,
    )


# -- the rows ----------------------------------------------------------------------------------------------------------


def over(g: Any, a: int) -> int:
    """1 / a."""
    return int(g.div(g.one.id, a))


def _one_and(g: Any, way: str, a: int) -> int:
    """1 + a^2, or with "sub" 1 - a^2."""
    return int(getattr(g, way)(g.one.id, g.mul(a, a)))


def _root(g: Any, a: int) -> int:
    return int(g.make("sqrt", a))


def _squares(g: Any, a: int, b: int) -> int:
    return int(g.add(g.mul(a, a), g.mul(b, b)))


def _root_of_square(g: Any, a: int) -> int | None:
    kind, *factors = g.nodes[a]
    return g.make("abs", factors[0]) if kind == "mul" and factors[0] == factors[1] else None


def _length(g: Any, a: int, b: int) -> int | None:
    """The root of one square, which has a slope at 0 that |v| has and v / |v| has not."""
    return g.make("abs", b if a == g.zero.id else a) if g.zero.id in (a, b) else None


def _chosen(g: Any, c: int, a: int, b: int) -> int | None:
    kind, *known = g.nodes[c]
    return (a if known[0] else b) if kind == "const" else a if a == b else None


def _absorbing(g: Any, a: int, b: int) -> int | None:
    first, second = g.nodes[a], g.nodes[b]
    if first[0] == "neg" or second[0] == "neg":
        minus = (first[0] == "neg") != (second[0] == "neg")
        made = g.make("absorb", first[1] if first[0] == "neg" else a, second[1] if second[0] == "neg" else b)
        return int(g.neg(made)) if minus else int(made)
    return int(g.mul(a, b)) if "const" in (first[0], second[0]) else None


def _one(g: Any, *ids: int) -> int:
    return int(g.one.id)


def unit(y: Any, *x: Any) -> float:
    """The rate 1."""
    return 1.0


def _turned(y: Any, a: Any) -> Any:
    """Of a sine or cosine: also formed from those of the parts of a sum, by two products and a sum."""
    return abs(y) + 2.0


def _sign(a: float) -> float:
    return float((a > 0) - (a < 0)) if a == a else a


ROWS = (
    Operation(
        "add", ARITHMETIC, operator.add, np.add, "{} + {}", "{} + {}", 2, (_one, _one), (unit, unit),
        rule=lambda g, a, b: g.add(a, b), sympy=lambda s, a, b: a + b, commutative=True, analytic=True,
        dimension="alike",
    ),
    Operation(
        "sub", ARITHMETIC, operator.sub, np.subtract, "{} - {}", "{} - {}", 2,
        (_one, lambda g, y, a, b: g.neg(g.one.id)), (unit, unit),
        rule=lambda g, a, b: g.sub(a, b), sympy=lambda s, a, b: a - b, analytic=True,
        dimension="alike",
    ),
    Operation(
        "mul", ARITHMETIC, operator.mul, np.multiply, "{}*{}", "{} * {}", 2,
        (lambda g, y, a, b: b, lambda g, y, a, b: a), (lambda y, a, b: abs(b), lambda y, a, b: abs(a)),
        error=lambda y, x, e: abs(x[0]) * e[1] + abs(x[1]) * e[0] + e[0] * e[1],
        rule=lambda g, a, b: g.mul(a, b), sympy=lambda s, a, b: a * b, commutative=True, analytic=True,
        dimension="product",
    ),
    Operation(  # a b, and 0 where a (or its square, as under a root) is 0, whatever b is there: derivatives of roots
        "absorb", ARITHMETIC, lambda a, b: 0.0 if a * a == 0.0 else a * b,
        lambda a, b: np.where(a * a == 0.0, 0.0, a * b), "absorbing({}, {})",
        "np.where(np.equal({0} * {0}, 0.0), 0.0, {0} * {1})", 2,
        (lambda g, y, a, b: b, lambda g, y, a, b: a), (lambda y, a, b: abs(b), lambda y, a, b: abs(a)),
        body="choose(a*a == 0.0, same(0.0), a*b)", rule=_absorbing, sympy=lambda s, a, b: a * b,
        dimension="product",
    ),
    Operation(
        "div", ARITHMETIC, operator.truediv, np.divide, "{}/{}", "{} / {}", 2,
        (lambda g, y, a, b: over(g, b), lambda g, y, a, b: g.neg(g.mul(y, over(g, b)))),
        (lambda y, a, b: 1.0 / abs(b), lambda y, a, b: abs(y / b)),
        rule=lambda g, a, b: g.div(a, b), sympy=lambda s, a, b: a / b, analytic=True, fragile=True,
        dimension="quotient",
    ),
    Operation(
        "neg", ARITHMETIC, operator.neg, np.negative, "-{}", "-{}", 1, (lambda g, y, a: g.neg(g.one.id),), (unit,),
        rule=lambda g, a: g.neg(a), sympy=lambda s, a: -a, exact=True, analytic=True,
        dimension="alike",
    ),
    choice(
        "abs", abs, np.abs, "abs_of({})", slopes=(lambda g, y, a: g.make("sign", a),), rates=(unit,),
        sympy="Abs", sympy_class="Abs", parity=EVEN,
        dimension="alike",
    ),
    choice(
        "sign", _sign, np.sign, "sign_of({})",
        body="choose(a > 0.0, same(1.0), choose(a < 0.0, same(-1.0), choose(a == 0.0, same(0.0), a)))",
        sympy="sign", sympy_class="sign", jumps=True,
        dimension="sign",
    ),
    choice(  # NaN wins, as in numpy.minimum
        "min", lambda a, b: a if a <= b or a != a else b, np.minimum, "smaller({}, {})", arity=2,
        body="choose((a <= b) | (a != a), a, b)", choice=lambda g, a, b: (g.make("le", a, b), a, b),
        rates=(lambda y, a, b: y == a, lambda y, a, b: y != a), error=lambda y, x, e: np.maximum(*e),
        rule=lambda g, a, b: a if a == b else None,
        sympy="Min", sympy_class="Min", commutative=True, many=True,
        dimension="alike",
    ),
    choice(
        "max", lambda a, b: a if a >= b or a != a else b, np.maximum, "larger({}, {})", arity=2,
        body="choose((a >= b) | (a != a), a, b)", choice=lambda g, a, b: (g.make("le", b, a), a, b),
        rates=(lambda y, a, b: y == a, lambda y, a, b: y != a), error=lambda y, x, e: np.maximum(*e),
        rule=lambda g, a, b: a if a == b else None,
        sympy="Max", sympy_class="Max", commutative=True, many=True,
        dimension="alike",
    ),
    function(
        "pow", math.pow, np.power,
        (lambda g, y, a, b: g.mul(b, g.make("pow", a, g.sub(b, g.one.id))),
         lambda g, y, a, b: g.make("absorb", y, g.make("log", a))),
        (lambda y, a, b: abs(b * np.power(a, b - 1.0)), lambda y, a, b: abs(y * np.log(abs(a)))),
        rounding=lambda y, a, b: (2.0 + abs(b)) * abs(y),  # repeated products where b is whole
        rule=lambda g, a, b: g.power(a, b), recurrence=None,
        sympy=lambda s, a, b: a**b, word="", digits="power", fragile=True,
        dimension="power",
    ),
    function(
        "atan2", math.atan2, np.arctan2,  # a = opposite, b = adjacent
        (lambda g, y, a, b: g.mul(b, over(g, _squares(g, a, b))),
         lambda g, y, a, b: g.neg(g.mul(a, over(g, _squares(g, a, b))))),
        (lambda y, a, b: abs(b) / (a * a + b * b), lambda y, a, b: abs(a) / (a * a + b * b)),
        recurrence=lambda g, y, a, b: ((b, g.neg(a)), _squares(g, a, b)),
        dimension="ratio",
    ),
    function(
        "hypot", math.hypot, np.hypot, (lambda g, y, a, b: g.div(a, y), lambda g, y, a, b: g.div(b, y)),
        (lambda y, a, b: abs(a) / y, lambda y, a, b: abs(b) / y), recurrence=lambda g, y, a, b: ((a, b), y),
        rule=_length, sympy=lambda s, a, b: s.sqrt(a**2 + b**2), sympy_class="hypot", commutative=True,
        dimension="alike",
    ),
    function(
        "sqrt", math.sqrt, np.sqrt, (lambda g, y, a: g.div(g.constant(0.5).id, y),), (lambda y, a: 0.5 / y,),
        error=lambda y, x, e: np.fmin(0.5 * e[0] / y, np.sqrt(e[0])),
        rule=_root_of_square, recurrence=None, fragile=True,
        dimension="root",
    ),
    function("exp", math.exp, np.exp, (lambda g, y, a: y,), (lambda y, a: y,), analytic=True, fragile=True),
    function(
        "log", math.log, np.log, (lambda g, y, a: over(g, a),), (lambda y, a: 1.0 / abs(a),),
        recurrence=lambda g, y, a: ((g.one.id,), a), fragile=True,
    ),
    function(
        "sin", math.sin, np.sin, (lambda g, y, a: g.make("cos", a),), (lambda y, a: abs(np.cos(a)),),
        c="sine_of({})", rounding=_turned, parity=ODD, analytic=True,
    ),
    function(
        "cos", math.cos, np.cos, (lambda g, y, a: g.neg(g.make("sin", a)),), (lambda y, a: abs(np.sin(a)),),
        c="cosine_of({})", rounding=_turned, parity=EVEN, analytic=True,
    ),
    function(
        "tan", math.tan, np.tan, (lambda g, y, a: _one_and(g, "add", y),), (lambda y, a: 1.0 + y * y,),
        parity=ODD, analytic=True, fragile=True,
    ),
    function(
        "asin", math.asin, np.arcsin, (lambda g, y, a: over(g, _root(g, _one_and(g, "sub", a))),),
        (lambda y, a: 1.0 / np.sqrt(1.0 - a * a),), parity=ODD, fragile=True,
        recurrence=lambda g, y, a: ((g.one.id,), _root(g, _one_and(g, "sub", a))),
    ),
    function(
        "acos", math.acos, np.arccos, (lambda g, y, a: g.neg(over(g, _root(g, _one_and(g, "sub", a)))),),
        (lambda y, a: 1.0 / np.sqrt(1.0 - a * a),), fragile=True,
        recurrence=lambda g, y, a: ((g.neg(g.one.id),), _root(g, _one_and(g, "sub", a))),
    ),
    function(
        "atan", math.atan, np.arctan, (lambda g, y, a: over(g, _one_and(g, "add", a)),),
        (lambda y, a: 1.0 / (1.0 + a * a),), parity=ODD,
        recurrence=lambda g, y, a: ((g.one.id,), _one_and(g, "add", a)),
    ),
    function(
        "sinh", math.sinh, np.sinh, (lambda g, y, a: g.make("cosh", a),), (lambda y, a: np.cosh(a),),
        parity=ODD, analytic=True, fragile=True,
    ),
    function(
        "cosh", math.cosh, np.cosh, (lambda g, y, a: g.make("sinh", a),), (lambda y, a: abs(np.sinh(a)),),
        parity=EVEN, analytic=True, fragile=True,
    ),
    function(
        "tanh", math.tanh, np.tanh, (lambda g, y, a: _one_and(g, "sub", y),), (lambda y, a: 1.0 - y * y,),
        parity=ODD, analytic=True,
    ),
    function(
        "asinh", math.asinh, np.arcsinh, (lambda g, y, a: over(g, _root(g, _one_and(g, "add", a))),),
        (lambda y, a: 1.0 / np.sqrt(1.0 + a * a),), parity=ODD,
    ),
    function(
        "acosh", math.acosh, np.arccosh,
        (lambda g, y, a: g.div(over(g, _root(g, g.sub(a, g.one.id))), _root(g, g.add(a, g.one.id))),),
        (lambda y, a: 1.0 / np.sqrt((a - 1.0) * (a + 1.0)),), fragile=True,
    ),
    function(
        "atanh", math.atanh, np.arctanh, (lambda g, y, a: over(g, _one_and(g, "sub", a)),),
        (lambda y, a: 1.0 / (1.0 - a * a),), parity=ODD, fragile=True,
    ),
    condition("lt", operator.lt, np.less, "({} < {})", "Lt", jumps=True, dimension="ratio"),
    condition("le", operator.le, np.less_equal, "({} <= {})", "Le", jumps=True, dimension="ratio"),
    condition("eq", operator.eq, np.equal, "({} == {})", "Eq", commutative=True, jumps=True, dimension="ratio"),
    condition("not", operator.not_, np.logical_not, "({} == 0.0)", "Not"),
    condition(
        "and", lambda a, b: bool(a and b), np.logical_and, "(({} != 0.0) & ({} != 0.0))", "And",
        commutative=True, many=True,
    ),
    condition(
        "or", lambda a, b: bool(a or b), np.logical_or, "(({} != 0.0) | ({} != 0.0))", "Or",
        commutative=True, many=True,
    ),
    choice(
        "select", lambda c, a, b: a if c else b, lambda c, a, b: np.where(np.asarray(c) != 0.0, a, b),
        "choose({}, {}, {})", arity=3, numpy="np.where({}, {}, {})", choice=lambda g, c, a, b: (c, a, b),
        rates=(lambda y, c, a, b: 0.0, lambda y, c, a, b: c != 0.0, lambda y, c, a, b: c == 0.0),
        rule=_chosen,
        sympy=lambda s, c, a, b: s.Piecewise((a, c), (b, True)), word="where",
        dimension="choice",
    ),
)  # fmt: skip

OPERATIONS: dict[str, Operation] = {row.name: row for row in ROWS}


def operations_with(test: Callable[[Operation], bool]) -> frozenset[str]:
    """Names of the operations that pass a test."""
    return frozenset(name for name, row in OPERATIONS.items() if test(row))


def play_arrays(tape: Sequence[Any], p: Any, x: Any, t: Any = 0.0) -> list[Any]:
    """The results of a tape at parameters (n_p,) or (n_p, k), x (n, k) and times (k,), each a number or (k,)."""
    code, numbers, out = tape
    leaves = {"const": numbers, "p": p, "x": x, "t": [t]}
    results: list[Any] = []
    with np.errstate(all="ignore"):
        for op, a, b, c in code:
            if op in leaves:
                results.append(np.asarray(leaves[op][a], dtype=float))
            else:
                row = OPERATIONS[op]
                results.append(row.array(*(results[a], results[b], results[c])[: row.arity]))
    return [results[k] for k in out]


def tape_rows() -> str:
    """``#define EOMGEN_TAPE(X)`` with X(name, value of a, b, c) for every operation, for steppers/control.c."""
    rows = (f"X({row.name}, {row.plain_c})" for row in OPERATIONS.values())
    return " \\\n    ".join(["#define EOMGEN_TAPE(X)", *rows]) + "\n"
