"""Notation, reading: the LaTeX of one symbol -> its tree, or NotationError.

The words of LaTeX that may stand in a symbol are listed (:mod:`.signs`), so nothing else can come into a document, a
picture or a page: no command that reads or writes files, no end of the formula, no HTML.
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from ..suggestions import hint
from ..texts import visible
from .signs import ACCENTS, GREEK, LETTERS, PLAIN, SIGNS, SPACES, STYLES, SWITCHES

LONGEST = 120  #: characters of a symbol's LaTeX
DEEPEST = 8  #: groups within groups
_TOKEN = re.compile(r"\\(?:[A-Za-z]+ *|.)| +|.", re.DOTALL)
_SPACES = re.compile("[ \t\r\n]+")
_TEXT = ("text", "textbf", "textit")


class NotationError(ValueError):
    """A text is not the LaTeX of a symbol; ``remedy`` says what to write instead."""

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


class Sign(NamedTuple):
    """A letter, a digit or a sign: its LaTeX and its character; letters may bear dots."""

    latex: str
    text: str
    letter: bool = False
    start: int = 0
    end: int = 0


class Group(NamedTuple):
    """Parts side by side."""

    parts: tuple[Node, ...]
    start: int = 0
    end: int = 0


class Styled(NamedTuple):
    """A part in a style: rm, bf, it, sf, tt, cal, bb, frak, scr, or text, textbf, textit."""

    style: str
    body: Node
    start: int = 0
    end: int = 0


class Accent(NamedTuple):
    """An accent over a part."""

    accent: str
    body: Node
    start: int = 0
    end: int = 0


class Scripts(NamedTuple):
    """A part with a subscript, a superscript and primes."""

    base: Node
    sub: Node | None
    sup: Node | None
    primes: int = 0
    start: int = 0
    end: int = 0


class Fraction(NamedTuple):
    """A fraction."""

    above: Node
    below: Node
    start: int = 0
    end: int = 0


Node = Sign | Group | Styled | Accent | Scripts | Fraction


@cache
def read_latex(text: str) -> Node:
    r"""The tree of a symbol's LaTeX, such as ``q_{\rm f}``.

    Raises
    ------
    NotationError
        Braces do not match, a command is not one of a symbol, or a character would end the formula.
    """
    if not text.strip():
        raise NotationError("the LaTeX of a symbol is empty", "leave it out, or write for example \\theta_1")
    if len(text) > LONGEST:
        raise NotationError(f"the LaTeX of a symbol has {len(text)} characters", f"at most {LONGEST}")
    text = spaced(text)
    if text.endswith("\\") and not text.endswith("\\\\"):
        raise NotationError(f"{_shown(text)} ends in a backslash", "take it away")
    return _Reader(text).whole()


def spaced(text: str) -> str:
    """The text with single spaces, as an empty line would end a formula."""
    return _SPACES.sub(" ", text).strip(" ")


def _shown(text: str) -> str:
    return f"'{visible(text, lines=False)}'"


class _Reader:
    """Reads tokens from left to right."""

    def __init__(self, text: str) -> None:
        self.text, self.tokens = text, [(m[0], m.start()) for m in _TOKEN.finditer(text)]
        self.place, self.shown = 0, _shown(text)

    def whole(self) -> Node:
        found = self.row("", False, 0)
        if self.place < len(self.tokens):
            raise NotationError(f"{self.shown} has a '}}' without its '{{'", "write as many { as }")
        if _shows(found):
            return found
        raise NotationError(f"{self.shown} shows nothing", "write a letter, for example \\theta_1")

    def peek(self) -> str:
        return self.tokens[self.place][0] if self.place < len(self.tokens) else ""

    @property
    def offset(self) -> int:
        return self.tokens[self.place][1] if self.place < len(self.tokens) else len(self.text)

    def row(self, closing: str, text_mode: bool, depth: int) -> Node:
        """Parts up to a closing brace, which is left."""
        if depth > DEEPEST:
            raise NotationError(f"{self.shown} has groups within groups", f"at most {DEEPEST} of them")
        parts: list[Node] = []
        start = self.offset
        while (token := self.peek()) and token != "}":
            word = token[1:].strip() if token[0] == "\\" else ""
            if word in SWITCHES:
                begin = self.offset
                self.place += 1
                body = self.row(closing, text_mode, depth + 1)
                parts.append(Styled(word, body, begin, self.offset))
                break
            if token[0] == " ":
                self.place += 1
                if text_mode:
                    parts.append(Sign(" ", " ", start=self.offset, end=self.offset))
                continue
            parts.append(self.part(text_mode, depth))
        if closing and self.peek() != closing:
            raise NotationError(f"{self.shown} has a '{{' without its '}}'", "write as many { as }")
        return parts[0] if len(parts) == 1 else Group(tuple(parts), start, self.offset)

    def part(self, text_mode: bool, depth: int) -> Node:
        """A symbol with its scripts."""
        start = self.offset
        if self.peek() in ("_", "^", "'") and not text_mode:
            raise NotationError(f"{self.shown} has {self.peek()!r} with nothing before it", "write a letter before it")
        base = self.single(text_mode, depth)
        sub: Node | None = None
        sup: Node | None = None
        primes = 0
        while True:
            while self.peek()[:1] == " " and not text_mode:
                self.place += 1
            token = self.peek()
            if text_mode or token not in ("_", "^", "'") or not token:
                break
            self.place += 1
            if token == "'" and sup is None:
                primes += 1
            elif token == "_" and sub is None:
                sub = self.argument("_", False, depth)
            elif token == "^" and sup is None and not primes:
                sup = self.argument("^", False, depth)
            else:
                raise NotationError(f"{self.shown} has {token!r} twice", "put them together, as in l_{1,2}")
        if sub is None and sup is None and not primes:
            return base
        return Scripts(base, sub, sup, primes, start, self.offset)

    def single(self, text_mode: bool, depth: int) -> Node:
        """A group, a letter or a command with its argument."""
        token, start = self.peek(), self.offset
        self.place += 1
        if token == "{":
            body = self.row("}", text_mode, depth + 1)
            self.place += 1
            return Group((body,), start, self.offset)
        if token[0] == "\\":
            return self.command(token[1:].strip() or " ", start, text_mode, depth)
        if token.isascii() and (token.isalnum() or token in PLAIN):
            return Sign(token, token, token.isalpha(), start, start + 1)
        self.refuse(token, text_mode)
        raise AssertionError  # not reached

    def refuse(self, token: str, text_mode: bool) -> None:
        greek = next((word for word, sign in GREEK.items() if sign == token), "")
        if greek:
            raise NotationError(f"{self.shown} has the letter {token}", f"write \\{greek}")
        if text_mode and token in "_^'":
            raise NotationError(f"{self.shown} has {token!r} in \\text", "write \\mathrm in place of \\text")
        what = f"{token!r}" if token.isprintable() else f"the character U+{ord(token):04X}"
        raise NotationError(f"{self.shown} has {what}, which no symbol has", "letters, digits, _ ^ { } and commands")

    def command(self, word: str, start: int, text_mode: bool, depth: int) -> Node:
        end = self.offset
        if word in SPACES:
            return Sign(f"\\{word}", SPACES[word], False, start, end)
        if word in SIGNS:
            return Sign(f"\\{word}", SIGNS[word], False, start, end)
        if text_mode:
            raise NotationError(f"{self.shown} has \\{word} in \\text", "write \\mathrm in place of \\text")
        if word in LETTERS:
            return Sign(f"\\{word}", LETTERS[word], True, start, start + len(word) + 1)
        if word in STYLES:
            style = STYLES[word]
            return Styled(style, self.argument(f"\\{word}", style in _TEXT, depth), start, self.offset)
        if word in ACCENTS:
            return Accent(word, self.argument(f"\\{word}", False, depth), start, self.offset)
        if word == "frac":
            above = self.argument("\\frac", False, depth)
            return Fraction(above, self.argument("\\frac", False, depth), start, self.offset)
        near = hint(word, (*LETTERS, *STYLES, *ACCENTS, *SIGNS, "frac"))
        allowed = "Greek letters, accents such as \\dot and \\vec, styles such as \\mathrm"
        raise NotationError(f"{self.shown} has \\{word}, which no symbol has", near or allowed)

    def argument(self, of: str, text_mode: bool, depth: int) -> Node:
        """A group or a single letter, which a script or a command is of."""
        while self.peek()[:1] == " ":
            self.place += 1
        if self.peek() in ("", "}", "_", "^", "'"):
            raise NotationError(f"{self.shown} has {of} with nothing after it", f"write {of}{{...}}")
        found = self.single(text_mode, depth)
        if isinstance(found, Group) and len(found.parts) == 1:
            found = found.parts[0]  # the braces belong to the command
        if not _shows(found):
            raise NotationError(f"{self.shown} has {of}{{}} around nothing", "leave it out")
        return found


def head_of(node: Node) -> Node | None:
    """The part that a dot is put over: the first letter, word or accent; None where there is none."""
    if isinstance(node, Sign):
        return node if node.letter else None
    if isinstance(node, Accent | Fraction):
        return node
    if isinstance(node, Styled):
        return node if _is_word(node.body) else head_of(node.body)
    if isinstance(node, Scripts):
        return head_of(node.base)
    found = [head for head in map(head_of, node.parts) if head is not None]
    if len(found) > 1 and isinstance(found[0], Sign) and found[0].latex in ("\\Delta", "\\delta", "\\partial"):
        return found[1]  # a change of what comes after it
    return found[0] if found else None


def _shows(node: Node) -> bool:
    """Whether there is a letter, a digit or a sign."""
    if isinstance(node, Sign):
        return bool(node.text.strip())
    if isinstance(node, Group):
        return any(map(_shows, node.parts))
    return _shows(node.base if isinstance(node, Scripts) else node.above if isinstance(node, Fraction) else node.body)


def _is_word(node: Node) -> bool:
    """Whether letters, digits and signs stand side by side."""
    if isinstance(node, Group):
        return all(isinstance(part, Sign) for part in node.parts)
    return isinstance(node, Sign)
