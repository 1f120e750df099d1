"""Displays and worked solutions in a browser: formulas are set, fit a page of 960 pixels, and nothing complains."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from browser import Browser
from ruamel.yaml import YAML

import eomgen as eg

TESTS = Path(__file__).parents[1]
EXAMPLES = TESTS.parent / "examples"
SLIDES = (
    *("double_pendulum", "cart_pendulum", "slider_crank", "four_bar", "two_link_manipulator", "spherical_pendulum"),
    *("heavy_top", "rolling_disc", "flyball_governor", "bicycle"),
)
PAGE = "<!doctype html><meta charset='utf-8'><body style='width:900px;font:14px sans-serif'>"
#: Width and right end of each formula that is not folded up.
SIZES = (
    "[...document.querySelectorAll('math')].filter(m => !m.closest('details:not([open])'))"
    ".map(m => m.getBoundingClientRect()).map(b => [b.width, b.right])"
)
RIGHT = "document.body.getBoundingClientRect().right"


def model(name: str, folder: Path) -> Any:
    file = EXAMPLES / f"{name}.yaml"
    if not file.is_file():
        forms = YAML(typ="safe").load((TESTS / "reference" / "textbook_equations.yaml").read_text(encoding="utf-8"))
        file = folder / f"{name}.yaml"
        with file.open("w", encoding="utf-8") as out:
            YAML().dump({"name": name, **forms[name]["model"]}, out)
    return eg.load(file)


@pytest.mark.needs("chromium")
def test_displays_fit_a_page(tmp_path: Path) -> None:
    with Browser(tmp_path / "profile", size=(960, 800)) as browser:
        for name in SLIDES:
            page = tmp_path / f"{name}.html"
            page.write_text(PAGE + model(name, tmp_path).derive()._repr_html_(), encoding="utf-8")
            browser.open(page.as_uri())
            browser.wait_for(f"document.readyState === 'complete' && document.body.textContent.includes('{name}')")
            sizes = browser.evaluate(SIZES)
            assert len(sizes) > 2
            assert max(right for _, right in sizes) <= browser.evaluate(RIGHT), name
    assert browser.complaints == []
    assert browser.requests == []


@pytest.mark.needs("chromium")
@pytest.mark.parametrize(("name", "method"), [("slider_crank", "newton_euler"), ("double_pendulum", "hamilton")])
def test_worked_solutions_open_offline(name: str, method: str, tmp_path: Path) -> None:
    page = tmp_path / "solution.html"
    model(name, tmp_path).derive(method).explain().save(page)
    with Browser(tmp_path / "profile") as browser:
        browser.open(page.as_uri())
        browser.wait_for("document.readyState === 'complete' && document.querySelector('h2') !== null")
        assert browser.evaluate("document.querySelector('img').naturalWidth") > 100
        assert all(width > 0 for width, _ in browser.evaluate(SIZES))
        assert browser.complaints == []
        assert browser.requests == []
