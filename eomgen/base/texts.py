"""Free text of a user -> messages, terminals, HTML; lines -> the width of a terminal; Python's text -> its tree; names.

Nothing else in eomgen quotes or escapes but this, and :mod:`eomgen.expr.texts` for generated files.
"""

from __future__ import annotations

import os
import re
import sys
import threading
from collections.abc import Iterable, Mapping, Sequence
from math import tau
from typing import Any

from .limits.numbers import SHOWN_COMPLEX


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


def one_line(text: str) -> str:
    """One printable line, as the attributes of XML hold it."""
    return visible(" ".join(text.split()), lines=False)


def html_text(text: str) -> str:
    """The inside of an element or of an attribute in quotes, of HTML, XML and SVG."""
    from html import escape  # slow to import

    return escape(visible(text), quote=True)


def html_table(title: str, facts: Iterable[tuple[str, str]], doc: str = "") -> str:
    """A small table of labels and values for notebooks."""
    left = "style='text-align:left'"
    rows = "".join(f"<tr><th {left}>{html_text(a)}</th><td {left}>{html_text(b)}</td></tr>" for a, b in facts)
    return f"<b>{html_text(title)}</b>{f'<p>{html_text(doc)}</p>' if doc else ''}<table>{rows}</table>"


def quote(raw: Any) -> str:
    """What was given, in one line of a message."""
    try:
        text = " ".join(repr(raw).split())
    except Exception:  # its own __repr__, or an integer of thousands of digits
        return f"an object of type {type(raw).__name__}, which cannot be shown"
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


# -- axes of plots -----------------------------------------------------------------------------------------------------


TIME = "$t$ (s)"


def label(printed: str, unit: str) -> str:
    """A name as it is printed with its unit, or either alone; no dollar of the unit begins a formula."""
    unit = visible(unit, lines=False).replace("$", r"\$")
    return f"{printed} ({unit})" if printed and unit else printed or unit


# -- Python's own text -------------------------------------------------------------------------------------------------


# CPython 3.11 counts the depth of trees that it builds for all threads together, so two at once may fail with
# SystemError: AST constructor recursion depth mismatch (python/cpython issue 106905).
_LOCK = threading.Lock()


def parse_python(text: str, statement: bool = False) -> Any:
    """As :func:`ast.parse`, one thread at a time; of a module Python would look for a file to quote from."""
    import ast

    with _LOCK:
        return ast.parse(text, mode="single") if statement else ast.parse(text)


# -- names: those that were probably meant; parts of dotted names; places of markers -----------------------------------


LONGEST = 64  #: characters of a name

MOST = 2000  #: names beyond which a comparison with each takes long


def closest(name: object, known: Iterable[str], most: int = 1) -> list[str]:
    """At most so many known names, those spelled most alike first; one that differs in case alone is the only one."""
    from difflib import get_close_matches  # only needed once something is wrong

    folded = {option.lower(): option for option in known}
    word = str(name).lower()
    if word in folded:
        return [folded[word]]
    return [folded[near] for near in get_close_matches(word, folded, most)] if len(folded) <= MOST else []


def hint(name: object, known: Iterable[str], quoted: bool = True) -> str:
    """``"did you mean 'theta'?"`` if a known name is near, else an empty text."""
    near = closest(name, known)
    return "" if not near else f"did you mean {near[0]!r}?" if quoted else f"did you mean {near[0]}?"


def joined(*parts: str, by: str = "; ") -> str:
    """The parts that are not empty."""
    return by.join(part for part in parts if part)


# -- names of instances: ``leg1.hip``, as people write it, -> ``leg1_hip``, as the model has it ------------------------


def undotted(name: str, instances: Mapping[str, str]) -> str:
    """A name whose first part is an instance: its prefix and the rest, instances within instances too.

    As ``leg1.hip``, or ``leg1.shin.end`` of a marker; ``instances`` has the prefix of each instance.
    """
    head, _, rest = name.partition(".")
    while rest and head in instances:
        name = instances[head] + rest
        head, _, rest = name.partition(".")
    return name


# -- place and velocity of a marker, in ground axes: ``x(rod.tip)`` and ``vx(rod.tip)`` --------------------------------


_PLACE = re.compile(r"(v?[xyz])\((\w+(?:\.\w+)*)\)")


def place_of_marker(name: object) -> tuple[str, str] | None:
    """``x`` or ``vx`` and the marker of a name such as ``x(rod.tip)``; None for other names."""
    match = _PLACE.fullmatch(name.replace(" ", "")) if isinstance(name, str) else None
    return (match[1], match[2]) if match else None


def acceleration_name(velocity: str) -> str:
    """``theta_dot`` -> ``theta_ddot``; ``ball_wx`` -> ``ball_wx_dot``."""
    return velocity[:-4] + "_ddot" if velocity.endswith("_dot") else velocity + "_dot"
