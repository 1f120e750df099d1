"""Text -> graph, by a whitelist over Python's syntax tree; nothing is ever executed.

Allowed are numbers, names, ``+ - * / **``, comparisons, ``and or not``, ``a if c else b``, the functions of
:func:`~eomgen.model.names.callable_names`, functions that the graph declares and, where markers can be resolved (in
outputs), ``x``, ``vx``, ``wx`` and the like of a marker, ``rod.tip`` or ``rod``.  Comparisons and logic give 1 or 0.
Length, depth, size, numbers and exponents are bounded, so hostile text costs no more than honest text.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..base.operations import OPERATIONS
from ..base.texts import parse_python, quote
from ..errors import ExpressionError, no_number
from ..expr.core import Expr, Graph
from .names import callable_names, nearest
from .quantities import HEADS, MULTIPLIER, OF_ELEMENTS, QUANTITIES, REACTION, WRENCH, Call, Named

LENGTH = 4000  #: characters of one expression
DEPTH = 60  #: nesting
NODES = 2000  #: names, numbers and operations
EXPONENT = 1000.0  #: size of a numeric exponent

#: A name -> its expression; may raise :class:`ExpressionError` or note the fault and return a placeholder.
Resolve = Callable[[str], Expr]
#: The motion of a marker, such as ``vx(rod.tip)``, or what an element does, as ``force(k1)``, -> its expression.
Locate = Callable[[Named], Expr]

_FOREIGN = re.compile(r"[^A-Za-z0-9_.,+\-*/()<>=! \t\r\n]")
#: A number that runs into a word: Python reads it as two, with a warning of its own.
_JOINED = re.compile(r"(?<![A-Za-z0-9_])\.?[0-9][0-9A-Za-z_.]*?(and|or|not|if|is|in|else)")
#: Keywords of motions that Python does not allow as such, and what stands for them in its tree.
_KEYWORDS = {"in": "_n", "from": "_rom"}
_KEYWORD = re.compile(r"\b(in|from)(?=\s*=(?!=))")
_LARGE = "EG-TOO-LARGE"
_UNFINISHED = "close the bracket; between { } of a model file put an expression with commas in quotes"
_HINTS = {
    "%": "there is no remainder operator",
    "'": "text is not allowed in an expression",
    '"': "text is not allowed in an expression",
    "[": "subscripts and lists are not allowed in an expression",
    "{": "braces are not allowed in an expression",
    ":": "neither ':=', lambda nor slices have a place in an expression",
    "&": "write 'and'",
    "|": "write 'or', or abs(a)",
    "^": "write ** for powers",
    "\u00b0": "write deg(30) for 30 degrees",
}
_BINARY = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul", ast.Div: "div", ast.Pow: "pow"}
_COMPARISONS: dict[type[ast.cmpop], tuple[str, bool, bool]] = {  # operation, operands exchanged, negated
    ast.Lt: ("lt", False, False),
    ast.LtE: ("le", False, False),
    ast.Gt: ("lt", True, False),
    ast.GtE: ("le", True, False),
    ast.Eq: ("eq", False, False),
    ast.NotEq: ("eq", False, True),
}
_REFUSED: dict[type[ast.AST], str] = {
    ast.Attribute: "a dot can be used only for markers inside x(...), vx(...) and the like",
    ast.Tuple: "one expression is expected, not several",
    ast.Starred: "'*' cannot be used before a name",
    ast.Await: "'await' is not allowed in an expression",
    ast.Yield: "'yield' is not allowed in an expression",
    ast.YieldFrom: "'yield' is not allowed in an expression",
    ast.GeneratorExp: "loops are not allowed in an expression",
    ast.Lambda: "'lambda' is not allowed in an expression",
}


def allowed() -> str:
    """What an expression may hold, for messages."""
    start = "allowed are numbers such as 1.5 (no units), names, + - * / ** between them, comparisons, and, or, not, "
    return f"{start}'a if c else b' and the functions {' '.join(callable_names())}"


def parse(text: str, graph: Graph, resolve: Resolve, locate: Locate | None = None) -> Expr:
    """The graph expression of a text as in a model file, e.g. ``"m_r*l**2/12"``.

    ``resolve`` gives the expression of a name, ``locate`` that of a marker's motion; without it such calls are refused.
    An ExpressionError says what is not allowed, in which column, and what is.
    """
    walker = _Walker(text, 0, graph, resolve, locate)
    if len(text) > LENGTH:
        raise walker.wrong(0, f"an expression of {len(text)} characters is too long", f"at most {LENGTH}", _LARGE)
    if not text.strip():
        raise walker.wrong(0, "the expression is empty")
    if foreign := _FOREIGN.search(text):
        mark = foreign.group()
        raise walker.wrong(foreign.start(), f"{mark!r} is not allowed in an expression", _HINTS.get(mark))
    if joined := _JOINED.search(text):
        message = f"a number is followed directly by {joined[1]!r}"
        raise walker.wrong(joined.start(1), message, "write a space between them")
    line = _KEYWORD.sub(lambda result: _KEYWORDS[result[1]], re.sub(r"\s", " ", text))
    walker.start = len(line) - len(line.lstrip())
    try:
        tree = parse_python(line[walker.start :].rstrip() + "\n", statement=True)
    except SyntaxError as error:
        remedy = _UNFINISHED if "never closed" in error.msg else None
        column = (error.offset or 1) + walker.start - 1
        raise walker.wrong(column, f"not a valid expression ({error.msg})", remedy) from None
    except (ValueError, MemoryError, RecursionError):
        raise walker.wrong(0, "nested too deeply", f"at most {DEPTH} levels", _LARGE) from None
    body = tree.body
    if len(body) != 1 or not isinstance(body[0], ast.Expr):
        raise walker.wrong(walker.start, "this is a statement, not an expression")
    return walker.walk(body[0].value, 0)


def names_in(text: str) -> set[str]:
    """Names of values that a text uses; none if the text is no expression."""
    if len(text) > LENGTH or _JOINED.search(text):
        return set()
    try:
        parts = [*ast.walk(parse_python(re.sub(r"\s", " ", text).strip() + "\n", statement=True))]
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        return set()
    called = {id(part.func) for part in parts if isinstance(part, ast.Call)}
    names = {part.id for part in parts if isinstance(part, ast.Name) and id(part) not in called and part.id.isascii()}
    return names - {"pi"}


@dataclass
class _Walker:
    """Turns a syntax tree into nodes of the graph; every kind of node it does not know is refused."""

    text: str
    start: int  #: of the expression in it
    graph: Graph
    resolve: Resolve
    locate: Locate | None
    callables: Mapping[str, tuple[int, int]] = field(default_factory=callable_names)
    size: int = 0

    def wrong(self, place: int, message: str, remedy: str | None = None, code: str = "") -> ExpressionError:
        """What is wrong at a place of the text."""
        return ExpressionError(message, place + 1, allowed() if remedy is None else remedy, self.text, code=code)

    def fault(self, node: ast.AST, message: str, remedy: str | None = None, code: str = "") -> ExpressionError:
        return self.wrong(getattr(node, "col_offset", 0) + self.start, message, remedy, code)

    def walk(self, node: ast.expr, depth: int) -> Expr:
        self.size += 1
        if self.size > NODES:
            raise self.fault(node, "the expression is too large", f"at most {NODES} names, numbers and operations")
        if depth > DEPTH:
            raise self.fault(node, "nested too deeply", f"at most {DEPTH} levels")
        if isinstance(node, ast.Constant):
            return self.number(node)
        if isinstance(node, ast.Name):
            return self.name(node)
        if isinstance(node, ast.BinOp):
            return self.binary(node, depth)
        if isinstance(node, ast.UnaryOp):
            return self.unary(node, depth)
        if isinstance(node, ast.Call):
            return self.call(node, depth)
        if isinstance(node, ast.Compare):
            return self.compare(node, depth)
        if isinstance(node, ast.BoolOp):
            operation = "and" if isinstance(node.op, ast.And) else "or"
            return self.fold(node, operation, [self.walk(value, depth + 1) for value in node.values])
        if isinstance(node, ast.IfExp):
            parts = [self.walk(part, depth + 1) for part in (node.test, node.body, node.orelse)]
            return self.apply(node, "select", *parts)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Call):
            word = _label(node.value.func)
            if word in (REACTION, MULTIPLIER, WRENCH):
                return self.quantity(node.value, word, node.attr)
        raise self.fault(node, _REFUSED.get(type(node), f"{type(node).__name__} is not allowed in an expression"))

    def number(self, node: ast.Constant) -> Expr:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fault(node, f"{value!r} is not a number", "write 1 or 0 for true or false; " + allowed())
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.fault(node, "the number is too large", "numbers go up to 1.7e308")
        return self.graph.constant(number)

    def name(self, node: ast.Name) -> Expr:
        if node.id == "pi":
            return self.graph.constant(math.pi)
        if node.id in self.callables or node.id in self.graph.functions:
            raise self.fault(node, f"{node.id!r} is a function", f"write {node.id}(...)")
        try:
            return self.resolve(node.id)
        except ExpressionError as error:
            raise self.fault(node, error.message, error.remedy, error.code) from None

    def binary(self, node: ast.BinOp, depth: int) -> Expr:
        chain = [node]  # a long sum leans to the left; walking its spine keeps that from counting as depth
        while isinstance(chain[-1].left, ast.BinOp):
            chain.append(chain[-1].left)
        value = self.walk(chain[-1].left, depth + 1)
        for link in reversed(chain):
            operation = _BINARY.get(type(link.op))
            if operation is None:
                sign = "//" if isinstance(link.op, ast.FloorDiv) else type(link.op).__name__
                raise self.fault(link, f"the operator {sign} is not allowed in an expression", "write / for a quotient")
            self.size += 1
            value = self.apply(link, operation, value, self.walk(link.right, depth + 1))
        return value

    def unary(self, node: ast.UnaryOp, depth: int) -> Expr:
        if isinstance(node.op, ast.Invert):
            raise self.fault(node, "the operator '~' is not allowed in an expression", "write 'not'")
        value = self.walk(node.operand, depth + 1)
        if isinstance(node.op, ast.USub):
            return -value
        return value if isinstance(node.op, ast.UAdd) else self.apply(node, "not", value)

    def compare(self, node: ast.Compare, depth: int) -> Expr:
        values = [self.walk(value, depth + 1) for value in (node.left, *node.comparators)]
        results = []
        for operator, a, b in zip(node.ops, values, values[1:], strict=False):
            if type(operator) not in _COMPARISONS:
                raise self.fault(node, "'is' and 'in' are not allowed in an expression", "compare with < <= > >= == !=")
            operation, exchanged, negated = _COMPARISONS[type(operator)]
            result = self.apply(node, operation, *((b, a) if exchanged else (a, b)))
            results.append(self.apply(node, "not", result) if negated else result)
        return self.fold(node, "and", results)

    def call(self, node: ast.Call, depth: int) -> Expr:
        if not isinstance(node.func, ast.Name):
            raise self.fault(node, "only the listed functions can be called")
        name = node.func.id
        if name in HEADS and name not in self.callables and (name in QUANTITIES or name not in self.graph.functions):
            return self.quantity(node, name)
        if node.keywords:
            raise self.fault(node, f"{name}() takes no keywords")
        declared = self.graph.functions.get(name)
        if name not in self.callables and declared is None:
            known = [*self.callables, *self.graph.functions, *((*QUANTITIES, *OF_ELEMENTS) if self.locate else ())]
            raise self.fault(node, f"unknown function {name!r}", nearest(name, known, "functions"))
        least, most = self.callables[name] if declared is None else (declared.arity, declared.arity)
        if not least <= len(node.args) <= most:
            number = f"{least}" if least == most else f"{least} or more"
            plural = "" if number == "1" else "s"
            raise self.fault(node, f"{name}() takes {number} argument{plural}, not {len(node.args)}", "")
        if name == "diff":
            return self.derivative(node, depth)
        arguments = [self.walk(argument, depth + 1) for argument in node.args]
        if declared is not None:
            zeros = (0,) * declared.arity
            return Expr(self.graph, self.graph.call(declared, zeros, [x.id for x in arguments]))
        if name == "deg":  # an angle in degrees
            return self.apply(
                node,
                "div",
                self.apply(node, "mul", *arguments, self.graph.constant(math.pi)),
                self.graph.constant(180.0),
            )
        if name == "heaviside":  # 0, 1/2 at 0, 1
            return 0.5 * (1.0 + self.apply(node, "sign", *arguments))
        row = next(row for row in OPERATIONS.values() if row.word == name)
        return self.fold(node, row.name, arguments) if row.many else self.apply(node, row.name, *arguments)

    def derivative(self, node: ast.Call, depth: int) -> Expr:
        """``diff(f(x, y), 1, 0)``: a derivative of a declared function, one order for each of its arguments."""
        call, *rest = node.args
        name = call.func.id if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) else ""
        declared = self.graph.functions.get(name)
        if declared is None:
            known = ", ".join(self.graph.functions) or "none"
            raise self.fault(node, "diff() takes a call of a declared function", f"declared functions: {known}")
        value = self.walk(call, depth + 1)
        orders = [x.value for x in rest if isinstance(x, ast.Constant) and type(x.value) is int and x.value <= 3]
        if len(orders) != len(rest) or len(orders) != declared.arity:
            raise self.fault(node, f"diff() takes {declared.arity} order(s) after the call", "allowed: 0, 1, 2, 3")
        return Expr(self.graph, self.graph.call(declared, tuple(map(int, orders)), value.node[1:]))

    def quantity(self, node: ast.Call, name: str, part: str = "") -> Expr:
        """``vx(rod.tip, in=road)``, ``force(k1)``, ``reaction(A).x``, ``multiplier(mesh.ratio)``."""
        if self.locate is None:
            what = "of a marker " if name in QUANTITIES else ""
            remedy = "use it in outputs, events and the laws of force elements"
            raise self.fault(node, f"{name}(...) {what}cannot be used here", remedy)
        keywords = {word: key for key, word in _KEYWORDS.items()}
        raw = {keywords.get(x.arg or "**", x.arg or "**"): _label(x.value) for x in node.keywords}
        try:
            if len(raw) < len(node.keywords):
                raise ExpressionError(f"{name}() is given a keyword twice", 0, "leave one out")
            return self.locate(Named.read(Call(name, [_label(x) for x in node.args], raw, part)))
        except ExpressionError as error:
            raise self.fault(node.args[0] if node.args else node, error.message, error.remedy, error.code) from None

    def fold(self, node: ast.expr, operation: str, values: list[Expr]) -> Expr:
        result = values[0]
        for value in values[1:]:
            result = self.apply(node, operation, result, value)
        return result

    def apply(self, node: ast.expr, operation: str, *operands: Expr) -> Expr:
        """One node; constants must fold to a finite number, so a fault shows here and not at run time."""
        if operation == "pow":
            exponent = operands[1].value
            if exponent is not None and abs(exponent) > EXPONENT:
                raise self.fault(node, f"the exponent {exponent:g} is too large", f"at most {EXPONENT:g}")
        if operation == "div" and operands[1].is_zero:
            raise self.fault(node, "division by zero", "")
        try:
            result = self.graph.apply(operation, *operands)
        except OverflowError:
            result = None
        if result is None or (result.value is None and all(x.value is not None for x in operands)):
            raise self.fault(node, "the value is not a finite real number", "")
        return result


def _label(node: ast.expr) -> str:
    """A name, or names between dots; empty for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    before = _label(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{before}.{node.attr}" if before and isinstance(node, ast.Attribute) else ""


def constant(text: str, what: str) -> float:
    """The value of an expression of numbers; UsageError for names, which have none."""
    allowed = "write numbers, pi and functions of them"

    def resolve(name: str) -> Expr:
        if name == text.strip():
            raise no_number(f"{what} must be a number, not {quote(text)}; {allowed}")
        raise ExpressionError(f"{name!r} is not a number", remedy=allowed)

    try:
        value = parse(text, Graph(), resolve).value
    except ExpressionError as error:
        raise no_number(f"{what} must be a number: {error}") from None
    if value is None:
        raise no_number(f"{what} must be a number, not {text!r}")
    return float(value)
