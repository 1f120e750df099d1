"""Free text of a user -> comments and literals of the languages that files are generated in.

Names in generated code are ASCII identifiers, checked where a model is built.  Every other text of a user (doc, unit,
labels that hold expressions, file names) goes through one of these functions, one for each language, wherever it is
written.  Metadata of a model holds texts as they are, as JSON.
"""

from __future__ import annotations

import re

from ..base.texts import one_line, shortened, visible

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
