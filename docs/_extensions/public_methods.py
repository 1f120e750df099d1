"""Documentation of the methods of Model in groups, and of limits: ``{eomgen-methods} joints``, ``{eomgen-limits}``."""

from __future__ import annotations

import pkgutil
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode

import eomgen
from eomgen.errors import CODES
from eomgen.model.fields import ELEMENTS

#: Methods of Model that say or do something about the whole, in the order in which one meets them.
GROUPS = {
    "Describe": "parameter input body bodies ground joint joints table native component attachment add initial guess "
    "independent event output simulation",
    "Quantities for outputs": "t coordinate parameters center_of_mass total_mass momentum angular_momentum "
    "inertia_about kinetic_energy potential_energy total_energy",
    "Check, derive, compile, draw": "check derive compile draw",
    "Other ways to make one": "from_lagrangian from_equations from_sympy from_description",
    "Read and write": "save to_yaml",
}


def _rst(lines: list[str]) -> str:
    return "\n".join(["```{eval-rst}", *lines, "```", ""])


class ModelClass(SphinxDirective):
    """``{eomgen-model}``: the methods of the class but for those that add elements."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        groups = {heading: words.split() for heading, words in GROUPS.items()}
        named = {name for names in groups.values() for name in names}
        elements = {name for table in ELEMENTS.values() for name in table}
        public = {name for name in dir(eomgen.Model) if not name.startswith("_")}
        groups = {heading: [n for n in names if n in public] for heading, names in groups.items()}
        groups["More"] = sorted(public - named - elements)
        text = ""
        for heading, names in groups.items():
            text += f"\n## {heading}\n\n" + _rst([line for name in names for line in (_directive(name), "")])
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def _directive(name: str) -> str:
    kind = "attribute" if isinstance(getattr(eomgen.Model, name), property) else "method"
    return f".. auto{kind}:: eomgen.Model.{name}"


class ElementMethods(SphinxDirective):
    """``{eomgen-methods} SECTION``: the methods that add the elements of a section."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        lines = [line for name in ELEMENTS[self.arguments[0]] for line in (_directive(name), "")]
        return self.parse_text_to_nodes(_rst(lines), allow_section_headings=True)


class Codes(SphinxDirective):
    """``{eomgen-codes}``: every code of :mod:`eomgen.errors`, and what it means."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        table = [".. list-table::", "   :widths: 28 72", "", "   * - ``code``", "     - meaning"]
        table += [line for code, text in CODES.items() for line in (f"   * - ``{code}``", f"     - {text}")]
        return self.parse_text_to_nodes(_rst(table))


class Limits(SphinxDirective):
    """``{eomgen-limits}``: every number of files of limits, by the file it is in."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        text = ""
        for found in pkgutil.walk_packages(eomgen.__path__, "eomgen."):
            name = found.name
            if found.ispkg or "limits" not in name.split("."):
                continue
            title = " ".join(part for part in name.split(".")[1:] if part not in ("base", "limits"))
            text += f"\n### {title}\n\n" + _rst(
                [f".. automodule:: {name}", "   :members:", "   :member-order: bysource"]
            )
        return self.parse_text_to_nodes(text, allow_section_headings=True)


#: Classes that users make themselves; others come from calls, and how they are made is no matter of theirs.
MADE_BY_USERS = (
    "eomgen.Model",
    "eomgen.runtime.inputs.Signal",
    "eomgen.toolchain.compiler.Options",
    "eomgen.importers.RobotOptions",
)


def hide_construction(app: Any, what: str, name: str, found: Any, options: Any, signature: str, returns: str) -> Any:
    """Leave out the arguments with which eomgen makes its results."""
    return ("", None) if what == "class" and name not in MADE_BY_USERS else None


def drop_aliases(app: Any, what: str, name: str, found: Any, options: Any, lines: list[str]) -> None:
    """Leave out what Python says of the fields of a named tuple."""
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()


def documented_classes() -> dict[str, str]:
    """Name of a class that has a place in the reference -> its path."""
    texts = [path.read_text(encoding="utf-8") for path in (Path(__file__).parents[1] / "reference").glob("*.md")]
    paths = [path for text in texts for path in re.findall(r"autoclass:: (\S+)", text)]
    errors = {name: f"eomgen.errors.{name}" for name in eomgen.__all__ if name.endswith(("Error", "Interrupted"))}
    return {path.rpartition(".")[2]: path for path in paths} | errors


def resolve(app: Any, env: Any, node: Any, text: Any) -> Any:
    """The target of a name in a docstring, which may be relative to its file; names of the package's inside are text.

    What is neither documented nor there is left to Sphinx, which warns.
    """
    if node.get("refdomain") != "py":
        return None
    words = node["reftarget"].lstrip("~.").split(".")
    domain = env.get_domain("py")
    for tail in (".".join(words[-2:]), words[-1]):
        near = [name for name in domain.objects if name.endswith(f".{tail}")]
        own = [name for name in near if not domain.objects[name].aliased]
        if own:
            docname, anchor = domain.objects[min(own, key=len)][:2]
            return make_refnode(app.builder, node["refdoc"], docname, anchor, text, min(own, key=len))
    return text if _exists(words) else None


def _exists(words: list[str]) -> bool:
    """Whether the last word is defined in a file of the package."""
    pattern = re.compile(rf"^\s*(?:def|class) {words[-1]}\b|^{words[-1]}\b.* = ", re.MULTILINE)
    root = Path(eomgen.__file__).parent
    if (root.parent / Path(*words)).with_suffix(".py").exists():
        return True
    return any(pattern.search(path.read_text(encoding="utf-8")) for path in root.rglob("*.py"))


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("eomgen-model", ModelClass)
    app.add_directive("eomgen-methods", ElementMethods)
    app.add_directive("eomgen-codes", Codes)
    app.add_directive("eomgen-limits", Limits)
    app.connect("missing-reference", resolve)
    app.connect("autodoc-process-signature", hide_construction)
    app.connect("autodoc-process-docstring", drop_aliases, priority=100)
    return {"parallel_read_safe": True}
