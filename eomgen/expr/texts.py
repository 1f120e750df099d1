"""Texts of users -> texts in messages; comments and literals of the languages that files are generated in."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from typing import Any

from ..base import texts

# -- in messages -------------------------------------------------------------------------------------------------------

# A value of any kind has a text there, and the work for it always comes to an end.


LONGEST = 120  #: characters of a value in a message
EXPONENT = 10_000  #: of a number that SymPy may work out
#: Begins the text of a value that has none: SymPy prints recursively, Python refuses whole numbers of 4300 digits.
NO_TEXT = "<unprintable "


def printed(value: Any) -> str:
    """The text of a value, whole."""
    return _text(value, str if _prints(value) else None)


def _text(value: Any, write: Callable[[Any], str] | None) -> str:
    try:
        if write is not None:
            return write(value)
    except Exception:  # of many classes: the value may be of any
        pass
    return f"{NO_TEXT}{type(value).__name__}>"


def shortened(value: Any, longest: int = LONGEST) -> str:
    """The text of a value, cut where it is long."""
    return texts.shortened(printed(value), longest)


def quoted(value: Any, longest: int = LONGEST) -> str:
    """The value as Python writes it, cut where it is long."""
    plain = isinstance(value, str | int | float | list | tuple | dict)
    return texts.shortened(_text(value, repr) if plain else printed(value), longest)


def _prints(value: Any) -> bool:
    """Whether a value can be printed at all: of SymPy only plain expressions.

    SymPy's printer asks for signs, and works out powers of powers of numbers, sums and roots to tell them: for any
    time, and by running texts as code.
    """
    sympy = sys.modules.get("sympy")
    if sympy is None or not isinstance(value, sympy.Basic):
        return not isinstance(value, type)
    plain: tuple[Any, ...] = (sympy.AtomicExpr, sympy.Add, sympy.Mul, sympy.Pow, sympy.Derivative, sympy.Subs)
    plain += (sympy.Function, sympy.core.relational.Relational, sympy.logic.boolalg.Boolean, sympy.Tuple)
    plain += (sympy.functions.elementary.piecewise.ExprCondPair, sympy.core.symbol.Str)
    return all(isinstance(part, plain) and not is_tower(part) and not _grows(part) for part in parts_of(value))


def _grows(part: Any) -> bool:
    """Whether a part of a SymPy expression is a number that takes any time to write or to work out.

    Such are a Float of millions of digits, and what grows as exp does of a large number or of what grows too.
    """
    sympy = sys.modules["sympy"]
    if isinstance(part, sympy.Float):
        return bool(abs(part._mpf_[2]) > EXPONENT)
    growing = (sympy.exp, sympy.gamma, sympy.loggamma, sympy.factorial, sympy.sinh, sympy.cosh, sympy.Pow)
    if not isinstance(part, growing[:-1]):
        return False
    below = [x for argument in part.args for x in parts_of(argument)]  # is_number would recurse
    if any(isinstance(x, sympy.Symbol) for x in below):
        return False
    return any(isinstance(x, growing) or (x.is_Number and x is not sympy.nan and abs(x) > EXPONENT) for x in below)


def parts_of(value: Any) -> Iterator[Any]:
    """Every part of a SymPy expression, each object once, without recursion: expressions may be deep."""
    stack: list[Any] = [value]
    seen: set[int] = set()
    while stack:
        part = stack.pop()
        if id(part) in seen:  # the expression keeps its parts alive
            continue
        seen.add(id(part))
        yield part
        arguments = getattr(part, "args", ())
        stack += arguments if isinstance(arguments, tuple) else ()  # those of a class are no tuple


def is_tower(part: Any) -> bool:
    """Whether a part of a SymPy expression is a power of numbers too large to work out, such as 9**(9**9)."""
    sympy = sys.modules["sympy"]
    if not isinstance(part, sympy.Pow):
        return False
    if part.exp.is_Number:
        return bool(part.base.is_Number and abs(part.exp) > EXPONENT)
    return bool(part.exp.args) and not any(isinstance(x, sympy.Symbol | sympy.Function) for x in parts_of(part.exp))


# -- in generated files ------------------------------------------------------------------------------------------------

# Names in generated code are ASCII identifiers, checked where a model is built.  Every other text of a user (doc, unit,
# labels that hold expressions, file names) goes through one of these functions, one for each language, wherever it is
# written.  Metadata of a model holds texts as they are, as JSON.


#: Characters of the generated lines that hold a comment or a literal.
WIDTH = 114
#: What Python's docstrings and TOML's strings cannot hold as it is.
_ESCAPED = re.compile(r"[^ !#-\[\]-~]")
#: What a comment cannot hold: all but printable ASCII, and the backslash, which joins lines.
_OUTSIDE = re.compile(r"[^ -\[\]-~]")
#: Beginnings and ends of comments, and of trigraphs.
_PAIRS = re.compile(r"(?<=\*)(?=/)|(?<=/)(?=\*)|(?<=\?)(?=\?)")
#: Markup of Markdown, of the formulas that some readers show in it, and of HTML.
_MARKUP = re.compile(r"[\\`*_{}\[\]<>()#+\-!|~$&@^]|(?<=^[0-9])\.")


def _number(c: str) -> str:
    """A character as Python and TOML both write it where it cannot stand for itself."""
    if c in '\\"':
        return f"\\{c}"
    return f"\\u{ord(c):04x}" if ord(c) <= 0xFFFF else f"\\U{ord(c):08x}"


def comment_text(text: str) -> str:
    """One line for the inside of a comment of C, Python, TOML, YAML or make.

    The result is printable ASCII without a backslash and without ``*/``, ``/*`` and ``??``; other characters are shown
    as ``<U+00B5>``.  So C's trigraphs and joined lines change nothing in it, and no comment ends in it.
    """
    plain = _OUTSIDE.sub(lambda c: f"<U+{ord(c[0]):04X}>", " ".join(text.split()))
    return _PAIRS.sub(" ", plain)


def comment_lines(text: str, margin: str) -> str:
    """A comment as lines after the first begin with a margin; only spaces become newlines."""
    from textwrap import wrap

    return f"\n{margin}".join(wrap(comment_text(text), WIDTH, break_long_words=False, break_on_hyphens=False))


def docstring_text(text: str) -> str:
    """The inside of a Python text in three double quotes, whose value is the text itself."""
    return "\n".join(_ESCAPED.sub(lambda c: _number(c[0]), line) for line in text.split("\n"))


def toml_text(text: str) -> str:
    """A TOML string with its quotes, whose value is the text."""
    return f'"{_ESCAPED.sub(lambda c: _number(c[0]), text)}"'


def yaml_quoted(text: str) -> str:
    """A YAML string in double quotes, whose value is the text; what prints stays as it is."""
    escaped = (c if c.isprintable() and c not in '\\"\ufeff' else _number(c) for c in text)
    return f'"{"".join(escaped)}"'


def markdown_text(text: str) -> str:
    """Paragraphs of Markdown that show the text: no markup of it takes effect, nor HTML."""
    paragraphs = re.split(r"\n\s*\n", texts.visible(text).strip())
    plain = (" ".join(paragraph.split()) for paragraph in paragraphs)
    return "\n\n".join(_MARKUP.sub(lambda c: f"&#{ord(c[0])};" if c[0] in "&<>" else f"\\{c[0]}", w) for w in plain)


def markdown_code(text: str) -> str:
    """A line of code within Markdown, with its backticks."""
    return f"`{texts.one_line(text).replace('`', chr(39))}`"
