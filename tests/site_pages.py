"""The pages of a built documentation site: what they hold, what they refer to, and what they ask a network for."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

#: Tag and attribute -> loaded when the page is opened.
LOADED = {("script", "src"), ("img", "src"), ("source", "src"), ("video", "src"), ("iframe", "src"), ("link", "href")}
REMOTE = re.compile(r"^(?:https?:)?//", re.IGNORECASE)
IN_STYLES = re.compile(r"url\(\s*['\"]?((?:https?:)?//[^)'\"]+)|@import\s+['\"]((?:https?:)?//[^'\"]+)", re.IGNORECASE)


@dataclass
class Page(HTMLParser):
    """One page."""

    path: Path
    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)  #: of ``<a href>``
    loaded: list[str] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)  #: within the article
    text: list[str] = field(default_factory=list)  #: of styles and scripts

    def __post_init__(self) -> None:
        super().__init__()
        self._article = self._verbatim = False
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        self._article |= tag == "article"
        self._verbatim |= tag in ("style", "script")
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        for key, value in given.items():
            if (tag, key) in LOADED and not (tag == "link" and given.get("rel") in ("canonical", "license")):
                self.loaded.append(value)
        if self._article and tag in ("img", "video", "object", "embed"):
            self.pictures.append(given.get("src", tag))

    def handle_endtag(self, tag: str) -> None:
        if tag == "article":
            self._article = False
        if tag in ("style", "script"):
            self._verbatim = False

    def handle_data(self, data: str) -> None:
        if self._verbatim:
            self.text.append(data)


class Site:
    """All pages of a built site."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.pages = {path.relative_to(root).as_posix(): Page(path) for path in sorted(root.rglob("*.html"))}

    def broken_links(self) -> list[str]:
        """Links, pictures, styles and scripts within the site that lead nowhere."""
        found = []
        for name, page in self.pages.items():
            for link in [*page.links, *page.loaded]:
                if re.match(r"^(?:[a-z]+:|//)", link, re.IGNORECASE):
                    continue
                place, _, anchor = link.partition("#")
                target = page.path if not place else (page.path.parent / unquote(place.partition("?")[0])).resolve()
                if not target.is_file():
                    found.append(f"{name}: {link}")
                elif anchor and target.suffix == ".html":
                    there = self.pages[target.relative_to(self.root.resolve()).as_posix()]
                    if unquote(anchor) not in there.anchors:
                        found.append(f"{name}: {link} has no such anchor")
        return found

    def remote_sources(self) -> list[str]:
        """What pages and their styles would load from a network."""
        found = [f"{name}: {x}" for name, page in self.pages.items() for x in page.loaded if REMOTE.match(x)]
        styles = {name: "".join(page.text) for name, page in self.pages.items()}
        styles |= {path.name: path.read_text(encoding="utf-8") for path in self.root.rglob("*.css")}
        return found + [f"{name}: {x[1] or x[2]}" for name, text in styles.items() for x in IN_STYLES.finditer(text)]
