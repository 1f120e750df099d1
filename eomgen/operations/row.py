"""What a row of the table of operations says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

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
        None for 1.  Taylor series follow from it.  None where emit/c_series.py has a formula of its own.
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
        """Whether it may jump or bend."""
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
        """Its SymPy expression."""
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
    given: dict[str, Any] = {
        "c": f"each_{name}({places})",
        "numpy": f"np.{getattr(array, '__name__', name)}({places})",
        "recurrence": lambda g, y, *x: (tuple(slope(g, y, *x) for slope in slopes), None),
        "sympy": sympy,
        "sympy_class": sympy if isinstance(sympy, str) else "",
        "word": name,
        "digits": name,
    }
    return Operation(name, FUNCTION, value, array, arity=len(slopes), slopes=slopes, rates=rates, **(given | more))


def choice(name: str, value: Callable[..., float], array: Callable[..., Any], c: str, **more: Any) -> Operation:
    """A row of a choice, which does not round; one operand unless ``more`` says otherwise."""
    numpy = f"np.{name if name in ('abs', 'sign') else getattr(array, '__name__', name)}{c[c.index('(') :]}"
    given: dict[str, Any] = {"numpy": numpy, "word": name, "exact": True}
    return Operation(name, CHOICE, value, array, c, **(given | more))


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
