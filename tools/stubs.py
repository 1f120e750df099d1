"""The tables of types and calls -> element_methods.pyi and module.pyi, for editors and type checkers.

The build of the package and ``make lint`` write them.  Of methods that add elements there is the first sentence;
``help(Model.spring)`` has the rest.
"""

from __future__ import annotations

import sys
import textwrap
from inspect import Parameter, cleandoc
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # of the eomgen beside this file, whichever is installed

from eomgen.elements.element_type import ElementType  # noqa: E402
from eomgen.model.element_methods import ElementMethods, methods  # noqa: E402
from eomgen.model.methods import RESULTS, arguments_of, documentation_of, laws_of  # noqa: E402
from eomgen.module import CALLS, FORMS, SOLVERS  # noqa: E402

_HEAD = '''# Written by python tools/stubs.py from the tables of types.

from collections.abc import Mapping, Sequence
from typing import Any

from ..elements.element_type import ElementType
from .handles import BodyHandle, ConstraintHandle, Described, ForceHandle, JointHandle

Value = Any  # a number, a text or a SymPy expression

def methods() -> dict[str, Mapping[str, ElementType]]: ...

class ElementMethods(Described):
    def joint(self, type: str, name: str, predecessor: Any, successor: Any, **keys: Any) -> JointHandle:
        """{0}"""
    def _method(self, name: str) -> Any: ...
'''


_MODULE = """# Written by python tools/stubs.py from the tables of calls.

from collections.abc import Callable
from typing import Any

from .runtime.bound_model import BoundModel
{imports}

CALLS: dict[str, str | Callable[..., Any]]
FORMS: dict[str, str]
SOLVERS: tuple[str, ...]

def find_function(file: str, name: str) -> Any: ...

class Module(BoundModel):
    @classmethod
    def of(cls, package: Any) -> Module: ...
{names}
"""


def module_stub() -> str:
    """The text of module.pyi."""
    homes = CALLS | {form.capitalize(): home for form, home in FORMS.items()}
    imports = [f"from .{home} import {name} as _{name}" for name, home in homes.items()]
    names = [f"{name} = _{name}" for name in CALLS] + [f"{form}: _{form.capitalize()}" for form in FORMS]
    names += [f"{name}: type[Any]" for name in SOLVERS]
    return _MODULE.format(imports="\n".join(imports), names="\n".join(f"    {name}" for name in names))


def element_stub() -> str:
    """The text of element_methods.pyi."""
    text = _HEAD.format(_summary(ElementMethods.joint.__doc__ or ""))
    return text + "".join(_method(section, found) for section, types in methods().items() for found in types.values())


def _method(section: str, found: ElementType) -> str:
    listed, keywords = ["self", "name: str"], False
    for one in arguments_of(found):
        if one.name.startswith("*"):
            listed.append(f"{one.name}: {one.annotation}")
            keywords = True
            continue
        annotation, default = one.annotation, ""
        if keywords or one.default is not Parameter.empty:  # what follows *between may also be its last
            plain = None if one.default is Parameter.empty else one.default
            default = f" = {plain!r}"
            annotation += " | None" if plain is None and annotation not in ("Any", "Value") else ""
        listed.append(f"{one.name}: {annotation}{default}")
    listed += ["**keys: Any"] if laws_of(found) else []
    result = RESULTS[section][0] if section in RESULTS else "None"
    result = "Any" if result.startswith("sympy.") else result
    parts = [f"{part},".replace(" ", "\0") for part in listed]  # no line ends within an argument
    parts[-1] = parts[-1].removesuffix(",") + f")\0->\0{result}:"
    text = f"def\0{found.name}({' '.join(parts)}"
    head = [line.replace("\0", " ") for line in textwrap.wrap(text, 116, subsequent_indent="    ")]
    doc = textwrap.wrap(f'"""{_summary(documentation_of(section, found))}"""', 112)
    return textwrap.indent("\n".join([*head, *(f"    {line}" for line in doc), ""]), "    ")


def _summary(doc: str) -> str:
    return " ".join(cleandoc(doc).partition("\n\n")[0].split())


def write() -> None:
    """Write the files that differ."""
    for name, text in (("model/element_methods.pyi", element_stub()), ("module.pyi", module_stub())):
        home = ROOT / "eomgen" / name
        if not home.exists() or home.read_text(encoding="utf-8") != text:
            home.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
