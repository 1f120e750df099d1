"""What the files of all targets share: names and texts, templates, start values, layouts, provenance."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.files import shipped
from ..errors import EomgenError, bad_file
from ..expr import texts
from ..expr.evaluate import Evaluator
from ..toolchain.trusted_files import Kept
from .program import Program

if TYPE_CHECKING:
    from jinja2 import Environment


#: Texts by relative file name (with ``/``).
SourceSet = dict[str, str]


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


def own_file(directory: Path, name: str, ours: Callable[[Path], bool]) -> Path:
    """The place of a file in a folder that is made. Raises UsageError (there is one that eomgen did not write)."""
    where = directory / name
    if os.path.lexists(where) and not ours(where):
        raise bad_file(f"{where} exists and was not written by eomgen; move it, or choose another --out")
    directory.mkdir(parents=True, exist_ok=True)
    return where


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


RATE = 1.0  #: of an independent coordinate whose initial rate is not declared (m/s or rad/s)


def example_state(program: Program) -> list[float]:
    """x where the model starts, if the program knows it; else the declared position, and velocities as loops ask.

    Independent velocities are those declared, or RATE.
    """
    metadata, sizes = program.metadata, program.sizes
    if "start" in metadata:
        return list(metadata["start"])
    q = [float(x) for x in metadata.get("q_reference") or [0.0] * sizes.n_q]
    declared = metadata.get("initial", {})
    independent = list(metadata.get("independent", range(sizes.n_v)))
    v = np.zeros(sizes.n_v)
    v[independent] = [declared.get(program.velocities[k]) or RATE for k in independent]
    dependent = [k for k in range(sizes.n_v) if k not in independent]
    if dependent:
        v[dependent] = _followed(program, q, v, dependent)
    return [*q, *v.tolist()]


def _followed(program: Program, q: list[float], v: Array, dependent: list[int]) -> Array:
    """The dependent velocities with which J v + C_t = 0; 0 where the values of parameters do not let them be found."""
    none = np.zeros(len(dependent))
    rows = [y for block in program.blocks if block.name == "velocity_constraints" for y in block.outputs]
    values = [program.metadata[key] for key in ("p_values", "u_values")]
    if not rows or any(x is None for row in values for x in row):
        return none
    names = [*program.coordinates, *program.velocities, *program.parameters, *program.inputs, program.time]
    try:
        evaluate = Evaluator(rows, names)

        def residual(change: Array) -> Array:
            return np.array(evaluate([*q, *(v + change), *values[0], *values[1], 0.0]), dtype=float)

        units = np.eye(len(v))[dependent]
        start = residual(np.zeros(len(v)))
        slopes = np.array([residual(unit) - start for unit in units]).T
        result = algebra.lstsq(slopes, -start)
    except (EomgenError, ArithmeticError, np.linalg.LinAlgError):
        return none
    return result if np.isfinite(result).all() else none


def describe_layouts(program: Program) -> list[tuple[str, list[str]]]:
    """Titles with one line per entry, for headers and docstrings."""
    metadata = program.metadata
    q, v = program.coordinates, program.velocities
    moving = len(v) - program.n_states
    preferred = [i for i in program.preferred if i < moving]
    chosen = [program.coordinate_of[i] for i in preferred]
    independent = ("q_i, the independent coordinates", _entries(metadata, "q_i", [q[i] for i in chosen]))
    if -1 in chosen:
        independent = ("v_i, the independent velocities", _entries(metadata, "v_i", [v[i] for i in preferred]))
    sections = [
        (f"x = [q; v{'; s' if program.n_states else ''}], the state", _entries(metadata, "x", [*q, *v])),
        ("p, the parameters", _entries(metadata, "p", program.parameters, metadata.get("p_values"))),
        ("u, the inputs", _entries(metadata, "u", program.inputs, metadata.get("u_values"))),
        ("y, the outputs", _entries(metadata, "y", metadata.get("y_names", ()))),
        independent,
        ("C, the constraint rows", _entries(metadata, "C", metadata.get("constraint_labels", ()))),
        ("bodies of poses", _entries(metadata, "poses", metadata.get("body_names", ()))),
        ("coordinates of cut joints", _entries(metadata, "loop", metadata.get("loop_names", ()))),
    ]
    independent_is_all = program.sizes.n_dof == program.sizes.n_v
    return [(title, rows) for title, rows in sections if rows and not (independent_is_all and title == independent[0])]


def _entries(
    metadata: dict[str, Any], array: str, names: Sequence[str], values: Sequence[float | None] | None = None
) -> list[str]:
    units, docs = metadata.get("units", {}), metadata.get("docs", {})
    lines = []
    for k, name in enumerate(names):
        line = f"{array}[{k}] {name}"
        if values is not None and values[k] is not None:
            line += f" = {values[k]!r}"
        if units.get(name):
            line += f" ({units[name]})"
        if docs.get(name):
            line += f": {docs[name]}"
        lines.append(" ".join(line.split()))
    return lines


#: Packages whose versions are told: what derived the equations and wrote the text.
USED = ("numpy", "sympy")


def trace_provenance(program: Program, target: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Where a package comes from.

    ``model``, ``model_digest`` (SHA-256 of the mechanism, the same for all methods and targets), ``options`` of the
    generation that change the equations or the numbers (``method`` as it was chosen), ``versions``.
    """
    facts = program.metadata
    result = {name: metadata.version(name) for name in USED}
    return {
        "model": program.name,
        "model_digest": facts.get("model_digest"),
        "options": {"method": facts.get("method"), "target": target, **options},
        "versions": {"eomgen": facts.get("eomgen"), "python": platform.python_version(), **result},
    }
