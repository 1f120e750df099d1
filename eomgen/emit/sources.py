"""Stage emit: what the stage hands on: relative file names and their text, and how templates become text."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from ..base import texts
from ..base.files import Kept, shipped
from ..program import Program

if TYPE_CHECKING:
    from jinja2 import Environment


class SourceSet(Mapping[str, str]):
    """Frozen mapping of relative file name (with ``/``) to text."""

    def __init__(self, files: Mapping[str, str]) -> None:
        self._files = dict(files)

    def __getitem__(self, name: str) -> str:
        return self._files[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)

    def __repr__(self) -> str:
        return f"SourceSet({', '.join(f'{name} ({len(text)})' for name, text in self._files.items())})"


@cache
def environment() -> Environment:
    """The template environment: undefined names are errors."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    made = Environment(
        loader=FileSystemLoader([shipped("templates"), shipped("native")]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    made.filters |= {
        "comment": texts.comment_text,
        "comment_lines": texts.comment_lines,
        "docstring": texts.docstring_text,
        "toml": texts.toml_text,
        "markdown": texts.markdown_text,
        "code": texts.markdown_code,
        "listing": lambda names: repr(tuple(names)),
    }
    return made


def keep_bytecode(kept: Kept) -> None:
    """Keep what Jinja makes of templates in a folder of the user's own; Jinja knows when a template has changed."""
    from jinja2 import BytecodeCache
    from jinja2.bccache import Bucket

    class Bytecode(BytecodeCache):
        def load_bytecode(self, bucket: Bucket) -> None:
            data = kept.read(bucket.key)
            if data is not None:
                bucket.bytecode_from_string(data)

        def dump_bytecode(self, bucket: Bucket) -> None:
            kept.write(bucket.key, bucket.bytecode_to_string())

    environment().bytecode_cache = Bytecode()


def render(template: str, context: Mapping[str, Any]) -> str:
    """The text of a template with one context."""
    return environment().get_template(template).render(context)


@cache
def read_template(name: str) -> str:
    """A file of the templates folder as it is."""
    made = environment()
    assert made.loader is not None
    return made.loader.get_source(made, name)[0]


def metadata_json(program: Program) -> str:
    """The text of model.json."""
    return json.dumps(program.metadata, indent=1, allow_nan=False) + "\n"


def number_texts(values: Iterable[float | None] | None) -> str:
    """Numbers as the inside of a C initialiser; a value that is not given becomes 0."""
    return ", ".join(json.dumps(0.0 if x is None else float(x)) for x in values or ()) or "0.0"
