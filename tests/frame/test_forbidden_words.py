"""Expressions of a model are parsed by eomgen itself: nothing that executes or parses code by other means is called."""

from __future__ import annotations

import ast
import io
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FORBIDDEN = {"eval", "exec", "sympify", "parse_expr", "lambdify"}
FILES = sorted((ROOT / "eomgen").rglob("*.py"))


def forbidden_in(text: str) -> set[str]:
    """Forbidden words used as names, attributes, imports, or texts that could become either."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    names = {token.string for token in tokens if token.type == tokenize.NAME}
    texts = {
        node.value
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    return FORBIDDEN & (names | texts)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT / "eomgen")))
def test_no_forbidden_word(path: Path) -> None:
    assert forbidden_in(path.read_text(encoding="utf-8")) == set()


@pytest.mark.parametrize(
    "text",
    [
        "eval('1')",
        "import sympy\nsympy.sympify(x)",
        "from sympy import lambdify as f",
        "getattr(b, 'exec')",
        "compile(t, n, 'exec')",
    ],
)
def test_the_search_finds_them(text: str) -> None:
    assert forbidden_in(text)


def test_the_search_leaves_prose_alone() -> None:
    assert forbidden_in('"""Does not eval anything."""\n# exec\nvalue = evaluate(1)') == set()
