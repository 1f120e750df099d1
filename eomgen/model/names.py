"""A name the user chose -> what is wrong with it, or the name they probably meant."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Collection, Iterable

from ..base.names import LONGEST as LONGEST
from ..base.names import hint, joined
from ..base.operations import OPERATIONS
from ..expr.shown import quoted

#: Arguments that a function of any number of them takes at most.
MOST = 64
LISTED = 20  #: names that a message lists at most


def function_words() -> dict[str, tuple[int, int]]:
    """Functions an expression may call, with the least and the greatest number of arguments."""
    rows = [row for row in OPERATIONS.values() if row.word]
    found = {row.word: (row.arity, MOST if row.many else row.arity) for row in rows}
    return {**found, "heaviside": (1, 1), "deg": (1, 1), "diff": (2, 17)}


_C_KEYWORDS = frozenset(
    word
    for line in (
        "auto break case char const continue default do double else enum extern float for goto if inline int long",
        "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while",
    )
    for word in line.split()
)
#: Packages that an exported package imports, or the like, and its own parts.
_NEEDED = frozenset(("numpy", "scipy", "pandas", "matplotlib", "sympy", "cython", "setuptools", "eomgen"))
_NEEDED |= {"errors", "limits", "numeric", "runtime"}
#: Headers in quotes in what Cython writes, in lower case: some systems do not tell it from upper case in file names.
_HEADERS = frozenset(("python", "pythread", "structmember", "frameobject"))
_STRANGE = re.compile(r"[^A-Za-z0-9_]")
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z", re.ASCII)

IDENTIFIER_RULE = "a name must start with a letter and contain only letters a to z, digits and underscores"


def fault_of_name(name: object, symbol: bool = False) -> tuple[str, str] | None:
    """What is wrong with a name.

    Parameters
    ----------
    name : object
        The name as given; anything but text is a fault.
    symbol : bool
        Whether the name will stand in expressions by itself (parameter, input, coordinate, output), so that names
        with a meaning of their own are refused too.

    Returns
    -------
    (message, remedy) or None
        None if the name can be used.
    """
    if not isinstance(name, str):
        return f"{quoted(name)} is not a name", IDENTIFIER_RULE
    if not _IDENTIFIER.match(name):
        cut = name.count(")") > name.count("(")  # by a comma: {shake: hypot(x, y)}
        remedy = "an expression with commas must stand in quotes between { }; " if cut else ""
        return f"{quoted(name)} is not an identifier", remedy + IDENTIFIER_RULE
    if len(name) > LONGEST:
        return f"a name of {len(name)} characters is too long", f"at most {LONGEST} characters"
    if keyword.iskeyword(name):
        return f"{name!r} is a reserved word of Python", f"choose another name, e.g. {name}_"
    if symbol:
        if name in _C_KEYWORDS:
            return f"{name!r} is a reserved word of C", f"choose another name, e.g. {name}_"
        if name == "t":
            return "'t' is reserved for the time", "choose another name"
        if name == "pi":
            return "'pi' is reserved for the number pi", "choose another name"
        if name in function_words():
            return f"{name!r} is a built-in function", f"choose another name, e.g. {name}_"
    return None


def clean_name(name: str, kind: str) -> str:
    """An identifier as near to a name as can be."""
    result = _STRANGE.sub("_", name)
    if not result[:1].isalpha():
        result = f"{kind}_{result.lstrip('_')}"
    return f"{result}_" if fault_of_name(result[:LONGEST], symbol=True) else result


def unique(name: str, kind: str, taken: set[str], suffixes: Collection[str] = ("",)) -> str:
    """A clean name, with a number where it is taken with one of the suffixes; it is taken with all of them then."""
    base = new = clean_name(name, kind)[: LONGEST - 12]  # leaves place for a number and _ddot
    count = 1
    while not taken.isdisjoint(new + suffix for suffix in suffixes):
        count, new = count + 1, f"{base}_{count + 1}"
    taken.update(new + suffix for suffix in suffixes)
    return new


def fault_of_model_name(name: object) -> tuple[str, str] | None:
    """What is wrong with the name of a model, which is that of the package generated; see :func:`fault_of_name`."""
    if isinstance(name, str) and (name in _NEEDED or name in sys.stdlib_module_names):
        whose = "a module that eomgen needs" if name in _NEEDED else "a module of Python's library"
        return f"a package {name!r} would hide {whose}", f"choose another name, e.g. {name}_model"
    if isinstance(name, str) and (name.lower() in _HEADERS or re.match("eom(gen|_|$)", name.lower())):
        return (
            f"{name[:LONGEST]!r} is a name of files and functions that every package has",
            "choose another name, e.g. my_model",
        )
    return fault_of_name(name, symbol=True)


def listing(known: Iterable[str], most: int = LISTED) -> str:
    """The first names joined by commas, and how many there are; ``"none"`` if there are none."""
    names = list(known)
    shown = ", ".join(names[:most])
    return (shown + f", ... ({len(names)} in all)" if len(names) > most else shown) or "none"


def nearest(name: str, known: Iterable[str], what: str = "known") -> str:
    """A remedy for an unknown name: the near miss if there is one, and what is allowed."""
    options = list(known)
    return joined(hint(name, options), f"{what}: {listing(options)}", by=" ")
