"""Imports go one way: no file imports, even for types or when it is called, one that imports it."""

from __future__ import annotations

import ast
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from eomgen.api.module import CALLS
from eomgen.verification.verify import GROUPS

ROOT = Path(__file__).parents[2] / "eomgen"


def name_of(file: Path) -> str:
    return ".".join(file.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")


FILES = {name_of(file): file for file in sorted(ROOT.rglob("*.py"))}


def imports_of(name: str, text: str, is_package: bool) -> set[str]:
    """Files that a file imports anywhere: at the top, in functions, under TYPE_CHECKING."""
    package = name.split(".") if is_package else name.split(".")[:-1]
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            home = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{home}.{alias.name}" if f"{home}.{alias.name}" in FILES else home for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {other for other in found & FILES.keys() if other != name and not name.startswith(f"{other}.")}


def graph() -> dict[str, set[str]]:
    found = {name: imports_of(name, file.read_text(), file.name == "__init__.py") for name, file in FILES.items()}
    found["eomgen.api.module"] |= {f"eomgen.{home}" for home in CALLS.values()}  # named as text
    found["eomgen.verification.verify"] |= {f"eomgen.verification.check_{group}" for group in GROUPS}
    return found


def test_no_file_imports_one_that_imports_it() -> None:
    found = graph()
    assert set().union(*found.values()) <= FILES.keys()
    assert sum(map(len, found.values())) > 1000  # the reading works
    try:
        TopologicalSorter(found).prepare()
    except CycleError as error:
        pytest.fail(f"a circle of imports: {' -> '.join(error.args[1])}")


def test_packages_stand_in_the_rows_of_the_architecture() -> None:
    text = (ROOT.parent / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = {
        name: int(number)
        for number, names in re.findall(r"^\| (\d+) \| ([a-z_, ]+) \|", text, re.M)
        for name in names.split(", ")
    }
    own = {name.split(".")[1] for name in FILES if "." in name} - {"__main__"}
    assert set(rows) == own
    for name, others in graph().items():
        for other in others:
            here, there = ((f"{one}.").split(".")[1] for one in (name, other))
            assert here == there or here in ("", "__main__") or there == "" or rows[there] < rows[here], (name, other)


@pytest.mark.parametrize(
    "text",
    [
        "from .b import x",
        "def f():\n    from . import b",
        "if TYPE_CHECKING:\n    from ..frame.b import x",
        "from eomgen.frame.b import x",
        "import eomgen.frame.b",
    ],
)
def test_every_way_to_import_is_seen(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FILES, "eomgen.frame.b", ROOT / "frame" / "b.py")
    assert imports_of("eomgen.frame.a", text, False) == {"eomgen.frame.b"}
