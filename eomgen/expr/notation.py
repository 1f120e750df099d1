"""Names of a model, and the LaTeX that it gives for some -> printed forms.

The first part of a name is the symbol and the others its subscript: ``l_12``, ``x_hub_left``.  Names of Greek letters
become the letters, digits at the end a subscript (``theta1``), words stay upright.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from functools import cache
from typing import Any

from ..base.texts import visible
from .latex import (
    DOTS,
    GREEK,
    Accent,
    Node,
    head_of,
    html_form,
    mathml_form,
    mathtext_form,
    read_latex,
    spaced,
    text_form,
)

# -- from a name to LaTeX ----------------------------------------------------------------------------------------------


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
    result = _RATE.match(name)
    return (result[1], len(result[2])) if result else (name, 0)


def literal(name: str, style: str = "mathrm") -> str:
    """The name itself, upright, in LaTeX; what LaTeX does not hold is shown by its number."""
    text = _SPECIAL.sub(lambda c: f"(U+{ord(c[0]):04X})", visible(name, lines=False)) or "?"
    return rf"\{style}{{{_ESCAPED.sub(lambda c: chr(92) + c[0], text)}}}".replace(" ", r"\ ")


def latex_of(name: str) -> str:
    r"""The LaTeX of a name that is no rate: ``theta1`` -> ``\theta_1``.

    Names of instances come before their dot and stand at the end: ``leg.theta1`` -> ``\theta_{1,\mathrm{leg}}``.
    """
    if result := _OF_MARKER.match(name):
        head = _MOTIONS[result[1]] if result[1] else result[2]
        return _with(head, [*([result[2]] if result[1] else []), literal(result[3])])
    if result := _ENTRY.match(name):
        head, subs = _head_and_subs(result[1])
        return _with(head, [*subs, result[2]])
    if result := _CALL.match(name):
        return f"{_with(*_head_and_subs(result[1]))}({literal(result[2]) if result[2] else ''})"
    path, _, last = name.rpartition(".")
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_.]*", name, re.ASCII) or not last.strip("_"):
        return literal(name)
    head, subs = _head_and_subs(last)
    return _with(head, [*subs, *([literal(path)] if path else [])])


def _head_and_subs(name: str) -> tuple[str, list[str]]:
    first, *parts = [part for part in name.split("_") if part]
    if not parts:
        return _first(first)
    if re.fullmatch("[vaw][xyz]", parts[-1]) and len(first) > 1:
        last = parts[-1]  # rod_wx: the angular velocity of the rod about x
        return _MOTIONS[last[0]], [*map(_sub, (first, *parts[:-1])), last[1]]
    head, subs = _first(first)
    if head.startswith(r"\mathrm"):
        head, subs = literal(first), []  # leg1_x
    if len(parts) > 1 and parts[0] in _DOTTED:  # theta_dot_max
        head, parts = rf"\{parts[0]}{{{head}}}", parts[1:]
    return head, [*subs, *map(_sub, parts)]


def _first(word: str) -> tuple[str, list[str]]:
    """The symbol of the first part of a name, and subscripts that it brings."""
    if (letter := _letter(word)) is not None:
        return letter, []
    if result := _PART.match(word):
        head, subs = _first(result[1])
        last = result[2] + result[3]
        return head, [*subs, last]
    if result := _AXES.match(word):
        return (r"\omega" if result[1] == "w" else result[1]), [result[2]]
    if len(word) == 2 and not word.isupper() and word not in _WORDS and word[0] != "d":
        return word[0], [word[1]]  # mc, kp, Fn, rA
    for size in (1, 2):  # thetaA, omegaAB
        if (letter := _letter(word[:-size])) is not None and len(word) > size + 1 and word[-size:].isupper():
            return letter, [word[-size:]]
    return literal(word), []


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
    if (result := _PART.match(part)) and not result[3] and (letter := _letter(result[1])) is not None:
        return f"{letter}{result[2]}"
    return literal(part)


def _with(head: str, subs: list[str]) -> str:
    """A symbol with its subscripts, words next to each other in one."""
    if not subs:
        return head
    joined = ",".join(subs).replace(r"},\mathrm{", ",")
    return f"{head}_{joined}" if len(joined) == 1 else f"{head}_{{{joined}}}"


# -- all forms of all names of a model ---------------------------------------------------------------------------------


_WORD = re.compile(r"\\mathrm\{([A-Za-z0-9.]{2,})\}\Z")
_FORMS: dict[str, Callable[[Node], str]] = {
    "text": text_form,
    "html": html_form,
    "mathml": mathml_form,
    "mathtext": mathtext_form,
}


class Notation:
    r"""The printed forms of the names of a model.

    Parameters
    ----------
    names : iterable of str, optional
        All names of the model.  Two that would be printed alike are kept apart: the first keeps its form, the others
        are printed as they are, upright.
    latex : mapping of str to str, optional
        LaTeX that a model gives for some of them; rates follow, with a dot over the first letter.
    instances : mapping of str to str, optional
        Instances of components and the prefixes of their names, which become subscripts: ``leg1_theta`` is printed as
        ``\theta_{\mathrm{leg1}}``.

    Examples
    --------
    >>> notation = Notation(["theta1", "m_c", "q"], latex={"q": r"q_{\rm f}"})
    >>> notation.latex("theta1_dot"), notation.latex("m_c"), notation.latex("q_ddot")
    ('\\dot{\\theta}_1', 'm_c', '\\ddot{q}_{\\rm f}')
    >>> notation.latex("theta1", of_time=True), notation.text("theta1"), notation.html("m_c")
    ('\\theta_1(t)', 'θ₁', '<i>m</i><sub><i>c</i></sub>')
    """

    def __init__(
        self,
        names: Iterable[str] = (),
        latex: Mapping[str, str] | None = None,
        instances: Mapping[str, str] | None = None,
    ) -> None:
        self.declared = {name: spaced(text) for name, text in (latex or {}).items()}
        self.instances = instances or {}
        self.names = tuple(dict.fromkeys(names))
        self._sources: dict[str, str] = {}
        self._texts: dict[str, str] = {}  #: of those whose text would be another's name
        self._used: set[tuple[str, str]] = set()  #: forms that names have
        self._keep_apart(self.names)

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> Notation:
        """The notation of a module or a trajectory, from its metadata."""
        keys = ("q_names", "v_names", "s_names", "loop_names", "u_names", "p_names", "parameters", "y_names")
        names = [name for key in keys for name in metadata.get(key, ())]
        return cls(names, metadata.get("latex"), metadata.get("instances"))

    def with_names(self, names: Iterable[str]) -> Notation:
        """The same with further names, such as those of intermediates; names that there are keep their forms."""
        more = [name for name in dict.fromkeys(names) if name not in self._sources]
        if not more:
            return self
        renamed = copy(self)
        renamed.names, renamed._used = (*self.names, *more), set(self._used)
        renamed._sources, renamed._texts = dict(self._sources), dict(self._texts)
        renamed._keep_apart(more)
        return renamed

    def with_latex(self, latex: Mapping[str, str]) -> Notation:
        """The same with other LaTeX for some of its names, which no other name has."""
        if not latex:
            return self
        renamed = copy(self)
        renamed.declared = {**self.declared, **latex}
        renamed._sources = {**self._sources, **latex}
        renamed._used = self._used | {
            (form, _printed(form, x)) for x in latex.values() for form in ("latex", "text", "html")
        }
        return renamed

    def is_free(self, latex: str, with_numbers: bool = False) -> bool:
        r"""Whether no name is printed as a letter, ``M``; nor, on request, as the letter with numbers, ``M_{12}``."""
        text = re.escape(_printed("text", latex))
        numbered = re.compile(rf"{text}_?[\d₀-₉,_]*\Z" if with_numbers else rf"{text}\Z")
        alike = re.compile(rf"{re.escape(latex)}(_\{{?[\d,]+\}}?)?\Z" if with_numbers else rf"{re.escape(latex)}\Z")
        return not any(alike.match(self.latex(name)) or numbered.match(self.text(name)) for name in self.names)

    def letter(self, *choice: str, with_numbers: bool = False) -> str:
        r"""A letter of a display that no name is printed as: the first of the choice (LaTeX), or the last with a star.

        With numbers it gets these as subscripts, ``M_{12}``, which no name may have either.
        """
        starred = f"{{{choice[-1]}}}^{{\\ast}}"
        return next((letter for letter in choice if self.is_free(letter, with_numbers)), starred)

    def latex(self, name: str, of_time: bool = False) -> str:
        r"""LaTeX, without dollars: ``\theta_1``; as a function of time ``\theta_1(t)``."""
        return self._form("latex", name) + ("(t)" if of_time else "")

    def text(self, name: str, of_time: bool = False) -> str:
        """Unicode for terminals: ``θ₁``, ``θ₁'`` of its rate, ``m_c``."""
        return self._form("text", name) + ("(t)" if of_time else "")

    def html(self, name: str) -> str:
        """Elements of HTML, escaped: ``<i>θ</i><sub>1</sub>``."""
        return self._form("html", name)

    def mathml(self, name: str) -> str:
        """Elements of MathML, without ``<math>``: ``<msub><mi>θ</mi><mn>1</mn></msub>``."""
        return self._form("mathml", name)

    def mathtext(self, name: str) -> str:
        r"""A label of Matplotlib, dollars included: ``$\theta_1$``; words without more are plain text."""
        source = self._source(name)
        return word[1] if (word := _WORD.match(source)) else f"${_printed('mathtext', source)}$"

    def symbol_names(self, symbols: Iterable[Any]) -> dict[Any, str]:
        """SymPy symbols -> LaTeX, for ``sympy.latex(expression, symbol_names=...)``."""
        return {symbol: self.latex(str(symbol)) for symbol in symbols}

    def _form(self, form: str, name: str) -> str:
        if form == "text" and name in self._texts:
            return self._texts[name]
        return _printed(form, self._source(name))

    def _source(self, name: str) -> str:
        """The LaTeX that all forms of a name are made of."""
        return self._sources.get(name) or self._wanted(name)

    def _wanted(self, name: str) -> str:
        """The LaTeX of a name by itself; of a rate, from what it is the rate of."""
        if name in self.declared:
            return self.declared[name]
        stem, order = split_rate(name)
        if not order:
            return latex_of(self._with_dots(name))
        if order == 2 and (rate := rate_of(stem)) in self.declared:  # of a rate that is printed as a letter of its own
            return dotted(self.declared[rate], 1)
        return dotted(self._source(stem), order) if order < len(DOTS) else literal(name)

    def _with_dots(self, name: str) -> str:
        """The name of something in an instance with a dot after the instance: ``leg1.theta``."""
        for instance, prefix in self.instances.items():
            if prefix and name.startswith(prefix) and name != prefix:
                return f"{instance}.{name.removeprefix(prefix)}"
        return name

    def _keep_apart(self, names: Iterable[str]) -> None:
        """Find what these names are printed from, so that no two look alike: given LaTeX first, rates last."""
        known = set(self.names)
        for name in sorted(names, key=self._rank):
            wanted = self._wanted(name)
            for source in (wanted, literal(name), literal(name, "mathtt")):
                forms = {(form, _printed(form, source)) for form in ("latex", "text", "html")}
                text = _printed("text", source)
                if name in self.declared and text != name and text in known:
                    self._texts[name] = name
                    forms.discard(("text", text))
                if self._used.isdisjoint(forms):
                    break
            self._used |= forms
            self._sources[name] = source

    def _rank(self, name: str) -> int:
        if name in self.declared:
            return 0
        if split_rate(name)[1]:
            return 3
        return 1 if _printed("text", self._wanted(name)) == name else 2


def dotted(latex: str, order: int) -> str:
    r"""LaTeX of one symbol with 1, 2 or 3 dots over its first letter or word: ``\ddot{\theta}_1`` of ``\theta_1``."""
    tree = read_latex(latex)
    head = head_of(tree) or tree
    body = head
    if isinstance(head, Accent) and head.accent in DOTS and order + DOTS.index(head.accent) < len(DOTS):
        body, order = head.body, order + DOTS.index(head.accent)
    return f"{latex[: head.start]}\\{DOTS[order]}{{{latex[body.start : body.end]}}}{latex[head.end :]}"


def raised(latex: str, exponent: str) -> str:
    r"""LaTeX with an exponent; in braces where it has one or a prime, as TeX takes two of them for an error."""
    return f"{{{latex}}}^{exponent}" if re.search("['^]", latex) else f"{latex}^{exponent}"


@cache
def _printed(form: str, latex: str) -> str:
    return latex if form == "latex" else _FORMS[form](read_latex(latex))
