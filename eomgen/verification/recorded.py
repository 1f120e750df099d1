"""Stage verification, recorded: the figures that came with an exported package -> how far its kernels are from them.

They are of the graph that the package was generated from, in double arithmetic, written when it was generated.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.kernel_table import NAMED
from ..errors import EomgenError
from .comparison import FAILED, Comparison, size_of
from .finding import Finding

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

FILE = "selftest.json"  #: in the folder of the package


def recorded_findings(module: BoundModel, file: Path | None = None) -> list[Finding]:
    """One finding for each kernel with figures; none where there is no package, a breach where its file is no use."""
    place = Path(__file__).parents[1] / FILE if file is None else file
    if not place.is_file():
        packaged = file is not None or place.with_name("model.json").is_file()
        return [_unusable(f"{FILE} is missing from the package")] if packaged else []
    try:
        data: dict[str, Any] = json.loads(place.read_text(encoding="utf-8"))
        if data["name"] != module.name:
            return [_unusable(f"{FILE} belongs to the model {str(data['name'])[:80]!r}")]
        found = [_compare(module, name, figures, data["states"]) for name, figures in data["kernels"].items()]
    except (EomgenError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError) as error:
        return [_unusable(f"{FILE} is damaged ({type(error).__name__}: {str(error)[:80]})")]
    return found or [Finding.skipped("recorded figures", f"{FILE} has no figures, because all kernels call code in C")]


def _unusable(why: str) -> Finding:
    """Figures that cannot be compared are a breach: nothing else tells a package that is not what was generated."""
    return Finding("recorded figures", FAILED, 0.0, note=f"{why}; install the package again, or generate it anew")


def _compare(module: BoundModel, name: str, figures: list[dict[str, Any]], states: list[dict[str, Any]]) -> Finding:
    found = Comparison(f"{name}: recorded figures")
    for number, (state, figure) in enumerate(zip(states, figures, strict=True)):
        given = {key: np.array(value, dtype=float) for key, value in state.items()}
        expected = np.array(figure["values"], dtype=float)
        actual = _call(module, name, given).ravel()
        found.add(number, actual - expected, figure["bound"], size_of(expected))
    return found.finding()


def _call(module: BoundModel, name: str, given: dict[str, Array]) -> Array:
    q, v, t = given["q"], given["v"], float(given["t"])
    p, u = given["p"], given["u"]
    takes = NAMED[name].inputs
    if takes == ("q", "v", "a"):
        return np.asarray(module.kernels.motion(name)(q, v, given["a"], p=p, u=u, t=t))
    return np.asarray(module.kernels.state(name)(q if takes == ("q",) else np.concatenate([q, v]), p=p, u=u, t=t))
