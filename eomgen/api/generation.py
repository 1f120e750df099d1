"""Model -> a package that stands alone, in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.files import as_path
from ..codegen.package import emit_package, write_package
from ..errors import EomgenError, cannot
from ..pipeline import build, compile_core, derive, with_start
from ..runtime.bound_model import BoundModel
from ..toolchain.targets import find_function, find_target
from ..verify.random_states import RECORDED, record_calls
from .equations import Equations

if TYPE_CHECKING:
    from ..model.model import Builder
    from ..reading.derivation import Derivation


@np.errstate(all="ignore")
def generate(
    model: Builder,
    directory: Path | str,
    method: str = "auto",
    target: str = "cython",
    independent: Sequence[str] | None = None,
    baumgarte: tuple[float, float] | None = None,
    precision: str = "double",
    fmi: str = "2.0",
    analyses: bool = False,
) -> Path:
    """Write a package that stands alone into ``directory/<name>/``, or one file ``<name>.fmu`` or ``.html``; its path.

    Files of an earlier generation that are no longer needed are removed; those of others are left alone.

    Parameters
    ----------
    model : Builder
    directory : Path or str
    method, independent, baumgarte : optional
        As for ``Model.compile``.
    target : {'cython', 'c', 'casadi', 'jax', 'cuda', 'fmu', 'web'}
    precision : {'double', 'float'}, optional
        Of the numbers of a ``c`` library: ``float`` is for processors whose unit knows single precision alone, and
        leaves five to six digits.
    fmi : {'2.0', '3.0'}, optional
        Version of FMI of a functional mock-up unit.
    analyses : bool, optional
        Whether a Python package has equilibria, linearization, reactions and all other analyses of a Module too;
        else those are eomgen's, by ``Module.of(package)``.

    Raises
    ------
    EomgenError
        The target has no packages; the folder exists and is no generated package, or holds a file in the way that
        eomgen did not write.
    """
    folder = as_path("directory", directory)
    row = find_target(target)
    if not (row.package or row.whole):
        raise cannot(
            f"target {target!r} works only in a session, by compile(target={target!r}); for a machine without a "
            "compiler generate a wheel: --target cython --wheel, or eomgen.toolchain.wheel.build_wheel(folder)"
        )
    equations = derive(Equations, model, method, independent, baumgarte)
    if row.whole:
        if precision != "double":
            raise cannot(f"precision is for packages; target {target} makes one file")
        unit = find_function(row.whole)(build(equations, target), equations.compile("numpy"), folder, fmi)
        return Path(unit)
    program = build(equations, target)
    if row.kernels and not row.module:
        program = with_start(equations, program)
    requested = {
        "independent": list(independent or ()) or None,
        "baumgarte": baumgarte,
        "precision": precision,
        "analyses": analyses or None,
    }
    recorded = {name: value for name, value in requested.items() if value not in (None, "double")}
    sources = dict(emit_package(program, target, precision, recorded, analyses))
    if row.module:
        sources[RECORDED] = record_calls(equations.name, _evaluated(equations))
    return write_package(sources, folder / equations.name)


def _evaluated(equations: Derivation) -> BoundModel | None:
    """The model without a compiler; None where it calls functions that are in C alone."""
    try:
        return BoundModel(compile_core(equations, "numpy"))
    except EomgenError:
        return None
