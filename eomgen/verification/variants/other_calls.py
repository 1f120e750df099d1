"""Stage verification, calls: the same description derived, compiled, given and called in other ways."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ... import pipeline
from ...describe.builder import Builder
from ...describe.visit import copied
from ...emit import emit_package
from ...emit.write import write_package
from ...equations import METHODS
from ...errors import EomgenError, ToolchainError, UsageError
from ...limits.verification import REGULAR
from ...numeric import algebra
from ...runtime.minimal import Minimal
from ..finding import Finding
from .compare import Worst, compare_module, refused, states_of
from .geometry import parameters_of_geometry
from .inputs import input_findings
from .plain import values_of
from .probe_states import OBSERVED, Original, compiled, compiled_model
from .variant import Variant

Call = Callable[[str, Builder, Original, Any], Finding]


def _guarded(call: Call) -> Call:
    """A refusal as a finding."""

    def run(check: str, model: Builder, original: Original, random: Any) -> Finding:
        try:
            return call(check, model, original, random)
        except ToolchainError as why:
            return Finding.skipped(check, f"no compiler: {why}")
        except EomgenError as error:
            return refused(check, error)

    return run


def _method(method: str) -> Call:
    def run(check: str, model: Builder, original: Original, random: Any) -> Finding:
        bare = any(original.description.values.get(key) is not None for key in ("lagrangian", "equations"))
        if bare:
            return Finding.skipped(check, "the equations are given")
        module = compiled(original.description, method=method)
        return compare_module(check, original, Variant(original.description), module)

    return _guarded(run)


def _compiled(check: str, model: Builder, original: Original, random: Any) -> Finding:
    module = compiled(original.description, target="cython")
    return compare_module(check, original, Variant(original.description), module)


def _independent(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """Other independent coordinates, the best conditioned of some random choices."""
    own = original.module
    if not own.n_rows or not own.n_dof or own.n_q != own.n_v:
        return Finding.skipped(check, "there is no choice of independent coordinates")
    rows = np.atleast_2d(own.constraint_jacobian(original.states[: own.n_q, 0], rows="all"))
    basis = algebra.svd(rows)[2][-own.n_dof :].T
    best, chosen = 0.0, tuple[int, ...]()
    for _ in range(20):
        picked = tuple(sorted(random.permutation(own.n_q)[: own.n_dof].tolist()))
        if picked == tuple(own.layout.independent.tolist()):
            continue
        least = float(algebra.singular_values(basis[list(picked)]).min())
        if least > best:
            best, chosen = least, picked
    if best < REGULAR:
        return Finding.skipped(check, "no other coordinates are independent here")
    names = [own.q_names[k] for k in chosen]
    module = compiled(original.description, independent=names, kernels=OBSERVED)
    return compare_module(check, original, Variant(original.description), module)


def _parameters(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """Parameters declared wrong, and given at run time.

    Parameters that stand in places and sizes keep their values where there are loops: freedoms are judged there.
    """
    made, right = copied(original.description), values_of(original.description)
    kept = parameters_of_geometry(made) if original.module.n_rows else set()
    wrong = {name: value * float(random.uniform(1.0, 1.2)) for name, value in right.items() if name not in kept}
    if not wrong:
        return Finding.skipped(check, "there are no parameters that could change")
    for entry in made.sections["parameters"]:
        if entry.name in wrong:
            entry.values["value"] = wrong[entry.name]
    module = compiled(made, kernels=OBSERVED)
    p = np.array([right[name] for name in module.p_names])
    return compare_module(check, original, Variant(made), module, p=p)


def _minimal(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """Accelerations of the independent coordinates by the strictly minimal form."""
    own = original.module
    if not own.n_dof:
        return Finding.skipped(check, "there is no degree of freedom")
    try:
        minimal = Minimal(own)
    except UsageError as why:
        return Finding.skipped(check, str(why))
    worst, errors = Worst(check), np.zeros(original.states.shape[1])
    for k in range(original.states.shape[1]):
        x = original.states[:, k]
        minimal.reset(x[: own.n_q])
        full, found = own.rhs(0.0, x), minimal.rhs(0.0, minimal.reduce(x))
        size = max(float(np.abs(full).max()), 1.0)
        errors[k] = float(np.abs(found - minimal.reduce(full)).max()) / size
    worst.take("accelerations", errors, original.limits)
    return worst.finding(len(errors))


def _yaml(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """The model as it was given against its plain form, which went through the text of a model file."""
    module = compiled_model(model)
    if sorted(module.x_names) != sorted(original.module.x_names):
        return Finding(check, np.inf, 0.0, note=f"states {module.x_names} instead of {original.module.x_names}")
    states = states_of(original, Variant(original.description), module)
    order = [module.x_names.index(name) for name in original.module.x_names]
    a, b = module.rhs(0.0, states), original.module.rhs(0.0, original.states)
    errors = np.abs(a[order] - b).max(axis=0) / np.maximum(np.abs(b).max(axis=0), 1.0)
    worst = Worst(check)
    worst.take("accelerations", errors, original.limits)
    return worst.finding(len(errors))


def _exported(check: str, model: Builder, original: Original, random: Any) -> Finding:
    """A package written to a folder and imported from there."""
    made = Builder.from_description(original.description)
    with TemporaryDirectory() as folder:
        program = pipeline.build(pipeline.derive(made), "numpy")
        package = _imported(write_package(dict(emit_package(program, "numpy")), Path(folder) / program.name))
        try:
            variant = Variant(original.description)
            return compare_module(check, original, variant, package)
        finally:
            for name in [name for name in sys.modules if name.partition(".")[0] == package.__name__]:
                del sys.modules[name]


def _imported(root: Path) -> Any:
    """The package of a folder, under a name that no other module bears."""
    name = f"exported_by_verification_{root.name}"
    spec = importlib.util.spec_from_file_location(name, root / "__init__.py", submodule_search_locations=[str(root)])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


#: Name of a way -> what tries it.
CALLS: Mapping[str, Call] = {
    **{f"method {name}": _method(name) for name in METHODS},
    "independent coordinates": _guarded(_independent),
    "parameters at run time": _guarded(_parameters),
    "inputs": _guarded(input_findings),
    "minimal form": _guarded(_minimal),
    "YAML round trip": _guarded(_yaml),
    "exported package": _guarded(_exported),
    "target cython": _guarded(_compiled),
}
