"""Stage emit: files of eomgen and where to begin -> those definitions that can be reached, method by method.

A method counts as reached where any code that is reached uses an attribute of its name, so that none is missed that is
called; the rest of a file goes.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable, Iterator, Mapping

from .uses import Import, SourceText, Uses

#: In place of what ends a block that never comes so far.
NOT_REACHED = "raise  # not reached"


class Sources(dict[str, SourceText]):
    """Files without their endings, each read when it is first needed, and without statements that never run.

    Parameters
    ----------
    texts : mapping of str to str
    left_out : collection of str
        Files whose import raises an error, so that what follows it in its block does not run.
    """

    def __init__(self, texts: Mapping[str, str], left_out: Collection[str]) -> None:
        super().__init__()
        self.texts = {name.removesuffix(".py"): text for name, text in texts.items()}
        self.left_out = left_out

    def __contains__(self, name: object) -> bool:
        return name in self.texts

    def __missing__(self, name: str) -> SourceText:
        found = SourceText(name, self.texts[name])
        if idle := list(self._idle(found)):
            lines = found.text.splitlines()
            for node in idle:
                lines[node.lineno - 1 : node.end_lineno] = [""] * ((node.end_lineno or node.lineno) - node.lineno + 1)
                if isinstance(node, ast.Return | ast.Raise):  # so that type checkers miss no result
                    lines[node.lineno - 1] = f"{' ' * node.col_offset}{NOT_REACHED}"
            found = SourceText(name, "\n".join(lines) + "\n")
        self[name] = found
        return found

    def _idle(self, source: SourceText) -> Iterator[ast.stmt]:
        """Statements of functions that stand behind an import of a file that is left out.

        Those stay that give a value to what others use, which type checkers would miss.
        """
        functions = [node for node in ast.walk(source.tree) if isinstance(node, ast.FunctionDef)]
        for function, block in ((node, inner) for node in functions for inner in ast.walk(node)):
            for statements in (getattr(block, part, None) for part in ("body", "orelse")):
                if isinstance(statements, list):
                    end = next((k for k, node in enumerate(statements, 1) if self._ends(source, node)), len(statements))
                    behind = [node for node in statements[end:] if not isinstance(node, ast.ImportFrom)]
                    yield from () if _gives(function, behind) else behind

    def _ends(self, source: SourceText, node: ast.stmt) -> bool:
        """Whether what follows a statement never runs."""
        if isinstance(node, ast.Try):
            leaving = all(isinstance(handler.body[-1], ast.Raise | ast.Return) for handler in node.handlers)
            return leaving and not node.orelse and any(self._ends(source, one) for one in node.body)
        return any(one.home in self.left_out for one in source.read(node))


class Selection:
    """What is reached.

    Parameters
    ----------
    texts : mapping of str to str
        Files by name (``runtime/signals.py``), generated ones at the root too.
    left_out : collection of str
        Files where the search ends (``runtime/minimal``).

    Attributes
    ----------
    files : set of str
        Without their endings.
    kept : set of (file, name)
        Definitions and imports at the top of a file.
    members : set of (file, class, place in its body)
    annotated : set of (file, name)
        Names in annotations of what is kept.
    refused : set of str
        Files of `left_out` that are imported somewhere.
    """

    def __init__(self, texts: Mapping[str, str], left_out: Collection[str]) -> None:
        self.sources = Sources(texts, left_out)
        self.left_out = left_out
        self.files: set[str] = set()
        self.kept: set[tuple[str, str]] = set()
        self.members: set[tuple[str, str, int]] = set()
        self.whole: set[tuple[str, str]] = set()  #: classes that look up their own methods by name
        self.attributes: set[str] = set()
        self.annotated: set[tuple[str, str]] = set()
        self.refused: set[str] = set()

    def begin(self, file: str) -> None:
        """Take a whole file."""
        source = self.sources[file]
        self._load(file)
        for name in (*source.definitions, *source.imports):
            self._keep(source, name)

    def reach(self, file: str, name: str) -> None:
        """Take a definition of a file."""
        self._reach(Import(name, file, name))

    def follow(self, public: Iterable[tuple[str, str]] = ()) -> None:
        """Go on until nothing more is reached.

        Parameters
        ----------
        public : iterable of (file, class)
            Classes whose methods users call.
        """
        for file, name in public:
            node = self.sources[file].definitions[name]
            assert isinstance(node, ast.ClassDef)
            methods = (part.name for part in node.body if isinstance(part, ast.FunctionDef))
            self.attributes |= {method for method in methods if not method.startswith("_")}
        before = None
        while before != (before := (len(self.kept), len(self.members), len(self.attributes), len(self.whole))):
            for file, name in list(self.kept):
                kept = self.sources[file].definitions.get(name)
                if isinstance(kept, ast.ClassDef):
                    self._look_into(self.sources[file], kept)

    def _load(self, file: str) -> None:
        if file in self.files:
            return
        self.files.add(file)
        self._use(self.sources[file], *self.sources[file].rest)

    def _keep(self, source: SourceText, name: str) -> None:
        if (source.name, name) in self.kept:
            return
        if name in source.imports:
            self.kept.add((source.name, name))
            self._reach(source.imports[name])
        elif (node := source.definitions.get(name)) is not None:
            self.kept |= {(source.name, other) for other, one in source.definitions.items() if one is node}
            if isinstance(node, ast.ClassDef):
                self._use(source, *node.decorator_list, *node.bases, *(word.value for word in node.keywords))
                self._look_into(source, node)
            else:
                self._use(source, node)

    def _reach(self, one: Import, attribute: str | None = None) -> None:
        """Follow an import, and an attribute of it where it is a file."""
        if one.home is None:
            return
        inner = f"{one.home}/{one.name}" if one.home else one.name
        for file in (one.home, inner):
            if file in self.left_out:
                self.refused.add(file)
                return
        if inner in self.sources:
            self._load(inner)
            if attribute is not None:
                self._keep(self.sources[inner], attribute)
        elif one.home in self.sources:
            self._load(one.home)
            self._keep(self.sources[one.home], one.name)

    def _look_into(self, source: SourceText, node: ast.ClassDef) -> None:
        for place, part in enumerate(node.body):
            member = (source.name, node.name, place)
            if member in self.members:
                continue
            name = part.name if isinstance(part, ast.FunctionDef) else "__"
            if name.startswith("__") or name in self.attributes or (source.name, node.name) in self.whole:
                self.members.add(member)
                if self._use(source, part).any_own:
                    self.whole.add((source.name, node.name))

    def _use(self, source: SourceText, *nodes: ast.AST) -> Uses:
        used = Uses(*nodes)
        self.attributes |= used.attributes
        self.annotated |= {(source.name, name) for name in used.annotated}
        for name in used.names | {name for name in used.annotated if not self._is_class(source, name)}:
            self._keep(source, name)
        local = {one.alias: one for node in used.imports for one in source.read(node)}
        for one in local.values():
            self._reach(one)
        for base, attribute in used.of_names:
            if (found := local.get(base) or source.imports.get(base)) is not None:
                self._reach(found, attribute)
        return used

    def _is_class(self, source: SourceText, name: str) -> bool:
        """Whether a name of an annotation is that of a class of another file, which is kept for other reasons only."""
        one = source.imports.get(name) or source.types.get(name)
        if one is None or one.home is None:
            return False
        return one.home not in self.sources or isinstance(
            self.sources[one.home].definitions.get(one.name), ast.ClassDef
        )

    def defined(self, one: Import) -> bool:
        """Whether what is imported is there."""
        if one.home is None:
            return True
        inner = f"{one.home}/{one.name}" if one.home else one.name
        return inner in self.files or (one.home, one.name) in self.kept


def _gives(function: ast.FunctionDef, statements: list[ast.stmt]) -> bool:
    """Whether statements of a function set an attribute, or a name that is read elsewhere in it."""
    parts = [part for node in statements for part in ast.walk(node)]
    stored = {part.id for part in parts if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)}
    inside = set(map(id, parts))
    read = (part for part in ast.walk(function) if isinstance(part, ast.Name) and id(part) not in inside)
    attributes = any(isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store) for part in parts)
    return attributes or not stored.isdisjoint(part.id for part in read)
