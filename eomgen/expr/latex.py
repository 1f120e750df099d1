"""The LaTeX of one symbol -> its tree -> the forms other than LaTeX, or NotationError.

The words of LaTeX that may stand in a symbol are listed, so nothing else can come into a document, a
picture or a page: no command that reads or writes files, no end of the formula, no HTML.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from functools import cache
from typing import NamedTuple

from ..base.texts import hint, html_text, visible

# -- letters and signs of LaTeX and their characters, accents, styles --------------------------------------------------


# ruff: noqa: RUF001 - characters that look like others are what this file is about


#: In Unicode's order; a dash stands for omicron, and for the sigma at the end of words.
_SMALL = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi - pi rho - sigma tau upsilon phi chi psi "
    "omega"
)
_LARGE = {"Gamma": "Γ", "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ"}
_VARIANTS = {"varepsilon": "ϵ", "vartheta": "ϑ", "varpi": "ϖ", "varrho": "ϱ", "varsigma": "ς", "varphi": "ϕ"}

#: Greek letters by their names, which are LaTeX's commands too.
GREEK = {word: chr(ord("α") + k) for k, word in enumerate(_SMALL.split()) if word != "-"}
GREEK |= {**_LARGE, "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω", **_VARIANTS}

#: Other letters, which may bear dots.
LETTERS = {**GREEK, "ell": "ℓ", "hbar": "ħ", "imath": "ı", "jmath": "ȷ", "nabla": "∇", "partial": "∂"}

#: Signs without a command's argument.
SIGNS = {
    "prime": "′", "star": "⋆", "ast": "∗", "dagger": "†", "circ": "∘", "bullet": "•", "infty": "∞", "parallel": "∥",
    "perp": "⊥", "cdot": "·", "times": "×", "pm": "±", "mp": "∓", "to": "→", "rightarrow": "→", "leftarrow": "←",
    "uparrow": "↑", "downarrow": "↓", "ldots": "…", "dots": "…", "_": "_", "%": "%",
}  # fmt: skip

PRIME = SIGNS["prime"]
RAISED = tuple(SIGNS[word] for word in ("prime", "star", "ast", "dagger", "circ"))  #: which stand high by themselves
#: Spaces; those of no width at last.
SPACES = {" ": " ", ",": " ", ":": " ", ";": " ", "quad": " ", "!": ""}

#: Accents: the combining character of each, of ``vec`` none that terminals show, and the sign over a letter in MathML.
ACCENTS = {
    "dot": ("\u0307", "˙"), "ddot": ("\u0308", "¨"), "dddot": ("\u20db", "˙˙˙"), "hat": ("\u0302", "^"),
    "widehat": ("\u0302", "^"), "bar": ("\u0304", "¯"), "overline": ("\u0305", "¯"), "tilde": ("\u0303", "~"),
    "widetilde": ("\u0303", "~"), "vec": ("\u20d7", "→"), "breve": ("\u0306", "˘"), "check": ("\u030c", "ˇ"),
    "acute": ("\u0301", "´"), "grave": ("\u0300", "`"), "mathring": ("\u030a", "˚"), "underline": ("\u0332", "_"),
}  # fmt: skip
#: Derivatives by the time, by their order.
DOTS = ("", "dot", "ddot", "dddot")

#: Commands that set the letters of their argument in a style.
STYLES = {
    "mathrm": "rm", "mathbf": "bf", "mathit": "it", "mathsf": "sf", "mathtt": "tt", "mathcal": "cal", "mathbb": "bb",
    "mathfrak": "frak", "mathscr": "scr", "boldsymbol": "bf", "operatorname": "rm", "text": "text", "textrm": "text",
    "textbf": "textbf", "textit": "textit", "mathnormal": "it",
}  # fmt: skip
#: Commands that set what comes after them in the group in a style.
SWITCHES = ("rm", "bf", "it", "sf", "tt", "cal")

#: Characters that stand for themselves.
PLAIN = frozenset("+-=*/().,:;|![]?")
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
SUPERSCRIPTS = str.maketrans("0123456789+-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻")


# -- from LaTeX to a tree ----------------------------------------------------------------------------------------------


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
    r"""The tree of a symbol's LaTeX, such as ``q_{\rm f}``; NotationError of anything else."""
    if not text.strip():
        raise NotationError("the LaTeX of a symbol is empty", "leave it out, or write for example \\theta_1")
    if len(text) > LONGEST:
        raise NotationError(f"the LaTeX of a symbol has {len(text)} characters", f"at most {LONGEST}")
    return _Reader(spaced(text)).whole()


