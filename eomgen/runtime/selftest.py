"""What was recorded when a package was generated -> how far this build is from it, and an exit code."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import EomgenError

if TYPE_CHECKING:
    from .bound_model import BoundModel

BREACH = 5  #: exit code of a build that computes something else
USAGE = 2  #: and of a wrong call
REMEDY = "install the package again, or generate it anew"


class Finding(NamedTuple):
    """How one call compares with its records."""

    ok: bool
    line: str


def main(module: BoundModel, recorded: Path) -> None:
    """Print a line for each call, and leave with 0 or 5."""
    if sys.argv[1:]:
        print(f"unknown argument {sys.argv[1]!r}: the selftest takes none", file=sys.stderr)
        sys.exit(USAGE)
    found = compare(module, recorded)
    for one in found:
        print(f"{'ok' if one.ok else 'BREACH':7} {one.line}")
    sys.exit(0 if all(one.ok for one in found) else BREACH)


def compare(module: BoundModel, recorded: Path) -> list[Finding]:
    """One finding for each call with records; a breach where the file is missing or damaged.

    Parameters
    ----------
    module : BoundModel
    recorded : Path
        ``tests/recorded.json`` of the package: calls, arguments, results, and the most by which each may differ.
    """
    try:
        data = json.loads(recorded.read_text(encoding="utf-8"))
        if data["name"] != module.name:
            return [Finding(False, f"{recorded.name} belongs to the model {str(data['name'])[:80]!r}; {REMEDY}")]
        worst: dict[str, tuple[float, str]] = {}
        for case in data["cases"]:
            ratio, line = _judge(module, case)
            worst[case["call"]] = max(worst.get(case["call"], (-1.0, "")), (ratio, line))
    except FileNotFoundError:
        return [Finding(False, f"{recorded.name} is missing from the package; {REMEDY}")]
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        why = f"{type(error).__name__}: {str(error)[:80]}"
        return [Finding(False, f"{recorded.name} is damaged ({why}); {REMEDY}")]
    if not worst:
        return [Finding(True, f"{recorded.name} has no figures, because the model calls functions in C")]
    return [Finding(ratio <= 1.0, f"{call}: {line}") for call, (ratio, line) in worst.items()]


def _judge(module: BoundModel, case: dict[str, Any]) -> tuple[float, str]:
    """The difference of one call from its record, as a part of the limit, and in words."""
    expected, bound = np.array(case["value"], dtype=float), float(case["bound"])
    try:
        found = np.asarray(getattr(module, case["call"])(*case["arguments"], **case["given"]), dtype=float)
    except EomgenError as error:
        return np.inf, f"recorded figures: {error}"
    if found.shape != expected.shape:
        return np.inf, f"recorded figures: shape {found.shape} instead of {expected.shape}"
    differences = np.abs(found - expected)
    largest = float(differences.max(initial=0.0)) if np.isfinite(differences).all() else np.inf
    return largest / bound, f"recorded figures differ by {largest:.2g}, at most {bound:.2g}"
