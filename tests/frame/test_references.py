"""What docstrings refer to is there: every target of a role is imported and read, as Python's relative imports are."""

from __future__ import annotations

import ast
import builtins
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import eomgen as eg

ROOT = Path(eg.__file__).parent
ROLE = re.compile(r":(?:class|meth|func|mod|attr|data|exc|obj):`([^`]+)`")
FILES = sorted(path for path in ROOT.rglob("*.py") if ROLE.search(path.read_text(encoding="utf-8")))


def follow(found: Any, names: list[str]) -> bool:
    """Whether the attributes of an object, or of what it is an instance of, lead anywhere."""
    for name in names:
        known = getattr(found, "__annotations__", {}).keys() | getattr(found, "__dataclass_fields__", {}).keys()
        if not hasattr(found, name):
            return name == names[-1] and (name in known or documented(found, name))
        found = getattr(found, name)
    return True


def documented(kind: Any, name: str) -> bool:
    """Whether a class lists an attribute that its instances get."""
    if not isinstance(kind, type):
        return False
    text = "\n".join(base.__doc__ or "" for base in kind.__mro__[:-1])
    return re.search(rf"^ +(?:\w+, )*{name}(?:, \w+)* :", text, re.MULTILINE) is not None


def importable(path: str) -> bool:
    """Whether a dotted path is a module, or something within one."""
    names = path.split(".")
    for k in range(len(names), 0, -1):
        try:
            found = import_module(".".join(names[:k]))
        except ModuleNotFoundError:
            continue
        return follow(found, names[k:])
    return False


def resolves(target: str, module: str, is_package: bool, scopes: list[str]) -> bool:
    """Whether a target leads somewhere from a module, within classes of it."""
    target = (re.search(r"<(.+)>$", target) or ["", target])[1].lstrip("~").removesuffix("()")
    if target.startswith("."):
        dots = len(target) - len(target.lstrip("."))
        package = module.split(".") if is_package else module.split(".")[:-1]
        base = package[: len(package) - dots + 1]
        return len(base) > 0 and importable(".".join([*base, target[dots:]]))
    here, names = import_module(module), target.split(".")
    places = [here, eg, eg.Model, import_module("eomgen.api.module").Module, builtins]
    for scope in scopes:
        found: Any = here
        for name in scope.split("."):
            found = getattr(found, name)
        places.insert(0, found)
    return any(follow(place, names) for place in places) or importable(target)


def scopes_at(tree: ast.Module, line: int) -> list[str]:
    """The classes around a line, the outermost first."""
    found: list[str] = []
    node: Any = tree
    while node is not None:
        inner = [c for c in ast.iter_child_nodes(node) if isinstance(c, ast.ClassDef)]
        node = next((c for c in inner if c.lineno <= line <= (c.end_lineno or line)), None)
        if node is not None:
            found.append(f"{found[-1]}.{node.name}" if found else node.name)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_target_is_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    tree, parts = ast.parse(text), ["eomgen", *path.relative_to(ROOT).with_suffix("").parts]
    is_package = parts[-1] == "__init__"
    module = ".".join(parts[:-1] if is_package else parts)
    lost = []
    for found in ROLE.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        if not resolves(found[1], module, is_package, scopes_at(tree, line)):
            lost.append(f"{path.relative_to(ROOT)}:{line}: {found[0]}")
    assert not lost, "\n".join(lost)


def test_targets_that_are_not_there_are_seen() -> None:
    module = "eomgen.simulation.integrator"
    for target in ("..runtime.signals.Signal", "~.simulate.simulate", "Integrator", "simulate", "numpy.ndarray"):
        assert resolves(target, module, False, []), target
    for target in (".integrator.Integrat", "...runtime.signals.Signal", "Integratr", ".runtime.signals.Signal"):
        assert not resolves(target, module, False, []), target
