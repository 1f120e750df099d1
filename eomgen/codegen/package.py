"""Program -> a package that stands alone, C library or Python package with a compiled core, in a folder."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

from ..base.files import open_plain, refuse_link
from ..base.texts import one_line, shortened
from ..errors import UsageError, bad_file, cannot, no_choice
from ..expr.notation import Notation
from ..runtime.layout import Layout, ModelInfo
from ..runtime.trajectory import column_names
from ..toolchain.layer import read_native
from ..toolchain.targets import PRECISIONS, find_target
from .c import emit_c
from .c_lanes import DERIVATIVES
from .files import SourceSet, describe_layouts, metadata_json, number_texts, render, trace_provenance
from .program import Program

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
METHODS = ("x0", "assemble", "kinematics", "bind", "simulate", "simulate_many", "step", *DERIVATIVES, "multipliers")
ANALYSES = ("sensitivities", "kinematic_analysis", "motion_range", "impact", "simulate_impacts", "linearize", "modes",
            "equilibrium", "reactions", "undetermined_reactions", "driving_forces", "actuator_forces",
            "consistent")  # fmt: skip
#: What packages in Python carry of eomgen, unchanged.
CONTENTS = ("errors.py", "module.py", "base", "runtime", "analysis")
#: Of these the folders that not every package has, whole or not at all -> when: by its model, its target, --analyses.
OPTIONAL: dict[str, Callable[[ModelInfo, str, bool], bool]] = {
    "analysis/": lambda info, target, analyses: analyses,
    "runtime/device.py": lambda info, target, analyses: target == "cuda",
    "runtime/impacts/": lambda info, target, analyses: (
        analyses or bool(info.rigid_contacts) or any(event.get("restitution") is not None for event in info.events)
    ),
    "runtime/prescribed/": lambda info, target, analyses: analyses or not info.sizes.n_dof,
}


def emit_package(
    program: Program,
    target: str,
    precision: str = "double",
    options: Mapping[str, Any] | None = None,
    analyses: bool = False,
) -> SourceSet:
    """All files of an exported package, relative to its own folder.

    ``c``: sources, header, Makefile, README.md.  ``cython``: a Python package whose root is the folder itself, with
    pyproject.toml; installs with pip, needs NumPy alone.  ``options`` are further options of the generation, for the
    provenance.  Raises UsageError (an unknown target or precision, ``float`` for another target than ``c``, analyses
    for one that is not Python).
    """
    row = find_target(target)
    if row.whole:
        raise cannot(f"target {target!r} makes one file, not a package; use generate")
    if precision not in PRECISIONS:
        raise no_choice(f"no precision {precision!r}; there are {', '.join(PRECISIONS)}")
    if precision != "double" and not row.precisions:
        raise cannot(f"precision={precision!r} is for target c; packages of target {target} compute in double")
    made = {"target": target, "provenance": trace_provenance(program, target, options or {})}
    if row.module:
        made["printed"] = print_names(program.metadata)
    program = replace(program, metadata={**program.metadata, **made})
    if analyses and not row.module:
        raise cannot(f"analyses are for Python packages; target {target} is none")
    context = _context(program, analyses) | {"precision": precision}
    files = {"LICENSE.txt": render("python/LICENSE.txt.j2", context), **row.files(program, context)}
    files["README.md"] += render("python/provenance.md.j2", context)
    return SourceSet({"model.json": metadata_json(program), **files})


def print_names(metadata: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """How names are printed where that is not as they are: for Matplotlib, and in HTML."""
    layout, notation = Layout(metadata), Notation.of(metadata)
    turning = layout.info.joint_names if layout.quaternion_slots else ()
    turns = (f"{joint}_r{axis}" for joint in turning for axis in "xyz")  # small rotations, in modes
    names = ("t", *column_names(layout), *layout.p, *layout.velocity_labels, *turns)
    forms = {"mathtext": notation.mathtext, "html": notation.html}
    return {form: {name: of(name) for name in names if of(name) != name} for form, of in forms.items()}


def cython_package(program: Program, context: dict[str, Any]) -> dict[str, str]:
    """Sources in C and Cython, what builds them, and what of eomgen they need."""
    sources = emit_c(program)
    written = {**sources, **read_native()}
    context |= {
        "c_files": [name for name in written if name.endswith(".c")],
        "headers": [name for name in written if name.endswith(".h")],
    }
    return {
        **written,
        "setup.py": render("python/setup.py.j2", context),
        **_python_files(context),
    }


def _python_files(context: dict[str, Any]) -> dict[str, str]:
    """What is generated in Python besides the core, and what is carried of eomgen."""
    included = include(CONTENTS, context["metadata"], context["analyses"])
    names = ("__init__.py", "__init__.pyi", "selftest.py", "pyproject.toml", "README.md", "tests/test_recorded.py")
    context = context | {"folders": folders_of(included), "compiled": True}
    return {"py.typed": "", **{name: render(f"python/{name}.j2", context) for name in names}, **included}


def include(names: Iterable[str], metadata: Mapping[str, Any], analyses: bool = False) -> dict[str, str]:
    """Files and whole folders of eomgen, as they are, by their place in a package; of :data:`OPTIONAL` what is used."""
    root, info = Path(__file__).parents[1], ModelInfo.of(metadata)
    left_out = tuple(folder for folder, used in OPTIONAL.items() if not used(info, metadata["target"], analyses))
    files = [
        file for name in names for file in ([root / name] if name.endswith(".py") else (root / name).rglob("*.py"))
    ]
    included = {file.relative_to(root).as_posix(): file for file in sorted(files)}
    return {name: file.read_text(encoding="utf-8") for name, file in included.items() if not name.startswith(left_out)}


def folders_of(included: Iterable[str]) -> list[str]:
    """The packages within a package that its files lie in."""
    return sorted({name.rpartition("/")[0].replace("/", ".") for name in included if "/" in name})


def _forms(metadata: Mapping[str, Any]) -> tuple[str, ...]:
    """Other forms of the equations that the default module has."""
    collected = ["dae"]
    with suppress(UsageError):
        Layout(metadata).require_minimal_form()
        collected.insert(0, "minimal")
    return (*collected, *(["canonical"] if metadata.get("method") == "hamilton" else []))


def _context(program: Program, analyses: bool) -> dict[str, Any]:
    metadata = program.metadata
    doc = str(metadata.get("doc") or "").strip()
    methods = METHODS + (ANALYSES if analyses else ())
    attributes, forms = [*(name for name, _ in ANNOTATED), *methods], _forms(metadata)
    return {
        "name": program.name,
        "prefix": program.name.upper(),
        "doc": doc,
        "description": shortened(one_line((doc or f"Equations of motion of {program.name}").splitlines()[0]), 500),
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
        "folders": (),
        "compiled": False,
        "requirements": ("numpy>=2.0",),
        "p_values": number_texts(metadata.get("p_values")),
        "u_values": number_texts(metadata.get("u_values")),
    }


MANIFEST = "model.json"  #: lists the files of the package under "files"


def write_package(sources: Mapping[str, str], folder: Path) -> Path:
    """Write a package, texts by relative name, into a folder, so that no file is ever half there; returns the folder.

    Files of an earlier generation that are not part of this one are removed; others are left alone.  Raises UsageError
    (the folder holds something else, or a file in the way that eomgen did not write; it, or one in it that files go to,
    is a symbolic link).
    """
    _refuse_links(folder, sources)
    earlier = _earlier_files(folder)
    for name in sources:
        if earlier is not None and name not in earlier and os.path.lexists(folder / name):
            raise bad_file(f"{folder / name} exists and was not written by eomgen; move it, or choose another --out")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as private:
        stage = Path(private) / folder.name
        try:
            for name, text in {**sources, MANIFEST: _with_files(sources)}.items():
                (stage / name).parent.mkdir(parents=True, exist_ok=True)
                (stage / name).write_text(text, encoding="utf-8")
        except OSError as error:  # most often a full disk; nothing is in its place yet
            raise OSError(error.errno, error.strerror, str(folder)) from error
        if not folder.exists():
            os.rename(stage, folder)
            return folder
        for name in sorted(sources, key=lambda name: name == MANIFEST):  # the list of files last
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            _refuse_links(folder, (name,))
            os.replace(stage / name, folder / name)
    for name in sorted((earlier or set()) - set(sources)):
        _remove(folder, name)
    return folder


def _refuse_links(folder: Path, names: Iterable[str]) -> None:
    """Refuse links that lead elsewhere: the folder itself, and those in it that files go to.

    A link in the place of a file needs no refusal: the file replaces it.
    """
    refuse_link(folder)
    inner = {parent for name in names for parent in Path(name).parents if parent.name}
    for path in sorted(inner):
        refuse_link(folder / path)


def _earlier_files(folder: Path) -> set[str] | None:
    """Files that eomgen wrote here; None if it kept no list."""
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return set()
    try:
        with open_plain(folder / MANIFEST) as file:
            listed: Any = json.load(file)
        if not isinstance(listed, dict) or "abi" not in listed:
            raise ValueError
    except (OSError, ValueError, RecursionError, UsageError):
        message = f"{folder} exists and is not a generated package; choose another --out or remove it"
        raise bad_file(message) from None
    files = listed.get("files")
    return {name for name in files if isinstance(name, str)} if isinstance(files, list) else None


def _with_files(sources: Mapping[str, str]) -> str:
    """model.json with the list of files."""
    data = json.loads(sources[MANIFEST]) | {"files": sorted(sources)}
    return json.dumps(data, indent=1, allow_nan=False) + "\n"


def _remove(folder: Path, name: str) -> None:
    """Remove a file of an earlier generation, with its folders if nothing else is in them."""
    path = folder / name
    if Path(name).is_absolute() or ".." in Path(name).parts:
        return  # not a name that eomgen wrote
    if any(parent.is_symlink() for parent in path.parents if parent.is_relative_to(folder)):
        return  # the file lies elsewhere
    with suppress(FileNotFoundError):
        path.unlink()
    for parent in path.parents:
        if parent == folder:
            return
        shutil.rmtree(parent / "__pycache__", ignore_errors=True)  # of modules that are gone
        try:
            parent.rmdir()
        except OSError:
            return


class Call(NamedTuple):
    """One call, as a user writes it."""

    text: str  #: with its arguments
    result: str  #: shape of the result for one state
    meaning: str

    @property
    def name(self) -> str:
        """Without its arguments."""
        return self.text.partition("(")[0]


def describe_calls(program: Program) -> list[Call]:
    """Every call of a generated package or Module, with its sizes as numbers."""
    s = program.sizes
    rows = len(program.metadata.get("independent_rows", range(s.n_c)))
    holonomic = len([i for i in program.metadata.get("independent_rows", range(s.n_c)) if i < s.n_h])
    unknowns = s.n_x + rows + holonomic
    independent = "q_i, v_i, a_i"
    calls = [
        Call("rhs(t, x)", _shape(s.n_x), "x' = [q'; v'], after projecting x onto the constraints"),
        Call("jacobian(t, x)", _shape(s.n_x, s.n_x), "dx'/dx of the complete rhs; wrt='u', 'p' as the next two"),
        Call("input_jacobian(t, x)", _shape(s.n_x, s.n_u), "dx'/du of the complete rhs"),
        Call("parameter_jacobian(t, x)", _shape(s.n_x, s.n_p), "dx'/dp of the complete rhs"),
        Call("mass_matrix(q)", _shape(s.n_v, s.n_v), "M of the spanning tree"),
        Call("embedded_mass_matrix(q)", _shape(s.n_dof, s.n_dof), "M of the independent coordinates"),
        Call("bias(t, x)", _shape(s.n_v), "h in M v' + h = generalized forces not in the model"),
        Call("inverse_dynamics(q, v, a)", _shape(s.n_v), "M a + h, the generalized forces to add"),
        Call(
            "inverse_dynamics_derivatives(q, v, a)",
            ", ".join(_shape(s.n_v, n) for n in (s.n_q, s.n_v, s.n_v)),
            "derivatives of inverse_dynamics by q, v and a",
        ),
        Call("energy(x)", _shape(2), "kinetic and potential energy T, V (J)"),
        Call("center_of_mass(q)", _shape(3), "centre of mass of all bodies, ground axes (m)"),
        Call("com_jacobian(q)", _shape(3, s.n_v), "velocity of the centre of mass = com_jacobian v"),
        Call("momentum(x)", _shape(6), "linear and angular momentum about the centre of mass, ground axes (SI)"),
        Call("centroidal_inertia(q)", _shape(3, 3), "inertia of all bodies about their centre of mass (kg m^2)"),
        Call("constraints(q)", _shape(holonomic), "independent loop residuals (m, rad)"),
        Call("constraint_jacobian(q)", _shape(rows, s.n_v), "C_q of C_q v + C_t = 0, nonholonomic rows last"),
        Call("velocity_constraints(x)", _shape(rows), "C_q v + C_t"),
        Call('constraints(q, rows="all")', _shape(s.n_h), "all loop residuals, redundant ones included"),
        Call('constraint_jacobian(q, rows="all")', _shape(s.n_c, s.n_v), "C_q of all rows"),
        Call("project(x, t=0.0)", _shape(s.n_x), "the nearest state on the constraints"),
        Call("x0(**values)", _shape(s.n_x), "a state assembled from named values"),
        Call("assemble(**guess)", _shape(s.n_q), "q with the loops closed, from a guess"),
        Call(
            f"kinematics({independent})",
            ", ".join(_shape(n) for n in (s.n_q, s.n_v, s.n_v)),
            f"q, v, a of the whole tree; {independent} are {_shape(s.n_dof)}",
        ),
        Call("kinematic_analysis(t, **led)", "KinematicAnalysis", "motion over a range of time or of coordinates"),
        Call("motion_range(name)", "MotionRange", "the limits between which a coordinate can move"),
        Call("poses(q)", _shape(s.n_bodies, 4, 4), "body frames to ground, homogeneous"),
        Call("outputs(t, x)", _shape(s.n_y), "the outputs of the model at the projected state"),
        Call("minimal.rhs(t, x_min)", _shape(2 * s.n_dof), "x_min' of the independent x_min = [q_i; v_i]"),
        Call("minimal.x0(**values)", _shape(2 * s.n_dof), "x_min assembled from named values"),
        Call("minimal.expand(x_min)", _shape(s.n_x), "x of the whole tree"),
        Call("dae.residual(t, y, yp)", _shape(unknowns), "F(t, y, y') of y = [q; v; multipliers; corrections]"),
        Call("dae.jacobian(t, y, yp, cj)", _shape(unknowns, unknowns), "dF/dy + cj dF/dy'"),
        Call("dae.initial(x)", f"{_shape(unknowns)}, {_shape(unknowns)}", "consistent y and y' of a state"),
        Call("canonical.rhs(t, z)", _shape(s.n_x), "z' of z = [q; p] by Hamilton's equations"),
        Call("canonical.of(x)", _shape(s.n_x), "z = [q; p] of a state x"),
        Call("canonical.expand(z)", _shape(s.n_x), "x = [q; v] of z"),
        Call("canonical.hamiltonian(z)", "number", "H = p v - L (J)"),
        Call("bind(p=None, u=None)", "Module", "the same calls with other parameters and inputs"),
        Call("simulate(span, initial=None)", "Trajectory", "a run; SciPy where its methods or functions are asked for"),
        Call("linearize(x=None, t=0.0)", "Linearization", "A, B, C, D along the constraints, eigenvalues"),
        Call("modes(x=None, t=0.0)", "Modes", "frequencies, shapes and damping ratios about an equilibrium"),
        Call("equilibrium(guess=None, hold=(), unknowns=())", "Equilibrium", "a position where all forces balance"),
        Call("multipliers(t, x)", _shape(s.n_c), "l of all constraint rows in M v' + h + C_q^T l = 0"),
        Call("reactions(t, x)", _shape(len(program.metadata.get("joint_names", ())), 6), "force and moment in joints"),
        Call("actuator_forces(t, x, a, actuated=None)", "ActuatorForces", "forces of drives that make a motion"),
        Call("impact(t, x, {gap: restitution})", "Impact", "the state after an impact, impulses"),
        Call("consistent(x, t=0.0)", _shape(s.n_x), "the nearest consistent state, with weights"),
        Call("sensitivities(names, span)", "Sensitivities", "a run with its derivatives; needs SciPy"),
    ]
    plain = s.n_h == s.n_c and all(program.coordinate_of[i] >= 0 for i in program.preferred)
    calls = [call for call in calls if plain or not call.text.startswith(("minimal", "kinematics"))]
    calls = [call for call in calls if s.n_momenta or not call.text.startswith("canonical")]
    sums = ("center_of_mass", "com_jacobian", "momentum", "centroidal_inertia")
    kept = [call for call in calls if s.n_com or call.text.partition("(")[0] not in sums]
    kept = [call for call in kept if s.n_wrenches or not call.text.startswith("reactions")]
    return [call for call in kept if s.n_c or not ("constraint" in call.text or call.text.startswith("multipliers"))]


def _shape(*sizes: int) -> str:
    return str(sizes)
