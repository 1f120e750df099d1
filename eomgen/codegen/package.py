"""Program -> a package that stands alone: C library, or Python package with a compiled core."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Any

from ..base.texts import summary_text
from ..errors import UsageError, cannot, no_choice
from ..layer import read_native
from ..runtime.layout import Layout
from ..targets import PRECISIONS, find_target
from .c import emit_c
from .c_lanes import DERIVATIVES
from .files import SourceSet, describe_layouts, metadata_json, number_texts, render, trace_provenance
from .program import Program
from .python_calls import describe_calls

#: Annotated attributes of the package, all of its default module.
ANNOTATED: tuple[tuple[str, str], ...] = (
    *((name, "Timed") for name in ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian")),
    *((name, "State") for name in ("mass_matrix", "embedded_mass_matrix", "energy", "poses")),
    ("project", "Projection"),
    *((name, "State") for name in ("center_of_mass", "com_jacobian", "momentum", "centroidal_inertia")),
    ("inverse_dynamics", "Motion"),
    *((name, "Rows") for name in ("constraints", "constraint_jacobian", "velocity_constraints")),
    *((name, "tuple[str, ...]") for name in
      ("q_names", "v_names", "x_names", "u_names", "p_names", "y_names", "body_names", "loop_names",
       "joint_names", "constraint_labels")),
    *((name, "int") for name in ("n_q", "n_v", "n_x", "n_u", "n_p", "n_y", "n_c", "n_dof", "n_bodies")),
    ("metadata", "dict[str, object]"),
)  # fmt: skip
#: Calls of every package, and those of one with analyses.
METHODS = ("x0", "assemble", "kinematics", "bind", "simulate", "simulate_many", "step", *DERIVATIVES, "sensitivities",
           "kinematic_analysis", "multipliers", "impact", "simulate_impacts")  # fmt: skip
ANALYSES = ("motion_range", "linearize", "modes", "equilibrium", "reactions", "undetermined_reactions",
            "driving_forces", "actuator_forces", "consistent")  # fmt: skip
#: What packages in Python carry of eomgen, unchanged: whatever runs need, and the analyses if asked for.
CARRIED = ("errors.py", "module.py", "base", "numeric", "runtime", "simulation", "ensembles")
CARRIED_ANALYSES = ("analysis", "identification")

#: Files of every package.
ABOUT = ("LICENSE.txt", "PROVENANCE.md")


def emit_package(
    program: Program,
    target: str,
    precision: str = "double",
    asked: Mapping[str, Any] | None = None,
    analyses: bool = False,
) -> SourceSet:
    """All files of an exported package, relative to its own folder.

    Parameters
    ----------
    program : Program
    target : {'cython', 'c'}
    precision : {'double', 'float'}, optional
        Of the numbers of a ``c`` library.
    asked : mapping of str to object, optional
        Further options of the generation, for the provenance.
    analyses : bool, optional
        Whether a Python package carries the analyses too.

    Returns
    -------
    SourceSet
        ``c``: sources, header, Makefile, README.md.  ``cython``: a Python package whose root is the
        folder itself, with pyproject.toml; installs with pip, needs NumPy alone.

    Raises
    ------
    UsageError
        An unknown target or precision, ``float`` for another target than ``c``, analyses for one that is not Python.
    """
    row = find_target(target)
    if row.whole:
        raise cannot(f"target {target!r} makes one file, not a package; use generate")
    if precision not in PRECISIONS:
        raise no_choice(f"no precision {precision!r}; there are {', '.join(PRECISIONS)}")
    if precision != "double" and not row.precisions:
        raise cannot(f"precision={precision!r} is for target c; packages of target {target} compute in double")
    made = {"target": target, "provenance": trace_provenance(program, target, asked or {})}
    program = replace(program, metadata={**program.metadata, **made})
    if analyses and not row.module:
        raise cannot(f"analyses are for Python packages; target {target} is none")
    context = _context(program, analyses) | {"precision": precision}
    about = {name: render(f"python/{name}.j2", context) for name in ABOUT}
    return SourceSet({"model.json": metadata_json(program), **about, **row.files(program, context)})


def cython_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Sources in C and Cython, what builds them, and what of eomgen they need."""
    sources = emit_c(program)
    written = {**sources, **read_native()}
    context |= {
        "c_files": [name for name in written if name.endswith(".c")],
        "headers": [name for name in written if name.endswith((".h", ".pxi"))],
    }
    return {
        **written,
        "setup.py": render("python/setup.py.j2", context),
        **_python_files(context),
    }


def _python_files(context: dict[str, Any]) -> dict[str, str]:
    """What is generated in Python besides the core, and what is carried of eomgen."""
    carried = carry((*CARRIED, *(CARRIED_ANALYSES if context["analyses"] else ())))
    names = ("__init__.py", "__init__.pyi", "selftest.py", "pyproject.toml", "README.md", "tests/test_recorded.py")
    own = {name: render(f"python/{name}.j2", context | {"folders": folders_of(carried)}) for name in names}
    return {"py.typed": "", **own, **carried}


def carry(names: Iterable[str]) -> dict[str, str]:
    """Files and whole folders of eomgen, as they are, by their place in a package."""
    root = Path(__file__).parents[1]
    files = [
        file for name in names for file in ([root / name] if name.endswith(".py") else (root / name).rglob("*.py"))
    ]
    return {file.relative_to(root).as_posix(): file.read_text(encoding="utf-8") for file in sorted(files)}


def folders_of(carried: Iterable[str]) -> list[str]:
    """The packages within a package that its files lie in."""
    return sorted({name.rpartition("/")[0].replace("/", ".") for name in carried if "/" in name})


def _forms(metadata: Mapping[str, Any]) -> tuple[str, ...]:
    """Other forms of the equations that the default module has."""
    found = ["dae"]
    with suppress(UsageError):
        Layout(metadata).require_minimal_form()
        found.insert(0, "minimal")
    return (*found, *(["canonical"] if metadata.get("method") == "hamilton" else []))


def _context(program: Program, analyses: bool) -> dict[str, Any]:
    metadata = program.metadata
    doc = str(metadata.get("doc") or "").strip()
    methods = METHODS + (ANALYSES if analyses else ())
    attributes, forms = [*(name for name, _ in ANNOTATED), *methods], _forms(metadata)
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "doc": doc,
        "description": summary_text(doc.splitlines()[0] if doc else f"Equations of motion of {program.name}"),
        "target": metadata["target"],
        "metadata": metadata,
        "provenance": metadata["provenance"],
        "layouts": describe_layouts(program),
        "calls": [call for call in describe_calls(program) if call.name not in ANALYSES or analyses],
        "attributes": attributes,
        "listed": fill(", ".join(f'"{name}"' for name in (*attributes, *forms)), 110).splitlines(),
        "annotations": ANNOTATED,
        "forms": forms,
        "methods": methods,
        "analyses": analyses,
        "p_values": number_texts(metadata.get("p_values")),
        "u_values": number_texts(metadata.get("u_values")),
    }
