"""Checks of the source text that ruff and mypy do not make; ``make lint`` runs it, and it exits 1 with what is wrong.

It reads files and imports the package, and stands apart from the tests, which only look at what the package does.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
#: Nothing that executes or parses code by other means than eomgen's own parser is called.
FORBIDDEN = {"eval", "exec", "sympify", "parse_expr", "lambdify"}
#: Words that only their authors understand, where a textbook of mechanics or of compilers has a better one.
GONE = {
    *("alone", "asked", "bench", "brim", "carried", "clothes", "culprit", "curved", "journey", "knob", "late", "leap"),
    *("passing", "put_in", "regular", "room", "settled", "shown", "spot", "told", "travel", "twin", "usual"),
}
#: Those of them that have no other meaning, which stand in no text either.
STRANGE = re.compile(r"\b(?:brim|clothes|culprit|journey|knob|leap|twin)s?\b", re.IGNORECASE)
#: These, and others with the rooms whose names still have them.
PRIVATE = {word: set[str]() for word in GONE} | {
    "across": {"elements"},
    "cases": {"cli"},
    "found": {"elements", "model"},
    "given": {"mechanics", "model", "reading"},
    "held": {"analysis"},
    "led": {"analysis", "runtime"},
    "own": {"elements"},
    "words": {"elements", "expr", "reading"},
}
#: Numbers below this are limits, which stand in files of that name alone; those in formulas, such as 1/720, are larger.
SMALL = 5e-4
#: What is no limit: a default of a user's option, switches between two formulas for one thing, a step in 60 digits.
NO_LIMITS = {
    "base/assembly.py": {1e-8},
    "codegen/loop_systems.py": {1e-100},
    "importers/robot.py": {1e-11},
    "elements/rotations.py": {1e-4},
    "verify/digits.py": {1e-6},
}
ROLE = re.compile(r":(?:class|meth|func|mod|attr|data|exc|obj):`([^`]+)`")
#: Folders of tests that speak to the public face alone.
ROOMS = ("mechanics", "forces", "runs", "model", "code", "shown", "core", "attack")
LONGEST = 800  #: lines of a file of tests


#: What runs reach beyond the folders that packages carry: texts, pictures, analyses.
BEYOND = {
    "analysis.experiments": {"model"},
    "analysis.modes": {"show"},
    "module": {"codegen", "toolchain", "verify"},
    "runtime.drawing": {"show"},
    "runtime.inputs": {"model"},
    "runtime.plotting": {"expr"},
    "runtime.argument_checks": {"model"},
    "runtime.trajectory": {"show"},
}


def name_of(file: Path) -> str:
    """The dotted name of a file."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


FILES = {name_of(file): file for file in sorted((ROOT / "eomgen").rglob("*.py"))}
TEXTS = {name: file.read_text(encoding="utf-8") for name, file in FILES.items()}
TREES = {name: ast.parse(text) for name, text in TEXTS.items()}
NODES = {name: list(ast.walk(tree)) for name, tree in TREES.items()}


def forbidden() -> Iterator[str]:
    """Words that run text, as names or as texts that could become one."""
    for name, nodes in NODES.items():
        words = {getattr(node, part, None) for node in nodes for part in ("id", "attr", "name", "arg")}
        words |= {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}
        yield from (f"{name}: {word} is forbidden" for word in sorted(words & FORBIDDEN))


