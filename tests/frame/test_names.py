"""Each file and each class of the package has a name of its own."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "eomgen").rglob("*.py"))


def twice(names: list[str]) -> list[str]:
    return sorted(name for name, count in Counter(names).items() if count > 1)


def test_no_two_files_of_one_name() -> None:
    assert twice([path.name for path in FILES if path.name not in ("__init__.py", "__main__.py")]) == []


def test_no_two_classes_of_one_name() -> None:
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in FILES]
    assert twice([node.name for tree in trees for node in tree.body if isinstance(node, ast.ClassDef)]) == []
