"""Stage emit: the text of a Python file -> what it defines, what it imports, and what each piece of its code uses."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple, TypeGuard

from ..syntax_trees import parse_module

#: Signatures of a method that only type checkers tell apart.
OVERLOAD = re.compile(r"^( +)@overload\n\1def .*\n(?:\1[ )].*\n)*", re.M)


class Import(NamedTuple):
    """One imported name."""

    alias: str  #: what it is called here
    home: str | None  #: the file or folder of the same package it comes from, ``runtime/signals``; None: elsewhere
    name: str  #: what it is called there


class SourceText:
    """One file.

    Parameters
    ----------
    name : str
        Path without its ending, ``runtime/signals``.
    text : str

    Attributes
    ----------
    definitions : dict of str to node
        Functions, classes and values of the file.
    imports, types : dict of str to Import
        At its top: always, and under TYPE_CHECKING.
    rest : list of nodes
        Statements that are carried out as the file is loaded and define no name.
    """

    def __init__(self, name: str, text: str) -> None:
        text = OVERLOAD.sub("", text)
        self.name, self.text, self.tree = name, text, parse_module(text)
        self.definitions: dict[str, ast.stmt] = {}
        self.imports: dict[str, Import] = {}
        self.types: dict[str, Import] = {}
        self.rest: list[ast.stmt] = []
        for node in self.tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                self.definitions[node.name] = node
            elif names := list(assigned(node)):
                self.definitions |= dict.fromkeys(names, node)
            elif isinstance(node, ast.Import | ast.ImportFrom):
                self.imports |= {one.alias: one for one in self.read(node)}
            elif is_typing(node):
                self.types |= {one.alias: one for inner in node.body for one in self.read(inner)}
            elif not is_text(node):
                self.rest.append(node)

    def read(self, node: ast.stmt) -> list[Import]:
        """The names that a statement imports."""
        if isinstance(node, ast.Import):
            return [Import(one.asname or one.name.partition(".")[0], None, one.name) for one in node.names]
        if not isinstance(node, ast.ImportFrom):
            return []
        home = None
        if node.level:
            folders = self.name.split("/")[: -node.level]
            home = "/".join([*folders, *(node.module.split(".") if node.module else [])])
        return [Import(one.asname or one.name, home, one.name) for one in node.names]


def assigned(node: ast.stmt) -> Iterator[str]:
    """Names to which a statement gives values, if it does nothing else."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    if all(isinstance(target, ast.Name | ast.Tuple) for target in targets):
        yield from (part.id for target in targets for part in ast.walk(target) if isinstance(part, ast.Name))


def is_typing(node: ast.AST) -> TypeGuard[ast.If]:
    """Whether a statement is ``if TYPE_CHECKING:``."""
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def is_text(node: ast.stmt) -> bool:
    """Whether a statement is a text alone, as docstrings are."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


class Uses(ast.NodeVisitor):
    """What a piece of code uses when it runs, and, apart, the names in its annotations, which never run.

    Attributes
    ----------
    names, annotated : set of str
    attributes : set of str
        ``b`` of ``a.b``, whatever a is, and of ``getattr(a, "b")``.
    of_names : set of (str, str)
        ``("a", "b")`` where a is a plain name.
    imports : list of nodes
        Imports of names inside functions.
    any_own : bool
        Whether an attribute of ``self`` is looked up by a name that is put together.
    """

    def __init__(self, *nodes: ast.AST) -> None:
        self.names: set[str] = set()
        self.annotated: set[str] = set()
        self.attributes: set[str] = set()
        self.of_names: set[tuple[str, str]] = set()
        self.imports: list[ast.ImportFrom] = []
        self.any_own = False
        for node in nodes:
            self.visit(node)

    def visit_Name(self, node: ast.Name) -> None:
        """Note a name."""
        self.names.add(node.id)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """Note an attribute."""
        self.attributes.add(node.attr)
        if isinstance(node.value, ast.Name):
            self.of_names.add((node.value.id, node.attr))
        self.visit(node.value)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """Note an import."""
        self.imports.append(node)

    def visit_Call(self, node: ast.Call) -> None:
        """Note an attribute that is named by a text."""
        if isinstance(node.func, ast.Name) and node.func.id in ("getattr", "hasattr") and len(node.args) > 1:
            one, name = node.args[:2]
            if isinstance(name, ast.Constant):
                self.attributes.add(str(name.value))
            self.any_own |= isinstance(name, ast.JoinedStr) and isinstance(one, ast.Name) and one.id == "self"
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        """Of what is there for type checkers only annotations are used."""
        if is_typing(node):
            self.names.add("TYPE_CHECKING")
            self.annotated |= Uses(*(part for part in node.body if isinstance(part, ast.FunctionDef))).annotated
        for part in node.orelse if is_typing(node) else ast.iter_child_nodes(node):
            self.visit(part)

    def visit_arg(self, node: ast.arg) -> None:
        """Note an annotation."""
        self._annotation(node.annotation)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Note an annotation, and a value."""
        self._annotation(node.annotation)
        for part in (node.target, node.value):
            if part is not None:
                self.visit(part)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Note an annotation, and the body."""
        self._annotation(node.returns)
        for part in (*node.decorator_list, node.args, *node.body):
            self.visit(part)

    def _annotation(self, node: ast.expr | None) -> None:
        for part in ast.walk(node) if node is not None else ():
            if isinstance(part, ast.Name):
                self.annotated.add(part.id)
            elif isinstance(part, ast.Constant) and isinstance(part.value, str):
                self.annotated |= set(re.findall(r"\w+", part.value))
