"""Stage describe, signatures: C text -> what a function of it takes and gives, as far as plain reading can tell."""

from __future__ import annotations

import re
from typing import NamedTuple

_HIDDEN = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.DOTALL)
_QUALIFIERS = {"const", "static", "inline", "extern", "register", "volatile", "restrict"}
_OTHERS = {"int", "float", "char", "short", "long", "unsigned", "signed", "void", "_Bool", "bool", "struct", "union"}


class Signature(NamedTuple):
    """A C function as it is defined or declared."""

    line: int  #: where its name stands
    arguments: int
    foreign: str  #: the first type that is surely not a plain double, or empty


def find_signature(text: str, name: str) -> Signature | None:
    """Where and how a C function is defined; None if that cannot be seen, as behind a macro.

    Parameters
    ----------
    text : str
        C source.
    name : str
        Of the function.
    """
    bare = _HIDDEN.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    pattern = rf"(?P<given>[A-Za-z_]\w*(?:\s+[A-Za-z_]\w*|\s*\*)*)[\s*]*\b{name}\s*\((?P<taken>[^()]*)\)\s*[{{;]"
    for found in re.finditer(pattern, bare):
        given = found["given"].split()
        if given[0] in ("return", "else", "case"):
            continue  # a call
        taken = [part.strip() for part in found["taken"].split(",")]
        taken = [] if taken in ([""], ["void"]) else taken
        foreign = next((part for part in [" ".join(given), *taken] if _is_foreign(part)), "")
        return Signature(bare.count("\n", 0, found.start("taken")) + 1, len(taken), " ".join(foreign.split()))
    return None


def _is_foreign(declared: str) -> bool:
    """Whether words that declare a value are surely not those of a double."""
    if "*" in declared or "[" in declared:
        return True
    words = [word for word in declared.split() if word not in _QUALIFIERS]
    return bool(words) and words[0] in _OTHERS