def private_words() -> Iterator[str]:
    """Names that are private words in further rooms, rooms that no longer have any, and such words in texts."""
    for name, text in TEXTS.items():
        yield from (f"{name}: {word} is a private word; use one of a textbook" for word in STRANGE.findall(text))
    homes: dict[str, set[str]] = {word: set() for word in PRIVATE}
    for name, nodes in NODES.items():
        names = {
            getattr(n, part, None) for n in nodes if not isinstance(n, ast.alias) for part in ("id", "name", "arg")
        }
        names |= {n.attr for n in nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
        words = {one.strip("_").lower() for one in names if isinstance(one, str)}
        for word in words & PRIVATE.keys():
            homes[word].add(f"{name}.".split(".")[1])
    for word, rooms in homes.items():
        yield from (
            f"{room}: {word} is a private word; use one of a textbook" for room in sorted(rooms - PRIVATE[word])
        )
        yield from (f"tools/lint.py: {room} has no {word} any more" for room in sorted(PRIVATE[word] - rooms))


def limits() -> Iterator[str]:
    """Limits that do not stand in files of limits; files in C take theirs from there by name."""
    for name, nodes in NODES.items():
        if "limits" in name.split("."):
            continue
        floats = {n.value for n in nodes if isinstance(n, ast.Constant) and type(n.value) is float}
        small = {x for x in floats if 0.0 < abs(x) < SMALL}
        if small != NO_LIMITS.get(str(FILES[name].relative_to(ROOT / "eomgen")), set()):
            yield f"{name}: limits outside files of limits, or no longer there: {small}"
    definitions = import_module("eomgen.native.limits").definitions
    for folder, pattern in (
        ("eomgen/native", r"\d(?:\.\d+)?e-\d+|\b0\.0\d+"),
        ("eomgen/native/ensembles", r"\d(?:\.\d+)?e-\d+"),  # these have tables of coefficients
        ("eomgen/native/steppers", r"\d(?:\.\d+)?e-\d+"),
    ):
        polynomials = {ROOT / "eomgen/native/eomgen_real.h"}
        for file in sorted({*(ROOT / folder).glob("*.[ch]")} - polynomials):
            text = re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
            yield from (f"{file.name}: a limit without a name: {found}" for found in re.findall(pattern, text))
            try:
                definitions(text)
            except (AttributeError, KeyError) as error:
                yield f"{file.name}: {error}"


def imports_of(name: str) -> set[str]:
    """Files of the package that a file imports anywhere: at the top, in functions, for types."""
    package = name.split(".") if FILES.get(name, Path()).name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in NODES[name]:
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            home = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{home}.{alias.name}" if f"{home}.{alias.name}" in FILES else home for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {other for other in found & FILES.keys() if other != name and not name.startswith(f"{other}.")}


def directions() -> Iterator[str]:
    """Imports in a circle, or against the rows of ARCHITECTURE.md."""
    graph = {name: imports_of(name) for name in FILES}
    calls = import_module("eomgen.module").CALLS  # named as text
    graph["eomgen.module"] |= {f"eomgen.{home}" for home in calls.values()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        yield f"a circle of imports: {' -> '.join(error.args[1])}"
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| (\d+) \| ([a-z_, ]+) \|", text, re.M)
    rows = {name: int(number) for number, names in found for name in names.split(", ")}
    for odd in sorted(set(rows) ^ ({name.split(".")[1] for name in FILES if "." in name} - {"__main__"})):
        yield f"ARCHITECTURE.md: {odd} has no row, or no package"
    for name, others in graph.items():
        for other in others:
            here, there = ((f"{one}.").split(".")[1] for one in (name, other))
            here, there = ("base" if one == "errors" else one for one in (here, there))  # one floor
            if here != there and here not in ("", "__main__") and there and rows[there] >= rows[here]:
                yield f"{name} imports {other}, which stands in the same row of ARCHITECTURE.md or above"
    included = {part.removesuffix(".py") for part in import_module("eomgen.codegen.package").CONTENTS}
    for name, others in graph.items():
        homes = {other.split(".")[1] for other in others if "." in other} - included
        if f"{name}.".split(".")[1] in included and (homes := homes - BEYOND.get(name.removeprefix("eomgen."), set())):
            yield f"{name} imports {', '.join(sorted(homes))}, which packages do not carry"


def follow(found: Any, names: list[str]) -> bool:
    """Whether attributes of an object, or those that a class gives or documents for its instances, lead anywhere."""
    for name in names:
        if not hasattr(found, name):
            known = getattr(found, "__annotations__", {}).keys() | getattr(found, "__dataclass_fields__", {}).keys()
            text = "\n".join(base.__doc__ or "" for base in getattr(found, "__mro__", ())[:-1])
            listed = re.search(rf"^ +(?:\w+, )*{name}(?:, \w+)* :", text, re.M)
            return name == names[-1] and (name in known or listed is not None)
        found = getattr(found, name)
    return True


def importable(path: str) -> bool:
    """Whether a dotted path is a module, or something within one."""
    names = path.split(".")
    for k in range(len(names), 0, -1):
        try:
            return follow(import_module(".".join(names[:k])), names[k:])
        except ModuleNotFoundError:
            continue
    return False


def references() -> Iterator[str]:
    """Roles of docstrings whose targets are not there."""
    eg = import_module("eomgen")
    general = [eg, eg.Model, eg.Module, builtins]
    for name, text in TEXTS.items():
        classes = [n for n in TREES[name].body if isinstance(n, ast.ClassDef)] if ROLE.search(text) else []
        for found in ROLE.finditer(text):
            line = text.count("\n", 0, found.start()) + 1
            here = import_module(name)
            around = [getattr(here, c.name) for c in classes if c.lineno <= line <= (c.end_lineno or line)]
            target = (re.search(r"<(.+)>$", found[1]) or ["", found[1]])[1].lstrip("~").removesuffix("()")
            if target.startswith("."):
                dots = len(target) - len(target.lstrip("."))
                package = [*name.split("."), ""] if FILES[name].name == "__init__.py" else name.split(".")
                there = dots < len(package) and importable(".".join([*package[:-dots], target[dots:]]))
            else:
                there = any(follow(p, target.split(".")) for p in (*around, here, *general)) or importable(target)
            if not there:
                yield f"{name}, line {line}: {found[0]} leads nowhere"


def packages() -> Iterator[str]:
    """Packages that pyproject.toml does not list, and folders without __init__.py."""
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    folders = {file.parent for file in FILES.values()}
    yield from (f"{folder} has no __init__.py" for folder in folders if not (folder / "__init__.py").exists())
    there = {".".join(folder.relative_to(ROOT).parts) for folder in folders} | set(setuptools["package-dir"])
    yield from (f"pyproject.toml: packages: {name}" for name in sorted(there ^ set(setuptools["packages"])))


def keywords() -> Iterator[str]:
    """Options that type checkers know (``TypedDict``), where they are not those that there are."""
    homes = (
        "runtime.protocols",
        "runtime.trajectory",
        "toolchain.compiler",
        "analysis.sensitivities",
        "importers.robot",
    )
    types = {name: of for home in homes for name, of in vars(import_module(f"eomgen.{home}")).items()}

    def arguments(home: str, name: str, *others: str) -> set[str]:
        return set(inspect.signature(getattr(import_module(f"eomgen.{home}"), name)).parameters) - {*others}

    bound, robot = (set(types[name].__annotations__) for name in ("BoundValues", "RobotKeywords"))
    shown = {"module", "file", "format"}
    for known, those in {
        "BuildOptions": arguments("toolchain.compiler", "Options"),
        "StepOptions": bound | set(import_module("eomgen.runtime.runs.run_arguments").STEPS),
        "ReducedOptions": bound | set(import_module("eomgen.analysis.sensitivities").OPTIONS),
        "RobotKeywords": arguments("importers", "RobotOptions", "check_inertia"),
        "LoadOptions": arguments("api.loading", "load", "path", "robot") | robot,
        "AnimationOptions": arguments("show.animate", "animate", "trajectory", "states", "columns", *shown) | {"model"},
        "FilmOptions": arguments("show.animate", "animate_mode", "x", "shape", *shown),
    }.items():
        for name in sorted(those ^ set(types[known].__annotations__)):
            yield f"{types[known].__module__}: {known}: {name}"


def codes() -> Iterator[str]:
    """Codes of errors that are not in the table, and those of the table that no error has."""
    from eomgen.errors import CODES

    constants = [(name, node) for name, nodes in NODES.items() for node in nodes if isinstance(node, ast.Constant)]
    used = [(name, str(node.value)) for name, node in constants if re.fullmatch("EG-[A-Z-]+", str(node.value))]
    yield from (f"{name}: {code} is no code of eomgen.errors.CODES" for name, code in used if code not in CODES)
    counts = Counter(code for _, code in used)
    yield from (f"eomgen.errors: no error has the code {code}" for code in CODES if counts[code] < 2)


def public_tests() -> Iterator[str]:
    """Tests that import what no page of the documentation names, or that are too long to be read."""
    pages = [*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")]
    named = {word for page in pages for word in re.findall(r"\beomgen(?:\.\w+)+", page.read_text(encoding="utf-8"))}
    for file in sorted(file for room in ROOMS for file in (ROOT / "tests" / room).rglob("*.py")):
        text, place = file.read_text(encoding="utf-8"), file.relative_to(ROOT)
        if (count := text.count("\n")) > LONGEST:
            yield f"{place}: {count} lines, more than {LONGEST}"
        for node in ast.walk(ast.parse(text)):
            homes = {node.module or ""} if isinstance(node, ast.ImportFrom) else set()
            homes |= {alias.name for alias in node.names} if isinstance(node, ast.Import) else set()
            inner = {home for home in homes if home.startswith("eomgen.") and not home.endswith(".__main__")}
            for home in sorted(inner):
                if "._" in home or not any(f"{word}.".startswith(f"{home}.") for word in named):
                    yield f"{place}: imports {home}, which is not documented"


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    wrong = [
        line
        for check in (forbidden, private_words, limits, directions, references, packages, keywords, codes, public_tests)
        for line in check()
    ]
    print("\n".join(wrong) or "source text: nothing wrong")
    sys.exit(bool(wrong))
