"""Stage emit: Program -> a package that stands alone: C library, or Python package with a compiled or a NumPy core."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from textwrap import fill
from typing import Any

from ..base.texts import summary_text
from ..errors import UsageError, cannot, no_choice
from ..layer import read_layer
from ..program import Program
from ..runtime.layout import Layout
from ..targets import PRECISIONS, find_target
from .c import emit_c
from .c_lanes import DERIVATIVES
from .carried import carry
from .layouts import describe_layouts
from .numpy import emit_numpy
from .provenance import trace_provenance
from .python_calls import describe_calls
from .sources import SourceSet, metadata_json, number_texts, render

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
FORCES = ("multipliers", "reactions", "undetermined_reactions", "driving_forces", "actuator_forces", "impact",
          "simulate_impacts", "consistent")  # fmt: skip
MOTIONS = ("kinematic_analysis", "motion_range", "workspace")
ANALYSES = (*MOTIONS, *DERIVATIVES, "linearize", "modes", "equilibrium", "sensitivities", *FORCES)
PICTURES = ("draw", "draw_branches")
METHODS = ("x0", "assemble", "kinematics", "bind", "simulate", "simulate_many", "step", "verify", *PICTURES, *ANALYSES)

#: Files of every package.
ABOUT = ("LICENSE.txt", "PROVENANCE.md")


def emit_package(
    program: Program, target: str, precision: str = "double", asked: Mapping[str, Any] | None = None
) -> SourceSet:
    """All files of an exported package, relative to its own folder.

    Parameters
    ----------
    program : Program
    target : {'cython', 'numpy', 'c'}
    precision : {'double', 'float'}, optional
        Of the numbers of a ``c`` library.
    asked : mapping of str to object, optional
        Further options of the generation, for the provenance.

    Returns
    -------
    SourceSet
        ``c``: sources, header, Makefile, README.md.  ``cython`` and ``numpy``: a Python package whose root is the
        folder itself, with pyproject.toml; installs with pip, needs NumPy alone.

    Raises
    ------
    UsageError
        An unknown target or precision, or ``float`` for another target than ``c``.
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
    context = _context(program) | {"precision": precision}
    about = {name: render(f"python/{name}.j2", context) for name in ABOUT}
    return SourceSet({"model.json": metadata_json(program), **about, **row.files(program, context)})


def cython_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Sources in C and Cython, what builds them, and what of eomgen they need."""
    sources = emit_c(program)
    written = (*sources, *read_layer())
    context |= {
        "c_files": [name for name in written if name.endswith(".c")],
        "headers": [name for name in written if name.endswith((".h", ".pxi"))],
    }
    return {
        **sources,
        **read_layer(),
        "setup.py": render("python/setup.py.j2", context),
        **_python_files(context, {}),
    }


def numpy_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Functions of NumPy arrays, and what of eomgen they need."""
    own = emit_numpy(program, bundled=True)
    return {**own, **_python_files(context, own)}


def _python_files(context: dict[str, Any], core: Mapping[str, str]) -> dict[str, str]:
    """What is generated in Python besides the core, and all of eomgen that it needs."""
    names = ("__init__.py", "__init__.pyi", "selftest.py")
    own = {name: render(f"python/{name}.j2", context) for name in names}
    found = carry({**core, **own})
    context = context | {
        "folders": sorted({name.rpartition("/")[0].replace("/", ".") for name in found if "/" in name})
    }
    names = ("pyproject.toml", "README.md", "tests/test_recorded.py")
    about = {name: render(f"python/{name}.j2", context) for name in names}
    return {"py.typed": "", **own, **about, **found}


def _forms(metadata: Mapping[str, Any]) -> tuple[str, ...]:
    """Other forms of the equations that the default module has."""
    found = ["dae"]
    with suppress(UsageError):
        Layout(metadata).require_minimal_form()
        found.insert(0, "minimal")
    return (*found, *(["canonical"] if metadata.get("method") == "hamilton" else []))


def _context(program: Program) -> dict[str, Any]:
    metadata = program.metadata
    doc = str(metadata.get("doc") or "").strip()
    attributes, forms = [*(name for name, _ in ANNOTATED), *METHODS], _forms(metadata)
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "doc": doc,
        "description": summary_text(doc.splitlines()[0] if doc else f"Equations of motion of {program.name}"),
        "target": metadata["target"],
        "compiled": metadata["target"] == "cython",
        "metadata": metadata,
        "provenance": metadata["provenance"],
        "layouts": describe_layouts(program),
        "calls": describe_calls(program),
        "attributes": attributes,
        "listed": fill(", ".join(f'"{name}"' for name in (*attributes, *forms)), 110).splitlines(),
        "annotations": ANNOTATED,
        "forms": forms,
        "methods": METHODS,
        "p_values": number_texts(metadata.get("p_values")),
        "u_values": number_texts(metadata.get("u_values")),
    }