def spaced(text: str) -> str:
    """The text with single spaces, as an empty line would end a formula."""
    return _SPACES.sub(" ", text).strip(" ")


class _Reader:
    """Reads tokens from left to right."""

    def __init__(self, text: str) -> None:
        self.text, self.tokens = text, [(m[0], m.start()) for m in _TOKEN.finditer(text)]
        self.place, self.quoted = 0, f"'{visible(text, lines=False)}'"

    def whole(self) -> Node:
        if self.text.endswith("\\") and not self.text.endswith("\\\\"):
            raise NotationError(f"{self.quoted} ends in a backslash", "take it away")
        result = self.row("", False, 0)
        if self.place < len(self.tokens):
            raise NotationError(f"{self.quoted} has a '}}' without its '{{'", "write as many { as }")
        if _shows(result):
            return result
        raise NotationError(f"{self.quoted} shows nothing", "write a letter, for example \\theta_1")

    def peek(self) -> str:
        return self.tokens[self.place][0] if self.place < len(self.tokens) else ""

    @property
    def offset(self) -> int:
        return self.tokens[self.place][1] if self.place < len(self.tokens) else len(self.text)

    def row(self, closing: str, text_mode: bool, depth: int) -> Node:
        """Parts up to a closing brace, which is left."""
        if depth > DEEPEST:
            raise NotationError(f"{self.quoted} has groups within groups", f"at most {DEEPEST} of them")
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
            raise NotationError(f"{self.quoted} has a '{{' without its '}}'", "write as many { as }")
        return parts[0] if len(parts) == 1 else Group(tuple(parts), start, self.offset)

    def part(self, text_mode: bool, depth: int) -> Node:
        """A symbol with its scripts."""
        start = self.offset
        if self.peek() in ("_", "^", "'") and not text_mode:
            raise NotationError(f"{self.quoted} has {self.peek()!r} with nothing before it", "write a letter before it")
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
                raise NotationError(f"{self.quoted} has {token!r} twice", "put them together, as in l_{1,2}")
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
            raise NotationError(f"{self.quoted} has the letter {token}", f"write \\{greek}")
        if text_mode and token in "_^'":
            raise NotationError(f"{self.quoted} has {token!r} in \\text", "write \\mathrm in place of \\text")
        what = f"{token!r}" if token.isprintable() else f"the character U+{ord(token):04X}"
        raise NotationError(f"{self.quoted} has {what}, which no symbol has", "letters, digits, _ ^ { } and commands")

    def command(self, word: str, start: int, text_mode: bool, depth: int) -> Node:
        end = self.offset
        if word in SPACES:
            return Sign(f"\\{word}", SPACES[word], False, start, end)
        if word in SIGNS:
            return Sign(f"\\{word}", SIGNS[word], False, start, end)
        if text_mode:
            raise NotationError(f"{self.quoted} has \\{word} in \\text", "write \\mathrm in place of \\text")
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
        raise NotationError(f"{self.quoted} has \\{word}, which no symbol has", near or allowed)

    def argument(self, of: str, text_mode: bool, depth: int) -> Node:
        """A group or a single letter, which a script or a command is of."""
        while self.peek()[:1] == " ":
            self.place += 1
        if self.peek() in ("", "}", "_", "^", "'"):
            raise NotationError(f"{self.quoted} has {of} with nothing after it", f"write {of}{{...}}")
        result = self.single(text_mode, depth)
        if isinstance(result, Group) and len(result.parts) == 1:
            result = result.parts[0]  # the braces belong to the command
        if not _shows(result):
            raise NotationError(f"{self.quoted} has {of}{{}} around nothing", "leave it out")
        return result


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
    result = [head for head in map(head_of, node.parts) if head is not None]
    if len(result) > 1 and isinstance(result[0], Sign) and result[0].latex in ("\\Delta", "\\delta", "\\partial"):
        return result[1]  # a change of what comes after it
    return result[0] if result else None


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


# -- from a tree to other forms ----------------------------------------------------------------------------------------


