"""Stage cli, examples: the models shipped with eomgen -> a list, or a copy of one in the current folder."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import click

from ..errors import UsageError
from ..files.writing import write_whole
from ..suggestions import hint
from ..syntax_trees import parse_module
from .example_files import example_files
from .failures import reports_failures
from .screen import print_json, print_table, say
from .sections import verb_command
from .shared_options import json_option


def describe_example(file: Path) -> str:
    """The ``doc:`` line of a model file, the first comment of a robot, or the first line of a script's docstring."""
    text = file.read_text(encoding="utf-8")
    if file.name.endswith(".py"):
        return (ast.get_docstring(parse_module(text)) or "").split("\n", 1)[0]
    if file.name.endswith(".urdf"):
        comment = re.search(r"<!--(.*?)-->", text, re.DOTALL)
        return " ".join(comment.group(1).split()) if comment else ""
    found = re.search(r"^doc:\s*(.+)$", text, re.MULTILINE)
    return found.group(1).strip().strip('"') if found else ""


@verb_command()
@click.argument("name", required=False)
@click.option("--force", is_flag=True, help="Overwrite a file of that name.")
@json_option
@reports_failures
def examples(name: str | None, force: bool, as_json: bool) -> None:
    """List the example models, or copy NAME into the current folder."""
    found = example_files()
    if name is None:
        rows = [(key, file.name, describe_example(file)) for key, file in found.items()]
        if as_json:
            print_json({"examples": [{"name": key, "file": file, "doc": doc} for key, file, doc in rows]})
            return
        print_table(["example", "what it is"], [[key, doc] for key, _, doc in rows])
        say("copy one here:  eomgen examples NAME")
        return
    target = _copy(name, found, force)
    if as_json:
        print_json({"file": str(target)})
        return
    say(str(target))
    say(f"next:  {'python' if target.suffix == '.py' else 'eomgen run'} {target}", err=True)


def _copy(name: str, found: dict[str, Path], force: bool) -> Path:
    file = found.get(name) or found.get(name.removesuffix(".yaml")) or found.get(f"{name}.urdf")
    if file is None:
        near = hint(name, found, quoted=False) or f"there are: {', '.join(found)}"
        raise UsageError(f"no example {name!r}; {near}")
    target = Path(file.name)
    if target.exists() and not force:
        raise UsageError(f"{target} exists; add --force to overwrite it")
    write_whole(target, file.read_bytes())
    return target
