"""Stage emit: files of eomgen and what of them is reached -> their text without the rest.

What stays is the text of eomgen, but for its documentation, of which the first paragraph stays: of files, of classes,
and of the functions that users call.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from textwrap import fill
from textwrap import indent as indented

from ..texts import WIDTH
from .selection import Selection
from .uses import Import, SourceText, assigned, is_text, is_typing


def abridge(selection: Selection, file: str, documented: bool = True) -> str:
    """The text of a file with what is reached of it, functions with their documentation or without."""
    return _AbridgedText(selection, selection.sources[file], documented).written()


class _AbridgedText:
    """The lines of a file, some of which go."""

    def __init__(self, selection: Selection, source: SourceText, documented: bool) -> None:
        self.selection, self.source, self.documented = selection, source, documented
        self.lines: list[str | None] = list(source.text.splitlines())
        self._shorten(source.tree)
        for node in sorted(source.tree.body, key=_order):
            self._visit(node)

    def written(self) -> str:
        """The text; one empty line between definitions and none within functions."""
        kept = [line for line in self.lines if line is not None]
        text = re.sub(r"\n{3,}", "\n\n", "\n".join(kept))
        return re.sub(r"\n\n(?= +(?!def |@|class |#:))", "\n", text).strip() + "\n"

    def _visit(self, node: ast.stmt) -> None:
        selection, source = self.selection, self.source
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if (source.name, node.name) not in selection.kept:
                self._cut(node)
                return
            if isinstance(node, ast.ClassDef):
                for place, part in enumerate(node.body):
                    if (source.name, node.name, place) not in selection.members and not is_text(part):
                        self._cut(part)
                    elif is_typing(part):
                        self._attributes(part)
            for inner in ast.walk(node):
                if isinstance(inner, ast.FunctionDef | ast.ClassDef):
                    self._shorten(inner)
                if isinstance(inner, ast.FunctionDef) and self.lines[inner.lineno - 1] is not None:
                    self._fill(inner)
        elif names := list(assigned(node)):
            if not any((source.name, name) in selection.kept for name in names):
                self._cut(node)
        elif is_typing(node):
            self._types(node)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            self._imports(node, [one for one in source.read(node) if self._wanted(one)])

    def _wanted(self, one: Import) -> bool:
        here = (self.source.name, one.alias)
        return here in self.selection.kept or (here in self.selection.annotated and self.selection.defined(one))

    def _imports(self, node: ast.Import | ast.ImportFrom, wanted: Sequence[Import]) -> None:
        if isinstance(node, ast.ImportFrom) and node.module == "__future__":
            return
        keep = {one.alias for one in wanted}
        names = [one for one in node.names if (one.asname or one.name.partition(".")[0]) in keep]
        if len(names) < len(node.names):
            self._cut(node)
        if names and len(names) < len(node.names):
            node.names = names
            self.lines[node.lineno - 1] = " " * node.col_offset + ast.unparse(node)

    def _attributes(self, block: ast.If) -> None:
        """What a class says to type checkers: an attribute whose type is not there goes."""
        for node in block.body:
            kind = node.value if isinstance(node, ast.Assign) else getattr(node, "annotation", None)
            if isinstance(kind, ast.Name):
                one = self.source.types.get(kind.id)
                if one is not None and not self.selection.defined(one):
                    self._cut(node)
                else:
                    self.selection.annotated.add((self.source.name, kind.id))

    def _types(self, block: ast.If) -> None:
        """What only type checkers read: a name that is not there is Any to them."""
        lacking: list[str] = []
        for node in block.body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                used = [
                    one for one in self.source.read(node) if (self.source.name, one.alias) in self.selection.annotated
                ]
                there = [one for one in used if self.selection.defined(one)]
                lacking += [one.alias for one in used if one not in there]
                self._imports(node, there)
        if lacking:
            line = f"    from typing import {', '.join(f'Any as {name}' for name in sorted(lacking))}"
            self.lines[block.lineno - 1] = f"{self.lines[block.lineno - 1]}\n{line}"
        elif all(line is None or not line.strip() for line in self.lines[block.lineno : block.end_lineno]):
            self._cut(block)
            return
        self.selection.kept.add((self.source.name, "TYPE_CHECKING"))

    def _cut(self, node: ast.stmt) -> None:
        """Take out a statement, with its decorators and the comments right above it."""
        first = min([node.lineno, *(one.lineno for one in getattr(node, "decorator_list", []))]) - 1
        while first and (above := self.lines[first - 1]) is not None and above.strip().startswith("#"):
            first -= 1
        for k in range(first, node.end_lineno or node.lineno):
            self.lines[k] = None

    def _fill(self, node: ast.FunctionDef) -> None:
        """Write a signature that has an argument on each line in as few lines as hold it."""
        first, end = node.lineno - 1, node.body[0].lineno - 1
        if end - first < 4 or not (self.lines[end - 1] or "").lstrip().startswith(")"):
            return
        indent = " " * node.col_offset
        returns = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
        whole = re.sub("(?<!,) ", "\xa0", ast.unparse(node.args))  # lines end after a comma
        lines = fill(whole, WIDTH - len(indent), break_on_hyphens=False, break_long_words=False)
        arguments = indented(lines.replace("\xa0", " "), "    ")
        text = f"def {node.name}(\n{arguments}\n){returns}:"
        self.lines[first:end] = [indented(text, indent), *[None] * (end - first - 1)]

    def _shorten(self, node: ast.Module | ast.ClassDef | ast.FunctionDef) -> None:
        """Keep the first paragraph of a docstring."""
        if not is_text(node.body[0]):
            return
        if isinstance(node, ast.FunctionDef) and not self.documented and len(node.body) > 1:
            self._cut(node.body[0])
            return
        first, last = node.body[0].lineno - 1, node.body[0].end_lineno or 0
        empty = [k for k in range(first, last) if not (self.lines[k] or "").strip()]
        if empty and self.lines[last - 1] is not None:
            self.lines[empty[0] - 1] = f'{self.lines[empty[0] - 1]}"""'
            for k in range(empty[0], last):
                self.lines[k] = None


def _order(node: ast.stmt) -> int:
    """Classes first, which use what is imported for type checkers, then that, then other imports."""
    return 2 if isinstance(node, ast.Import | ast.ImportFrom) else int(is_typing(node))
