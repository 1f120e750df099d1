"""What C libraries that stand alone have besides: bounds of operations and of the stack, sources in single precision.

Types, functions of math.h and numbers are exchanged in the text, comments included, so that no operation is left in
double precision by accident: processors that know single precision alone would carry it out in software.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from functools import cache
from math import floor, log, log2, prod
from typing import cast

from ..base.limits.numbers import EPS, SINGLE_COARSE, SINGLE_FAR
from ..base.operations import FUNCTION, OPERATIONS
from ..errors import cannot
from ..expr.schedule import Operations
from ..native.limits import CROSSINGS_REACH, CROSSINGS_SHORTEST, KINDS
from .c_functions import used_calls
from .linear_algebra import factoring_operations
from .pair_sums import refuse_sums
from .program import Block, Program

#: Bytes of the registers that a function saves, its return address and alignment, on processors of up to 32 registers.
_FRAME = 32 * 8
PAIRS = 5  #: of states beside a change point, as in eomgen/native/right_hand_side.c
_PLACE = 8  #: bytes of a variable, also where numbers or pointers have 4
_NUMBER = re.compile(r"\b([A-Z]\w*) = ([\w +*]+)")
_STRUCT = re.compile(r"typedef struct (?:\w+ )?\{\n(.*?)\} (\w+);", re.DOTALL)
_FUNCTION = re.compile(r"^[a-zA-Z][\w *]*?\b(\w+)\(([^;{}]*?)\)\s*\{\n(.*?)^\}", re.MULTILINE | re.DOTALL)
_ARRAY = re.compile(r"\w+((?:\[[^\]]+\])+)")
_CALL = re.compile(r"\b(\w+)\(")
_KERNEL = re.compile(r"^EOMGEN_(?:FUNCTION|SOLVED)\((\w+), (\w+), \d+\)$", re.MULTILINE)
_CALLED = (
    r"int \1(EOMGEN_ARGUMENTS)\n{\n    eom_at at;\n    int status = \2(at), checked = check_rows() + check_finite();\n}"
)
_EXPRESSION = re.compile(r"^ *(?:const real \w+|out\[.*\]) = (.*);(?: /\*.*)?$", re.MULTILINE)
_OPERATOR = re.compile(r"[*/]| [+-] |(?<!\w)-(?=[\w(])")
_EVALUATION = re.compile(r"\b(?:EVALUATE|STEP)\((\w+)")  #: of a straight-line function of the model, by the solvers


def operations_of(program: Program, name: str) -> str:
    """What one call of a public function carries out, in words."""
    kernel = next(k for k in program.kernels if k.name == name)
    if isinstance(kernel, Block):
        return f"{_counted(program.counts[program.aliases.get(name, name)])}"
    together = _counted(sum((program.counts[part] for part in kernel.blocks), Operations()))
    if not program.has_loops and name == "rhs" and "tree" not in program.block_names and not program.tree_by_columns:
        return f"{together}, and {factoring_operations(program.parent)} to solve for the accelerations"
    return f"{together} in straight-line parts, which it may repeat"


def states_beside_change_points() -> int:
    """How many states a function looks at, at most, where the position that it is given is next to a change point."""
    return 1 + 2 * PAIRS * (floor(log2(CROSSINGS_REACH / CROSSINGS_SHORTEST)) + 1)


def _counted(operations: Operations) -> str:
    parts = {
        "additions": operations.additions,
        "multiplications": operations.multiplications,
        "divisions": operations.divisions,
        **operations.functions,
        "comparisons and choices": sum(operations.choices.values()),
    }
    return ", ".join(f"{n} {what}" for what, n in parts.items() if n) or "no operations"


def stack_of(sources: Iterable[str], name: str, sizes: Mapping[str, str]) -> dict[str, int]:
    """Bytes on the stack that each function of C sources needs at most, with all that it calls of them.

    Every variable and every operation is counted with a place of its own, which compilers need not give it, and every
    function with a frame of its own, also where it becomes a part of its caller.  The model's name stands before names
    of functions that another file calls; sizes are further numbers that lengths of arrays are made of.
    """
    texts = [_KERNEL.sub(_CALLED, text) for text in sources]
    named = [pair for text in texts for pair in _NUMBER.findall(text)]  # of several, the greatest comes last
    numbers = dict(sorted(named, key=lambda pair: int(pair[1]) if pair[1].isdigit() else -1)) | dict(sizes)
    structs = {name: body for text in texts for body, name in _STRUCT.findall(text)}
    types = "|".join(("real", "double", "float", "int", "flag", "bits", "short", *structs))
    declaration = re.compile(rf"^\s*(?:for \()?(?:const )?({types})\b([^;]*);", re.MULTILINE)

    def places(text: str) -> int:
        result = 0
        for kind, names in declaration.findall(text):
            each = places(structs[kind]) if kind in structs and not names.lstrip().startswith("*") else 1
            arrays = _ARRAY.findall(re.sub(r"=\s*\{[^{}]*\}|=[^,]*", "", names))
            result += each * (1 + names.count(",")) + sum(_length(lengths, numbers) for lengths in arrays)
        return result + sum(len(_OPERATOR.findall(expression)) for expression in _EXPRESSION.findall(text))

    size: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for text in texts:
        for function, parameters, body in _FUNCTION.findall(text):
            count = parameters.count(",") + (6 if "EOMGEN_ARGUMENTS" in parameters else 1)
            function = function.removeprefix(f"{name}_") if function.endswith("_block") else function
            size[function] = max(size.get(function, 0), _FRAME + _PLACE * (places(body) + count))
            called = (*_CALL.findall(body), *(f"{block}_block" for block in _EVALUATION.findall(body)))
            calls.setdefault(function, set()).update(called)

    @cache
    def total(function: str) -> int:
        return size[function] + max((total(each) for each in calls[function] & size.keys() - {function}), default=0)

    return {function: total(function) for function in size}


def _length(lengths: str, numbers: Mapping[str, str]) -> int:
    """Numbers in an array, each of its lengths of sums and products of names and whole numbers."""
    return prod(_whole(length, numbers) for length in re.findall(r"\[([^\]]+)\]", lengths))


def _whole(of: str | ast.expr, numbers: Mapping[str, str]) -> int:
    """The value of a sum or product of whole numbers and of names of such."""
    node = cast(ast.Expr, ast.parse(of.strip()).body[0]).value if isinstance(of, str) else of
    if isinstance(node, ast.BinOp):
        left, right = _whole(node.left, numbers), _whole(node.right, numbers)
        return left * right if isinstance(node.op, ast.Mult) else left + right
    return _whole(numbers[node.id], numbers) if isinstance(node, ast.Name) else int(ast.unparse(node))


SINGLE_EPS = 2.0**-23  #: distance from 1 to the next number of single precision
LEAST, MOST = 2.0**-126, 2.0**127  #: normal numbers of single precision
_DIGITS = log(SINGLE_EPS) / log(EPS)
_RANGE = log(LEAST) / log(2.0**-1022)

_DECIMAL = r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?(?![\w.])"
_LIMIT = re.compile(rf"^(#define (?:{'|'.join(KINDS)})_\w+) (\S+)$", re.MULTILINE)
_FUNCTIONS = {row.name for row in OPERATIONS.values() if row.kind == FUNCTION} | {
    *("fabs", "sqrt", "floor", "ceil", "ldexp", "frexp", "fmin", "fmax", "nextafter"),
}
_TOKEN = re.compile(
    r'(?P<text>"(?:\\.|[^"\\])*"|^#include[^\n]*$)'
    r"|(?P<comment>/\*(?s:.*?)\*/)"
    r"|(?P<type>\bdouble\b)"
    rf"|(?P<function>\b(?:{'|'.join(sorted(_FUNCTIONS))})\b(?=\(|\)$))"
    r"|(?P<huge>\bHUGE_VAL\b)"
    rf"|(?P<number>{_DECIMAL})",
    re.MULTILINE,
)


def single_limit(value: float) -> float:
    """A limit of double precision -> that of single precision: the same power of the distance between numbers.

    So a few roundings stay a few roundings, and half of the digits half of the digits.  Stand-ins for zero and infinity
    keep their place in the range of numbers.
    """
    if not SINGLE_FAR < value < 1.0 / SINGLE_FAR:
        return float(value**_RANGE)
    return float(value**_DIGITS) if value < SINGLE_COARSE else value


def refuse_double(program: Program) -> None:
    """Refuse what cannot be written in single precision. Raises UsageError."""
    refuse_sums(program, "precision='float'")
    laws = program.metadata.get("reaction_laws", [])
    if laws:
        raise cannot(
            f"precision='float': the forces of {', '.join(laws)} depend on reactions, which are solved for to more "
            "digits than single precision has; use precision='double'"
        )
    native = sorted({f.name for f, _ in used_calls(program).values() if f.native is not None})
    if native:
        raise cannot(
            f"precision='float': the C source of the native function {', '.join(native)} is written in double "
            "precision; use precision='double'"
        )


def in_single_precision(sources: Mapping[str, str]) -> dict[str, str]:
    """All C sources and headers in single precision, other files as they are."""
    return {name: _converted(name, text) if name.endswith((".c", ".h")) else text for name, text in sources.items()}


def _converted(name: str, text: str) -> str:
    text = f"#define EOMGEN_SINGLE\n{text}" if name == "eomgen_real.h" else text
    limits = _LIMIT.sub(lambda match: f"{match[1]} {single_limit(float(match[2]))!r}", text)
    return _TOKEN.sub(_exchanged, limits)


def _exchanged(match: re.Match[str]) -> str:
    token = match[0]
    kind = match.lastgroup
    if kind == "comment":
        return re.sub(r"\bdouble(s?)\b", r"float\1", token)
    if kind == "type":
        return "float"
    if kind == "function":
        return f"{token}f"
    if kind == "huge":
        return "HUGE_VALF"
    if kind == "number":
        value = float(token)
        if value and not LEAST <= value <= MOST:
            return f"{single_limit(value)!r}f"
        return f"{token}f"
    return token
