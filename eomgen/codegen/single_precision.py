"""C sources in double precision -> the same in single precision.

Types, functions of math.h and numbers are exchanged in the text, comments included, so that no operation is left in
double precision by accident: processors that know single precision alone would carry it out in software.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import log

from ..base.limits.in_c import KINDS
from ..base.limits.numbers import EPS, SINGLE_COARSE, SINGLE_FAR
from ..base.operations import FUNCTION, OPERATIONS
from ..errors import cannot
from .c_functions import used_calls
from .pair_sums import refuse_sums
from .program import Program

SINGLE_EPS = 2.0**-23  #: distance from 1 to the next number of single precision
LEAST, MOST = 2.0**-126, 2.0**127  #: normal numbers of single precision
_DIGITS = log(SINGLE_EPS) / log(EPS)
_RANGE = log(LEAST) / log(2.0**-1022)

_NUMBER = r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?(?![\w.])"
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
    rf"|(?P<number>{_NUMBER})",
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
    """Refuse what cannot be written in single precision.

    Raises
    ------
    UsageError
    """
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