_COMMAND = re.compile(r"\\[A-Za-z]+\Z")
_HTML_STYLES = {"bf": "b", "textbf": "b", "it": "i", "textit": "i", "tt": "code"}
_MATHML_STYLES = {
    "rm": "normal", "text": "normal", "bf": "bold", "textbf": "bold", "it": "italic", "textit": "italic",
    "sf": "sans-serif", "tt": "monospace", "cal": "script", "scr": "script", "bb": "double-struck", "frak": "fraktur",
}  # fmt: skip
_MATHTEXT_STYLES = {"text": "rm", "textbf": "bf", "textit": "it"}
_MATHTEXT_SPACES = {"\\!": "", "\\quad": r"\quad "}

#: Dots over letters, clear of them and heavy enough to be seen from the last row.
CLEAR = " style='padding-bottom:.1em;font-weight:bold'"


def text_form(node: Node) -> str:
    """Unicode for terminals: ``θ₁``, ``m_c``; derivatives by primes, ``θ₁'``.

    Common fonts of terminals set a combining dot over the character after a Greek letter, so there are no dots.
    """
    bare, primes = _without_primes(node)
    return _text(bare) + "'" * primes


def _without_primes(node: Node) -> tuple[Node, int]:
    """The tree without the dots over its head, and how many they were; as primes they stand after all else."""
    if isinstance(node, Scripts):
        base, primes = _without_primes(node.base)
        return node._replace(base=base), primes
    if isinstance(node, Group) and len(node.parts) == 1:
        return _without_primes(node.parts[0])
    if isinstance(node, Accent) and node.accent in DOTS:
        return node.body, DOTS.index(node.accent)
    return node, 0


def _text(node: Node) -> str:
    match node:
        case Sign():
            return node.text
        case Group():
            return "".join(map(_text, node.parts))
        case Styled():
            return _text(node.body)
        case Accent():
            body = _text(node.body)
            if node.accent in DOTS:
                return body + "'" * DOTS.index(node.accent)
            whole = unicodedata.normalize("NFC", body + ACCENTS[node.accent][0])
            return whole if len(whole) == 1 else body
        case Fraction():
            return f"{_grouped(node.above)}/{_grouped(node.below)}"
        case Scripts():
            result = _text(node.base)
            if node.sub is not None:
                first, *others = _text(node.sub).replace(" ", "").split(",")
                digits = [part.isascii() and part.isdecimal() for part in (first, *others)]
                low = digits[0] and (len(digits) == 1 or not all(digits))  # l_1_2 is not l_1, then 2
                result += "_".join([first.translate(SUBSCRIPTS) if low else f"_{first}", *others])
            if node.sup is not None:
                sup = _text(node.sup)
                plain = sup.isascii() and sup.lstrip("+-").isdecimal()
                result += sup.translate(SUPERSCRIPTS) if plain else sup if sup in RAISED else f"^{sup}"
            return result + "'" * node.primes


def _grouped(node: Node) -> str:
    body = _text(node)
    return body if len(body) == 1 or body.isalnum() else f"({body})"


def html_form(node: Node, upright: bool = False) -> str:
    """Elements of HTML: ``<i>m</i><sub><i>c</i></sub>``."""
    match node:
        case Sign():
            text = html_text(node.text)
            return f"<i>{text}</i>" if node.letter and not upright else text
        case Group():
            return "".join(html_form(part, upright) for part in node.parts)
        case Styled():
            body = html_form(node.body, True)
            tag = _HTML_STYLES.get(node.style)
            return f"<{tag}>{body}</{tag}>" if tag else body
        case Accent():
            return _html_accent(node, upright)
        case Fraction():
            return f"{html_form(node.above, upright)}/{html_form(node.below, upright)}"
        case Scripts():
            result = html_form(node.base, upright)
            if node.sub is not None:
                result += f"<sub>{html_form(node.sub, upright)}</sub>"
            if node.sup is not None or node.primes:
                sup = PRIME * node.primes + ("" if node.sup is None else html_form(node.sup, upright))
                result += f"<sup>{sup}</sup>"
            return result


def _html_accent(node: Accent, upright: bool) -> str:
    """One letter with its accent where there is such a character; else a sign above the middle."""
    letter = unicodedata.normalize("NFC", _text(node.body) + ACCENTS[node.accent][0])
    if len(letter) == 1:
        return letter if upright or isinstance(node.body, Styled) else f"<i>{letter}</i>"
    over = (
        "position:absolute;left:0;right:0;top:-0.28em;text-align:center;line-height:1;font-style:normal;"
        "pointer-events:none"
    )
    sign = html_text(ACCENTS[node.accent][1])
    inner = html_form(node.body, upright)
    return f"<span style='position:relative;display:inline-block'>{inner}<span style='{over}'>{sign}</span></span>"


