"""Notation, names: the name of a quantity -> the LaTeX that a textbook prints for it.

The first part of a name is the symbol and the others its subscript: ``l_12``, ``x_hub_left``.  Names of Greek letters
become the letters, digits at the end a subscript (``theta1``), words stay upright.
"""

from __future__ import annotations

import re

from ..texts import visible
from .signs import GREEK

_RATE = re.compile(r"(.+)_(d+)ot\Z")
_PART = re.compile(r"([A-Za-z]+?)(\d+)([A-Za-z]?)\Z", re.ASCII)
_OF_MARKER = re.compile(r"([vaw]?)([xyz])\((.+)\)\Z")
_ENTRY = re.compile(r"(.+)\[(\d+)\]\Z")
_CALL = re.compile(r"(\w+)\((.*)\)\Z", re.ASCII)
_ESCAPED = re.compile(r"[_%]")
_SPECIAL = re.compile(r"[^ A-Za-z0-9_%+\-=*/().,:;|!\[\]?]")
#: Beginnings of names of two or three letters that are symbols with their axes: forces, moments, velocities, ...
_AXES = re.compile(r"([A-Za-z])([xyz]{1,2}|[XYZ]{1,2})\Z")
#: Two small letters that are a word.
_WORDS = ("ab", "ad", "am", "an", "as", "at", "be", "by", "do", "ex", "go", "he", "hi", "id", "if", "in", "is", "it",
          "me", "my", "no", "of", "oh", "ok", "on", "or", "so", "to", "up", "us", "we")  # fmt: skip
_MOTIONS = {"v": "v", "a": "a", "w": r"\omega"}
_DOTTED = {"dot": 1, "ddot": 2}
#: Other spellings: Python keeps ``lambda`` for itself, and ``th`` is written for an angle where names are short.
_SPELLED = {"lamda": "lambda", "th": "theta"}


def rate_of(name: str, times: int = 1) -> str:
    """``u`` -> ``u_dot``, ``u_dot`` -> ``u_ddot``: what the rate of a quantity is called."""
    stem, order = split_rate(name)
    return f"{stem}_{'d' * (order + times)}ot"


def split_rate(name: str) -> tuple[str, int]:
    """``u_ddot`` -> (``u``, 2)."""
    found = _RATE.match(name)
    return (found[1], len(found[2])) if found else (name, 0)


def literal(name: str, style: str = "mathrm") -> str:
    """The name itself, upright, in LaTeX; what LaTeX does not hold is shown by its number."""
    shown = _SPECIAL.sub(lambda c: f"(U+{ord(c[0]):04X})", visible(name, lines=False)) or "?"
    return rf"\{style}{{{_ESCAPED.sub(lambda c: chr(92) + c[0], shown)}}}".replace(" ", r"\ ")


def latex_of(name: str) -> str:
    r"""The LaTeX of a name that is no rate: ``theta1`` -> ``\theta_1``.

    Names of instances come before their dot and stand at the end: ``leg.theta1`` -> ``\theta_{1,\mathrm{leg}}``.
    """
    if found := _OF_MARKER.match(name):
        head = _MOTIONS[found[1]] if found[1] else found[2]
        return _with(head, [*([found[2]] if found[1] else []), _upright(found[3])])
    if found := _ENTRY.match(name):
        head, subs = _head_and_subs(found[1])
        return _with(head, [*subs, found[2]])
    if found := _CALL.match(name):
        return f"{_with(*_head_and_subs(found[1]))}({_upright(found[2]) if found[2] else ''})"
    path, _, own = name.rpartition(".")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.]*", name, re.ASCII) or not own.strip("_"):
        return literal(name)
    head, subs = _head_and_subs(own)
    return _with(head, [*subs, *([_upright(path)] if path else [])])


def _head_and_subs(name: str) -> tuple[str, list[str]]:
    first, *parts = [part for part in name.split("_") if part]
    if not parts:
        return _first(first)
    if re.fullmatch("[vaw][xyz]", parts[-1]) and len(first) > 1:
        last = parts[-1]  # rod_wx: the angular velocity of the rod about x
        return _MOTIONS[last[0]], [*map(_sub, (first, *parts[:-1])), last[1]]
    head, subs = _first(first)
    if head.startswith(r"\mathrm"):
        head, subs = _upright(first), []  # leg1_x
    if len(parts) > 1 and parts[0] in _DOTTED:  # theta_dot_max
        head, parts = rf"\{parts[0]}{{{head}}}", parts[1:]
    return head, [*subs, *map(_sub, parts)]


def _first(word: str) -> tuple[str, list[str]]:
    """The symbol of the first part of a name, and subscripts that it brings."""
    if (letter := _letter(word)) is not None:
        return letter, []
    if found := _PART.match(word):
        head, subs = _first(found[1])
        last = found[2] + found[3]
        return head, [*subs, last]
    if found := _AXES.match(word):
        return (r"\omega" if found[1] == "w" else found[1]), [found[2]]
    if len(word) == 2 and not word.isupper() and word not in _WORDS and word[0] != "d":
        return word[0], [word[1]]  # mc, kp, Fn, rA
    for size in (1, 2):  # thetaA, omegaAB
        if (letter := _letter(word[:-size])) is not None and len(word) > size + 1 and word[-size:].isupper():
            return letter, [word[-size:]]
    return _upright(word), []


def _letter(word: str) -> str | None:
    """One letter, Latin or Greek."""
    word = _SPELLED.get(word, word)
    return rf"\{word}" if word in GREEK or word == "ell" else word if len(word) == 1 and word.isalpha() else None


def _sub(part: str) -> str:
    """A part of a subscript."""
    if part.isdecimal() or re.fullmatch("[xyz]{2,3}|[A-Z]{2}", part):
        return part
    if (letter := _letter(part)) is not None:
        return letter
    if (found := _PART.match(part)) and not found[3] and (letter := _letter(found[1])) is not None:
        return f"{letter}{found[2]}"
    return _upright(part)


def _upright(text: str) -> str:
    return literal(text)


def _with(head: str, subs: list[str]) -> str:
    """A symbol with its subscripts, words next to each other in one."""
    if not subs:
        return head
    joined = ",".join(subs).replace(r"},\mathrm{", ",")
    return f"{head}_{joined}" if len(joined) == 1 else f"{head}_{{{joined}}}"
