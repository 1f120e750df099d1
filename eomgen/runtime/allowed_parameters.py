"""Stage runtime: values of parameters -> what of them the elements of the model do not allow, all of it at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.value_rules import Allowed, Flaw, judge_range
from ..errors import ParameterError, Problem


def require_allowed(metadata: Mapping[str, Any], p: Array) -> None:
    """Refuse values of parameters (n_p,), or (n_p, k) of many runs, that the model itself could not declare.

    Values that are not finite are told by whatever computes with them.

    Raises
    ------
    ParameterError
    """
    columns, problems = p.reshape(len(p), -1), list[Problem]()
    for k, path, *data in metadata.get("ranges", ()):
        wrong = np.flatnonzero(~Allowed(*data[:4]).has(columns[k]) & np.isfinite(columns[k]))
        if len(wrong):
            flaws = judge_range(columns[k, wrong[:1]], *data)
            problems += told(metadata, path, flaws, [k], p, wrong.tolist())
    if rules := metadata.get("rules"):
        from .late_rules import broken_rules

        for path, flaws, used, runs in broken_rules(rules, columns):
            problems += told(metadata, path, flaws, used, p, runs)
    if problems:
        raise ParameterError(list(dict.fromkeys(problems)))


def bounds_of(metadata: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """The least and the greatest value of each parameter that is a number of an element by itself, as far as told."""
    found: dict[str, tuple[float, float]] = {}
    for k, _, low, high, *_ in metadata.get("ranges", ()):
        least, most = found.get(metadata["p_names"][k], (-np.inf, np.inf))
        least = least if low is None else max(least, low)
        found[metadata["p_names"][k]] = (least, most if high is None else min(most, high))
    return found


def told(
    metadata: Mapping[str, Any], path: str, flaws: Sequence[Flaw], used: Sequence[int], p: Array, runs: Sequence[int]
) -> list[Problem]:
    """Flaws of the first of the runs that break a rule, with the values of the parameters that it depends on."""
    names, values = metadata["p_names"], p.reshape(len(p), -1)[:, runs[0]]
    given = ", ".join(f"{names[k]} = {values[k]:.6g}" for k in used[:6]) + ", ..." * (len(used) > 6)
    where = ""
    if p.ndim > 1:
        where = f" in run {runs[0]}" + f" and {len(runs) - 1} more" * (len(runs) > 1)
    return [
        Problem(path + flaw.key, f"{flaw.message} with {given}{where}", flaw.remedy, code="EG-RANGE") for flaw in flaws
    ]
