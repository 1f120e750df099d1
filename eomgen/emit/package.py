"""Stage emit: Program -> a package that stands alone: C library, or Python package with a compiled or a NumPy core."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from typing import Any

from ..errors import UsageError
from ..layer import read_layer
from ..program import Program
from ..texts import summary_text
from .c import emit_c
from .calls import describe_calls
from .layouts import describe_layouts
from .numpy import emit_numpy
from .sources import SourceSet, render

#: Annotated attributes of the package, all of its default module.
ANNOTATED: tuple[tuple[str, str], ...] = (
    *((name, "Timed") for name in ("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian")),
    *((name, "State") for name in ("mass_matrix", "embedded_mass_matrix", "energy", "project", "poses")),
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
ANALYSES = (*MOTIONS, "linearize", "modes", "equilibrium", "sensitivities", *FORCES)
#: Files of verification/ that need no equations.
VERIFICATION = (
    *("__init__.py", "cases.py", "comparison.py", "differences.py", "finding.py"),
    *("identities.py", "jacobians.py", "recorded.py", "selftest.py", "verify.py"),
)
#: Files of api/ that need no equations.
FACADE = ("__init__.py", "module.py")
#: Files of the other folders that no package needs: of eomgen's own cache, and of files of robots.
ELSEWHERE = frozenset({"files/kept.py", "files/locks.py", "limits/files.py"})
PICTURES = ("draw", "draw_branches")
METHODS = ("x0", "assemble", "kinematics", "bind", "simulate", "simulate_many", "step", "verify", *PICTURES, *ANALYSES)


def emit_package(program: Program, target: str) -> SourceSet:
    """All files of an exported package, relative to its own folder.

    Parameters
    ----------
    program : Program
    target : {'cython', 'numpy', 'c'}

    Returns
    -------
    SourceSet
        ``c``: sources, header, Makefile, README.md.  ``cython`` and ``numpy``: a Python package whose root is the
        folder itself, with pyproject.toml; installs with pip, needs NumPy alone.

    Raises
    ------
    UsageError
        An unknown target.
    """
    makers: dict[str, Callable[[Program], dict[str, str]]] = {"cython": _cython, "numpy": _numpy, "c": _c_library}
    if target not in makers:
        raise UsageError(f"no target {target!r}; there are {', '.join(makers)}")
    return SourceSet(makers[target](replace(program, metadata={**program.metadata, "target": target})))


def _cython(program: Program) -> dict[str, str]:
    sources = emit_c(program)
    written = (*sources, *read_layer())
    context = _context(program) | {
        "c_files": [name for name in written if name.endswith(".c")],
        "headers": [name for name in written if name.endswith((".h", ".pxi"))],
    }
    return {
        **sources,
        **read_layer(),
        "setup.py": render("python/setup.py.j2", context),
        **_python_files(context),
        **_runtime_files(),
    }


def _numpy(program: Program) -> dict[str, str]:
    return {**emit_numpy(program, bundled=True), **_python_files(_context(program)), **_runtime_files()}


def _c_library(program: Program) -> dict[str, str]:
    sources = emit_c(program)
    c_files = [name for name in sources if name.endswith(".c")]
    objects = [name.removesuffix(".c") + ".o" for name in c_files]
    context = _context(program) | {"c_files": c_files, "object_files": objects}
    return {
        **sources,
        "Makefile": render("c/Makefile.j2", context),
        "README.md": render("c/README.md.j2", context),
    }


def _python_files(context: dict[str, Any]) -> dict[str, str]:
    names = ("__init__.py", "__init__.pyi", "selftest.py", "pyproject.toml", "README.md")
    return {"py.typed": "", **{name: render(f"python/{name}.j2", context) for name in names}}


def _runtime_files() -> dict[str, str]:
    """Files of eomgen as they are: of its root, of limits/ to ensembles/ but ELSEWHERE, and of verification/."""
    root = files("eomgen")
    found = {name: (root / name).read_text(encoding="utf-8") for name in ("errors.py", "kernel_table.py", "texts.py")}
    for folder in ("limits", "files", "numeric", "runtime", "analysis", "simulation", "ensembles"):
        for item in sorted((root / folder).iterdir(), key=lambda item: item.name):
            if item.name.endswith(".py") and f"{folder}/{item.name}" not in ELSEWHERE:
                found[f"{folder}/{item.name}"] = item.read_text(encoding="utf-8")
    for name in FACADE:
        found[f"api/{name}"] = (root / "api" / name).read_text(encoding="utf-8")
    for name in VERIFICATION:
        found[f"verification/{name}"] = (root / "verification" / name).read_text(encoding="utf-8")
    return found


def _context(program: Program) -> dict[str, Any]:
    metadata = program.metadata
    doc = str(metadata.get("doc") or "").strip()
    q = list(metadata.get("q_reference") or [0.0] * program.sizes.n_q)
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "doc": doc,
        "description": summary_text(doc.splitlines()[0] if doc else f"Equations of motion of {program.name}"),
        "target": metadata["target"],
        "compiled": metadata["target"] == "cython",
        "metadata": metadata,
        "layouts": describe_layouts(program),
        "calls": describe_calls(program),
        "attributes": [*(name for name, _ in ANNOTATED), *METHODS],
        "annotations": ANNOTATED,
        "methods": METHODS,
        "p_values": _numbers(metadata.get("p_values")),
        "u_values": _numbers(metadata.get("u_values")),
        "x_values": _numbers([*q, *[0.0] * program.sizes.n_v]),
    }


def _numbers(values: Any) -> str:
    """Numbers as the inside of a C initialiser; a value that is not given becomes 0."""
    return ", ".join(json.dumps(0.0 if x is None else float(x)) for x in values or ()) or "0.0"
