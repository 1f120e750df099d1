"""Links from the first use of a term on a page to the glossary, so that pages read well in the repository too."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.util.nodes import make_refnode

GLOSSARY = "glossary"
#: Words that everybody knows; a link from each page would disturb.
PLAIN = {"body", "event", "frame", "input", "joint", "mode", "model file", "module", "output", "parameter", "state"}
#: Text of these is looked at.
OPEN = (nodes.paragraph, nodes.emphasis)
FOLDERS = ("reference/", "project/", "tutorials/")


def link_terms(app: Any, doctree: nodes.document, page: str) -> None:
    """Link the first use of each term on a page."""
    if page == GLOSSARY or page.startswith(FOLDERS):
        return
    entries = app.env.get_domain("std").objects
    terms = {name.lower(): (name, *place) for (kind, name), place in entries.items() if kind == "term"}
    left = {word for word in terms if word not in PLAIN}
    for text in list(doctree.findall(nodes.Text)):
        if not isinstance(text.parent, OPEN) or any(isinstance(x, nodes.title | nodes.reference) for x in _above(text)):
            continue
        parts: list[nodes.Node] = []
        rest = text.astext()
        while left and (found := _pattern(left).search(rest)):
            word = _singular(found[0].lower(), left)
            left.discard(word)
            name, home, anchor = terms[word]
            parts.append(nodes.Text(rest[: found.start()]))
            link = make_refnode(app.builder, page, home, anchor, nodes.inline("", found[0]), name)
            link["classes"].append("term")
            parts.append(link)
            rest = rest[found.end() :]
        if parts:
            text.parent.replace(text, [*parts, nodes.Text(rest)])


def _above(node: nodes.Node) -> list[nodes.Node]:
    found = []
    while node.parent is not None:
        node = node.parent
        found.append(node)
    return found


def _singular(word: str, terms: set[str]) -> str:
    return word if word in terms else word.removesuffix("s")


def _pattern(terms: set[str]) -> re.Pattern[str]:
    longest = sorted(terms, key=len, reverse=True)
    return re.compile(rf"(?<![\w.-])(?:{'|'.join(map(re.escape, longest))})s?(?![\w-])", re.IGNORECASE)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("doctree-resolved", link_terms)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