def mathml_form(node: Node, style: str = "") -> str:
    """Elements of MathML, without ``<math>``: ``<msub><mi>m</mi><mi>c</mi></msub>``."""
    match node:
        case Sign():
            return _token(node, style)
        case Group():
            return f"<mrow>{_tokens(node, style)}</mrow>"
        case Styled():
            return (
                f"<mrow>{_tokens(node.body, node.style)}</mrow>"
                if isinstance(node.body, Group)
                else mathml_form(node.body, node.style)
            )
        case Accent():
            over = f"<mo{CLEAR if node.accent in DOTS else ''}>{html_text(ACCENTS[node.accent][1])}</mo>"
            tag = "munder" if node.accent == "underline" else "mover accent='true'"
            tag = "mover" if node.accent in DOTS else tag  # as accents, browsers set dots on high letters
            return f"<{tag}>{mathml_form(node.body, style)}{over}</{tag.partition(' ')[0]}>"
        case Fraction():
            return f"<mfrac>{mathml_form(node.above, style)}{mathml_form(node.below, style)}</mfrac>"
        case Scripts():
            base = mathml_form(node.base, style)
            sub = None if node.sub is None else mathml_form(node.sub, style)
            raised = [f"<mo>{PRIME}</mo>"] * node.primes + ([] if node.sup is None else [mathml_form(node.sup, style)])
            sup = "".join(raised) if len(raised) < 2 else f"<mrow>{''.join(raised)}</mrow>"
            if sub and sup:
                return f"<msubsup>{base}{sub}{sup}</msubsup>"
            return f"<msub>{base}{sub}</msub>" if sub else f"<msup>{base}{sup}</msup>"


def _tokens(node: Group, style: str) -> str:
    """Parts of a row; letters of a word in one token."""
    if style and all(isinstance(part, Sign) for part in node.parts):
        return _token(Sign("", "".join(map(_text, node.parts)), True), style)
    return "".join(mathml_form(part, style) for part in node.parts)


def _token(sign: Sign, style: str) -> str:
    text = html_text(sign.text)
    if sign.text.isdecimal():
        return f"<mn>{text}</mn>"
    if not sign.letter:
        return f"<mtext>{text.replace(' ', '&#160;')}</mtext>" if sign.text.isspace() else f"<mo>{text}</mo>"
    variant = _MATHML_STYLES.get(style, "")
    default = "italic" if len(sign.text) == 1 else "normal"
    return f"<mi mathvariant='{variant}'>{text}</mi>" if variant and variant != default else f"<mi>{text}</mi>"


def mathtext_form(node: Node) -> str:
    """Matplotlib's part of LaTeX, without the dollars."""
    match node:
        case Sign():
            if node.latex in _MATHTEXT_SPACES:
                return _MATHTEXT_SPACES[node.latex]
            if node.text == " ":
                return r"\ "
            return node.latex
        case Group():
            return _side_by_side(map(_group, node.parts)) if len(node.parts) != 1 else mathtext_form(node.parts[0])
        case Styled():
            return rf"\math{_MATHTEXT_STYLES.get(node.style, node.style)}{{{mathtext_form(node.body)}}}"
        case Accent():
            accent = "bar" if node.accent == "underline" else node.accent
            return rf"\{accent}{{{mathtext_form(node.body)}}}"
        case Fraction():
            return rf"\frac{{{mathtext_form(node.above)}}}{{{mathtext_form(node.below)}}}"
        case Scripts():
            result = _group(node.base)
            if node.sub is not None:
                result += f"_{{{mathtext_form(node.sub)}}}"
            if node.sup is not None:
                result += f"^{{{mathtext_form(node.sup)}}}"
            return result + "'" * node.primes


def _side_by_side(parts: Iterable[str]) -> str:
    """Parts in a row; a command ends before a letter."""
    result = ""
    for part in parts:
        apart = part[:1].isalpha() and _COMMAND.search(result)
        result += f" {part}" if apart else part
    return result


def _group(node: Node) -> str:
    return f"{{{mathtext_form(node)}}}" if isinstance(node, Group | Scripts) else mathtext_form(node)
