"""Parts of reference pages that are made from the package: from its tables of fields, and from its command line.

``{eomgen-keys} joints`` writes a table of keys for each type of a section, ``{eomgen-verbs}`` a section for each verb,
``{eomgen-constructs} URDF`` what becomes of each element of a robot file, ``{eomgen-support}`` which calls exclude
which kinds of models.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from eomgen.cli.command import VERBS, eomgen
from eomgen.elements import kinds
from eomgen.elements.constraints import CONSTRAINTS
from eomgen.elements.element_type import Law
from eomgen.elements.forces import FORCES
from eomgen.elements.joints import JOINTS
from eomgen.elements.kinds import Field, Fields
from eomgen.importers.mjcf import MJCF
from eomgen.importers.urdf import URDF
from eomgen.importers.xml_file import ANY, INSIDE
from eomgen.model import fields as table
from eomgen.runtime.refusals import EXCLUDED, KINDS


def _cell(text: str) -> str:
    """A text in a cell of a table, letter for letter."""
    for mark in "\\|*_<>[]`$":
        text = text.replace(mark, f"\\{mark}")
    return " ".join(text.split())


def _default(field: Field) -> str:
    if field.required:
        return "needed"
    if field.default is None or field.default == () or field.default == "":
        return ""
    value = list(field.default) if isinstance(field.default, tuple) else field.default
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def keys_table(fields: Fields) -> Iterator[str]:
    """The lines of a table of keys."""
    yield from ("| key | holds | default | |", "|---|---|---|---|")
    for key, field in fields.items():
        holds = ", ".join(f"`{word}`" for word in field.choices) if field.choices else _cell(field.says)
        yield f"| `{key}` | {holds} | {_default(field)} | {_cell(field.doc)} |"
    yield ""


def _sentence(text: str) -> str:
    return _cell(f"{text[:1].upper()}{text[1:]}")


def _plain(name: str) -> Fields:
    """The keys of a section whose entries are all of one kind."""
    found: Fields = getattr(table, name, None) or getattr(kinds, name)
    return found


#: Word of the directive -> heading of each kind of entry, what it is, and its keys.
def entries(section: str) -> Iterator[tuple[str, str, Fields]]:
    """Heading, sentence and keys of each kind of entry of a section."""
    if section == "joints":
        for name, kind in JOINTS.items():
            yield name, kind.doc.partition(": ")[2], dict(kind.keys)
    elif section in ("forces", "constraints"):
        for name, kind in (FORCES if section == "forces" else CONSTRAINTS).items():
            only = f"  Give exactly one of {', '.join(kind.one_of)}." if kind.one_of else ""
            yield name, kind.doc + only, dict(kind.keys)
    elif section == "solids":
        for name in table.SOLID:
            yield name, "", {key: x for key, x in table.solid_fields(name).items() if key != "type"}
    elif section == "functions":
        for name, keys in table.FUNCTION.items():
            yield name, "", keys
    else:
        yield "", "", _plain(section)


class Keys(SphinxDirective):
    """``{eomgen-keys} SECTION``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        lines, known = list[str](), list[tuple[str, list[str]]]()
        for name, text, keys in entries(self.arguments[0]):
            lines += [f"### {name}", "", _sentence(text), ""] if name else []
            lines += keys_table(keys)
            for key, field in keys.items():
                for types, one in field.rows() if isinstance(field, Law) else ():
                    title = f"`{key}` of type {', '.join(f'`{kind}`' for kind in types)}"
                    again = (title, [*one.keys]) in known
                    lines += [f"{title}: as above.", ""] if again else [f"{title}: {_cell(one.doc)}", ""]
                    lines += () if again else keys_table(one.keys)
                    known.append((title, [*one.keys]))
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def options_table(command: click.Command) -> Iterator[str]:
    """The lines of a table of the options of a verb."""
    yield from ("| option | |", "|---|---|")
    context = click.Context(command)
    for option in command.get_params(context):
        record = option.get_help_record(context)
        if record is not None and record[1]:
            words = record[0].replace("|", "\\|")
            yield f"| `{words}` | {_cell(record[1])} |"
    yield ""


class Verbs(SphinxDirective):
    """``{eomgen-verbs}``."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        lines: list[str] = []
        for name in VERBS:
            command = eomgen.get_command(click.Context(eomgen), name)
            assert command is not None
            lines += self._verb(f"eomgen {name}", command)
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)

    def _verb(self, name: str, command: click.Command) -> Iterator[str]:
        context = click.Context(command, info_name=name)
        usage = command.get_usage(context).partition(": ")[2]
        yield from (f"## {name}", "", "```text", " ".join(usage.split()), "```", "")
        for part in (command.help or "").replace("\b", "").split("\n\n"):
            yield from (_cell(part), "")
        yield from options_table(command)


class Constructs(SphinxDirective):
    """``{eomgen-constructs} URDF``: what becomes of elements and attributes, by its reason."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        groups: dict[tuple[str, str], list[str]] = {}
        for element, rows in {"URDF": URDF, "MJCF": MJCF}[self.arguments[0]].rows.items():
            for row in rows:
                names = {INSIDE: "and all inside", ANY: "any attribute"}
                attributes = " ".join(names.get(name, name) for name in row.attributes)
                groups.setdefault((row.fate, row.why), []).append(f"`{element}` {_cell(attributes)}".strip())
        lines = ["| | | elements and attributes |", "|---|---|---|"]
        lines += [f"| {fate} | {why} | {'; '.join(found)} |" for (fate, why), found in groups.items()]
        return self.parse_text_to_nodes("\n".join(lines))


def support_table() -> Iterator[str]:
    """The lines of a table of calls and the kinds of models that each excludes, and of what is said instead."""
    yield from ("| call | not for models with |", "|---|---|")
    for call, excluded in EXCLUDED.items():
        yield f"| `{call}` | {_cell('; '.join(KINDS[kind].about for kind in excluded))} |"
    yield from ("", "| models with | message, with what to do instead |", "|---|---|")
    for kind in KINDS.values():
        message = kind.message.format(call="the call", model="NAME", names="the names")
        yield f"| {_cell(kind.about)} | {_cell(message)} |"
    yield ""


class Support(SphinxDirective):
    """``{eomgen-support}``."""

    def run(self) -> list[nodes.Node]:
        """The nodes in place of the directive."""
        return self.parse_text_to_nodes("\n".join(support_table()), allow_section_headings=False)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("eomgen-constructs", Constructs)
    app.add_directive("eomgen-keys", Keys)
    app.add_directive("eomgen-support", Support)
    app.add_directive("eomgen-verbs", Verbs)
    return {"parallel_read_safe": True}
