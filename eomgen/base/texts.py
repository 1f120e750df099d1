"""Free text of a user -> the languages it is written in; lines -> the width of a terminal.

Names in generated code are ASCII identifiers, checked where a model is built.  Every other text of a user (doc, unit,
labels that hold expressions, file names) goes through one of these functions, one for each language, wherever it is
written: nothing else in eomgen quotes or escapes.  Metadata of a model holds texts as they are, as JSON.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence
from math import isfinite, tau
from typing import Any

from .limits.numbers import SHOWN, SHOWN_COMPLEX

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
_SURROGATES = re.compile("[\ud800-\udbff][\udc00-\udfff]")
_LONE = re.compile("[\ud800-\udfff]")


def join_surrogates(text: str) -> str:
    """The text with each pair of surrogates, as JSON writes a character beyond U+FFFF, as that character."""
    return _SURROGATES.sub(lambda pair: pair[0].encode("utf-16", "surrogatepass").decode("utf-16"), text)


def lone_surrogate(text: str) -> str:
    """``U+D83D`` of the first half of a pair that stands alone, which no file can hold; empty if there is none."""
    found = _LONE.search(join_surrogates(text))
    return f"U+{ord(found[0]):04X}" if found else ""


#: What to do about one.
WHOLE = "write the character itself, or both halves of its pair"


def _number(c: str) -> str:
    """A character as Python and TOML both write it where it cannot stand for itself."""
    if c in '\\"':
        return f"\\{c}"
    return f"\\u{ord(c):04x}" if ord(c) <= 0xFFFF else f"\\U{ord(c):08x}"


def visible(text: str, lines: bool = True) -> str:
    r"""The text for terminals and plain files: what does not print is shown as its number, such as ``\x1b``.

    Control characters, escape sequences, separators of lines and marks of direction lose their effect.

    Parameters
    ----------
    text : str
    lines : bool, optional
        Whether newlines and tabs stay; else they are shown too.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or (lines and c in "\n\t") else repr(c)[1:-1] for c in text)


def shortened(text: str, longest: int) -> str:
    """The beginning of a text that is longer."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def comment_text(text: str) -> str:
    """One line for the inside of a comment of C, Python, TOML, YAML or make.

    The result is printable ASCII without a backslash and without ``*/``, ``/*`` and ``??``; other characters are shown
    as ``<U+00B5>``.  So C's trigraphs and joined lines change nothing in it, and no comment ends in it.
    """
    shown = _OUTSIDE.sub(lambda c: f"<U+{ord(c[0]):04X}>", " ".join(text.split()))
    return _PAIRS.sub(" ", shown)


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
    shown = (c if c.isprintable() and c not in '\\"\ufeff' else _number(c) for c in text)
    return f'"{"".join(shown)}"'


def one_line(text: str) -> str:
    """One printable line, as the attributes of XML hold it."""
    return visible(" ".join(text.split()), lines=False)


def summary_text(text: str) -> str:
    """One printable line, as the descriptions of packages must be; shortened where it is long."""
    return shortened(one_line(text), 500)


def markdown_text(text: str) -> str:
    """Paragraphs of Markdown that show the text: no markup of it takes effect, nor HTML."""
    paragraphs = re.split(r"\n\s*\n", visible(text).strip())
    words = (" ".join(paragraph.split()) for paragraph in paragraphs)
    return "\n\n".join(_MARKUP.sub(lambda c: f"&#{ord(c[0])};" if c[0] in "&<>" else f"\\{c[0]}", w) for w in words)


def markdown_code(text: str) -> str:
    """A line of code within Markdown, with its backticks."""
    return f"`{one_line(text).replace('`', chr(39))}`"


def html_text(text: str) -> str:
    """The inside of an element or of an attribute in quotes, of HTML, XML and SVG."""
    from html import escape  # slow to import

    return escape(visible(text), quote=True)


def html_table(title: str, facts: Iterable[tuple[str, str]], doc: str = "") -> str:
    """A small table of labels and values for notebooks."""
    left = "style='text-align:left'"
    rows = "".join(f"<tr><th {left}>{html_text(a)}</th><td {left}>{html_text(b)}</td></tr>" for a, b in facts)
    return f"<b>{html_text(title)}</b>{f'<p>{html_text(doc)}</p>' if doc else ''}<table>{rows}</table>"


def shown(given: Any) -> str:
    """What was given, in one line of a message."""
    try:
        text = " ".join(repr(given).split())
    except Exception:  # its own __repr__, or an integer of thousands of digits
        return f"an object of type {type(given).__name__}, which cannot be shown"
    return text if len(text) <= 80 else f"{text[:80]}..."


def angle_in_degrees(name: str, value: float) -> str:
    """The note on an initial angle beyond ``limits.motions.MOST_ANGLE``, as degrees would be."""
    return (
        f"{name} = {value:g} is an angle of {value / tau:.3g} turns, as angles are in radians; write "
        f"deg({value:g}) if these are degrees"
    )


# -- lines that fit a terminal -----------------------------------------------------------------------------------------


NARROWEST = 40  #: characters of a line, however narrow the terminal is


def terminal_width() -> int | None:
    """Characters of a line: what the variable ``COLUMNS`` says, else the width of the terminal that is printed to.

    None where the standard output is a file, a pipe or a notebook and ``COLUMNS`` is no positive number.
    """
    said = os.environ.get("COLUMNS", "")
    if not sys.stdout.isatty() and not (said.isdecimal() and int(said) > 0):
        return None
    import shutil  # slow to import, as textwrap is

    return max(shutil.get_terminal_size().columns, NARROWEST)  # which looks at COLUMNS first


def fold(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """The text in lines of at most so many characters, broken between words; each begins with ``first`` or ``rest``."""
    from textwrap import wrap

    return wrap(
        text, width, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


def aligned_rows(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Lines of labels and values, the values aligned; on a terminal, long values go on in the lines below."""
    label_width = max((len(label) for label, _ in rows), default=0) + 4
    width = terminal_width()
    lines: list[str] = []
    for label, value in rows:
        first = f"  {label}".ljust(label_width)
        folded = fold(value, max(width, label_width + 20), first, " " * label_width) if width else []
        lines += folded or [first + value]
    return lines


# -- numbers of a result -----------------------------------------------------------------------------------------------


def number(value: complex, digits: int = 6) -> str:
    """A real or complex number as people read it."""
    value = complex(value)
    if abs(value.real) <= SHOWN_COMPLEX * abs(value.imag):  # rounding
        value = complex(0.0, value.imag)
    if abs(value.imag) <= SHOWN_COMPLEX * max(1.0, abs(value)):
        return f"{value.real:.{digits}g}"
    return f"{value.real:.{digits}g} {'+' if value.imag > 0 else '-'} {abs(value.imag):.{digits}g}j"


def without_noise(
    values: Sequence[float], units: Sequence[str] | None = None, sizes: Sequence[float] | None = None
) -> list[float]:
    """Values for a table, 0 where one is nothing beside the largest of its unit.

    Parameters
    ----------
    values : sequence of float
    units : sequence of str, optional
        Of each; one for all by default.
    sizes : sequence of float, optional
        What each value is like elsewhere, over a run for instance; by default the values themselves.
    """
    units = units or [""] * len(values)
    largest = dict.fromkeys(units, 0.0)
    for unit, size in zip(units, sizes if sizes is not None else values, strict=True):
        largest[unit] = max(largest[unit], abs(size)) if isfinite(size) else largest[unit]
    return [0.0 if abs(x) <= SHOWN * largest[unit] else float(x) for x, unit in zip(values, units, strict=True)]
