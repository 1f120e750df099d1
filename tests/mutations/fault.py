"""One deliberate fault: what is changed where, and which tests notice it."""

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


def read_sources(root: Path) -> dict[Path, str]:
    """The texts of the package and of its templates."""
    files = [*(root / "eomgen").rglob("*.py"), *(root / "templates").rglob("*"), *(root / "eomgen/native").rglob("*")]
    return {p: p.read_text(encoding="utf-8") for p in files if p.is_file() and p.suffix not in (".pyc", ".so")}


@dataclass(frozen=True)
class Fault:
    """A change of the sources that makes results wrong, wherever they lie and however they are laid out.

    ``where`` is a function, ``Class.method`` or constant of Python, in which the expression or statement ``old`` occurs
    once and becomes ``new``; or ``C``, with the function of C if there is one, and ``old`` any fragment of it.  The
    file's name stands in front where two files have the same.  Of the tests ``caught_by``, pytest's node ids, one must
    fail then.  ``breaks`` says what is wrong.
    """

    id: str
    where: str
    old: str
    new: str
    breaks: str
    caught_by: Sequence[str] = ()

    def apply(self, texts: Mapping[Path, str]) -> tuple[Path, str]:
        """The file in which the fault lies, and its text with the fault.

        Raises
        ------
        ValueError
            What is to be changed does not occur exactly once.
        """
        in_c = self.where.split()[0] == "C"
        names = re.findall(r"\w+", self.where)[in_c:]
        changed = []
        for path, text in texts.items():
            if (path.suffix == ".py") != in_c:
                below = names[1:] if len(names) > 1 and names[0] == path.stem else names
                changed += [(path, new) for new in (self._in_c if in_c else self._in_python)(text, below)]
        if len(changed) != 1:
            raise ValueError(f"{self.id}: {self.old!r} occurs {len(changed)} times in {self.where}, not once")
        return changed[0]

    def _in_c(self, text: str, names: list[str]) -> Iterator[str]:
        fragment = r"\s*".join(re.escape(part) for part in re.findall(r"\w+|\S", self.old))
        function = rf"^[^\s#/{{}}][^\n{{}};]*\b{names[0]}\([^;{{}}]*\)\s*\{{.*?^\}}" if names else r"\A.*\Z"
        for body in re.finditer(function, text, re.MULTILINE | re.DOTALL):
            for here in re.finditer(fragment, body[0]):
                yield text[: body.start() + here.start()] + self.new + text[body.start() + here.end() :]

    def _in_python(self, text: str, names: list[str]) -> Iterator[str]:
        if names[-1] not in text or not re.search(
            rf"^ *((async )?def|class) {names[-1]}\b|^ *{names[-1]} ?[:=]", text, re.M
        ):
            return  # nothing of this name is here: spare the time to parse it
        tree = ast.parse(text)
        homes: list[Any] = [tree]
        for name in names:
            homes = [node for home in homes for node in getattr(home, "body", []) if _name(node) == name]
        [old], new = (ast.parse(part).body for part in (self.old, self.new))
        if isinstance(old, ast.Expr) and isinstance(new[0], ast.Expr):
            old, new = old.value, new[0].value
        sought = ast.dump(old)
        for node in [node for home in homes for node in ast.walk(home) if type(node) is type(old)]:
            if ast.dump(node) == sought:
                yield ast.unparse(_Exchange(node, new).visit(tree))


class _Exchange(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: Any) -> None:
        self.old, self.new = old, new

    def visit(self, node: ast.AST) -> Any:
        return self.new if node is self.old else self.generic_visit(node)


def _name(node: Any) -> str | None:
    """The name that a statement gives to something."""
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", node)
    return getattr(target, "name", getattr(target, "id", None))


FAULTS = tuple(
    Fault(id, **entry) for id, entry in tomllib.loads(Path(__file__).with_name("faults.toml").read_text()).items()
)
