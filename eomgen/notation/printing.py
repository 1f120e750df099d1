"""Notation, printing: the tree of a symbol -> its forms other than LaTeX."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable

from ..texts import html_text
from .latex_tree import Accent, Fraction, Group, Node, Scripts, Sign, Styled
from .signs import ACCENTS, DOTS, OVER, PRIME, RAISED, SUBSCRIPTS, SUPERSCRIPTS

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
            whole = unicodedata.normalize("NFC", body + ACCENTS[node.accent])
            return whole if len(whole) == 1 else body
        case Fraction():
            return f"{_grouped(node.above)}/{_grouped(node.below)}"
        case Scripts():
            found = _text(node.base)
            if node.sub is not None:
                first, *others = _text(node.sub).replace(" ", "").split(",")
                digits = [part.isascii() and part.isdecimal() for part in (first, *others)]
                low = digits[0] and (len(digits) == 1 or not all(digits))  # l_1_2 is not l_1, then 2
                found += "_".join([first.translate(SUBSCRIPTS) if low else f"_{first}", *others])
            if node.sup is not None:
                sup = _text(node.sup)
                plain = sup.isascii() and sup.lstrip("+-").isdecimal()
                found += sup.translate(SUPERSCRIPTS) if plain else sup if sup in RAISED else f"^{sup}"
            return found + "'" * node.primes


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
            found = html_form(node.base, upright)
            if node.sub is not None:
                found += f"<sub>{html_form(node.sub, upright)}</sub>"
            if node.sup is not None or node.primes:
                sup = PRIME * node.primes + ("" if node.sup is None else html_form(node.sup, upright))
                found += f"<sup>{sup}</sup>"
            return found


def _html_accent(node: Accent, upright: bool) -> str:
    """One letter with its accent where there is such a character; else a sign above the middle."""
    letter = unicodedata.normalize("NFC", _text(node.body) + ACCENTS[node.accent])
    if len(letter) == 1:
        return letter if upright or isinstance(node.body, Styled) else f"<i>{letter}</i>"
    over = (
        "position:absolute;left:0;right:0;top:-0.28em;text-align:center;line-height:1;font-style:normal;"
        "pointer-events:none"
    )
    sign = html_text(OVER[node.accent])
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
            over = f"<mo{CLEAR if node.accent in DOTS else ''}>{html_text(OVER[node.accent])}</mo>"
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
            found = _group(node.base)
            if node.sub is not None:
                found += f"_{{{mathtext_form(node.sub)}}}"
            if node.sup is not None:
                found += f"^{{{mathtext_form(node.sup)}}}"
            return found + "'" * node.primes


def _side_by_side(parts: Iterable[str]) -> str:
    """Parts in a row; a command ends before a letter."""
    found = ""
    for part in parts:
        apart = part[:1].isalpha() and _COMMAND.search(found)
        found += f" {part}" if apart else part
    return found


def _group(node: Node) -> str:
    return f"{{{mathtext_form(node)}}}" if isinstance(node, Group | Scripts) else mathtext_form(node)
