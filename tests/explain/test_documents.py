"""Worked solutions: whole documents of examples and methods, that nothing is empty, and that shown is compiled."""

from __future__ import annotations

import re
import subprocess
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from sweeps import OF_ALL_KINDS, part_of
from tex_formulas import require_tex

import eomgen as eg
from eomgen.equations import METHODS
from eomgen.errors import MissingDependencyError, UsageError
from eomgen.explain import about_mechanism
from eomgen.explain.document import Folded, FormulaLine, Sentence, Table

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
KINDS = ("double_pendulum", "slider_crank", "car_axis")
METHODS_BY_NAME = tuple(METHODS)
VOID = {"meta", "img", "mspace", "br", "hr"}


@cache
def explained(name: str, method: str = "auto", level: str = "full") -> Any:
    return eg.load(EXAMPLES / f"{name}.yaml").derive(method).explain(level)


class Page(HTMLParser):
    """Reads a page: every element is closed, and what it refers to is in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.places: list[str] = []
        self.text: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)
        self.places += [value for key, value in attrs if key in ("src", "href", "data", "action")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Any) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def check(document: Any) -> None:
    assert document.difference <= 1e-10
    titles = [section.title for section in document.sections]
    assert len(set(titles)) == len(titles)
    for section in document.sections:
        assert section.pieces
        assert all(_says_something(piece) for piece in section.pieces), section.title
    page = Page(document.html)
    assert {"script", "link", "iframe", "object"}.isdisjoint(page.tags)
    assert all(place.startswith(("#", "data:image/png;base64,")) for place in page.places)
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]*", "", document.html)
    assert not re.search(r"\\[a-zA-Z]", "".join(page.text)), "LaTeX that was not turned into MathML"
    assert document.markdown.count("$$") % 2 == 0
    require_tex(document.markdown)
    latex = document.latex
    assert latex.count(r"\begin{") == latex.count(r"\end{")
    assert latex.isascii()
    assert len(re.findall(r"(?<!\\)\{", latex)) == len(re.findall(r"(?<!\\)\}", latex))


def _says_something(piece: Any) -> bool:
    match piece:
        case Sentence():
            return piece.text.strip() != ""
        case Table():
            return len(piece.rows) > 0
        case FormulaLine():
            return len(piece.sides) >= 1
        case Folded():
            return len(piece.pieces) > 0 and all(map(_says_something, piece.pieces))
    return len(piece.png) > 0


ALL = [(name, method) for name in KINDS for method in METHODS]
#: Of a loop every method, of the others every other one.
FULL = {*ALL[len(METHODS) : 2 * len(METHODS)], *ALL[: len(METHODS) : 2], *ALL[2 * len(METHODS) + 1 :: 2]}


@pytest.mark.parametrize(("name", "method"), part_of(ALL, FULL.__contains__))
def test_every_method_of_one_example_of_each_kind(name: str, method: str) -> None:
    document = explained(name, method)
    check(document)
    titles = " ".join(section.title for section in document.sections)
    for word in ("Mechanism", "Coordinates", "Position", "Velocity", "Constraints", "Forces", "Energies", "Numbers"):
        assert word in titles
    wanted = {"lagrange": "Lagrange", "hamilton": "Hamilton", "gibbs_appell": "Gibbs", "newton_euler": "Newton"}
    assert wanted.get(method, "Equations of motion") in titles


@pytest.mark.parametrize("method", ["lagrange", "newton_euler"])
def test_rolling(method: str) -> None:
    check(explained("rolling_disc", method))


@pytest.mark.parametrize("name", part_of(NAMES, OF_ALL_KINDS.__contains__))
def test_every_example_in_short(name: str) -> None:
    check(explained(name, "auto", "short"))
    require_tex(eg.load(EXAMPLES / f"{name}.yaml").derive()._repr_latex_() or "")


#: Each example by two methods more, so that each method comes to ten of them.
PAIRS = [(name, METHODS_BY_NAME[(k + step) % len(METHODS_BY_NAME)]) for k, name in enumerate(NAMES) for step in (0, 3)]


SOME = set(PAIRS[::7])  #: each method with some examples


@pytest.mark.parametrize(("name", "method"), part_of(PAIRS, SOME.__contains__))
def test_every_example_by_other_methods(name: str, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In short, and without the pictures, which are drawn above."""
    monkeypatch.setattr(about_mechanism, "_picture", lambda module: Sentence("No picture."))
    check(explained.__wrapped__(name, method, "short"))


def test_a_bare_lagrangian() -> None:
    import sympy

    q, k = sympy.Symbol("q"), sympy.Symbol("k")
    L = sympy.Symbol("q_dot") ** 2 / 2 - k * q**2 / 2
    model = eg.Model.from_lagrangian("oscillator", L, [q], parameters={"k": 4.0})
    document = model.derive().explain()
    check(document)


def test_parameters_without_values_leave_out_numbers_alone() -> None:
    m = eg.Model("pendulum", gravity=(0, "-g", 0))
    for name in ("g", "l", "m"):
        m.parameter(name)
    m.revolute("hinge", m.ground, m.body("bob", mass="m", com=(0, "-l", 0)), coordinate="theta")
    document = m.derive().explain()
    assert document.difference is None
    assert r"\theta" in document.latex
    assert "has no value" in document.html


def test_saved_files(tmp_path: Path) -> None:
    document = explained("pendulum")
    for ending, start in ((".html", "<!DOCTYPE html>"), (".md", "# Equations"), (".tex", "\\documentclass")):
        assert document.save(tmp_path / f"x{ending}").read_text(encoding="utf-8").startswith(start)
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(UsageError, match=r"must end in one of \.html"):
        document.save(tmp_path / "x.docx")
    with pytest.raises(UsageError, match="no level 'long'; there are full, short"):
        eg.load(EXAMPLES / "pendulum.yaml").derive().explain("long")


@pytest.mark.needs("pdflatex")
def test_tex_compiles(tmp_path: Path) -> None:
    document = explained("slider_crank")
    assert document.save(tmp_path / "x.pdf").read_bytes().startswith(b"%PDF")
    document.save(tmp_path / "x.tex")
    words = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "x.tex"]
    assert subprocess.run(words, cwd=tmp_path, capture_output=True, check=False).returncode == 0


def test_without_pdflatex_the_refusal_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = explained("slider_crank")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(MissingDependencyError, match="needs pdflatex: install TeX Live"):
        document.save(tmp_path / "x.pdf")


def test_a_wrong_formula_is_seen_in_the_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The difference is measured: a kinetic energy that is off by a part in a million is told."""
    equations = eg.load(EXAMPLES / "double_pendulum.yaml").derive()
    vars(equations)["T"] = equations.T * (1 + 1e-6)
    assert 1e-7 < equations.explain().difference < 1e-5
