"""Long sweeps over many alike cases: which of them run always, and which by ``make thorough`` alone."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

#: Every method of derivation.
METHODS = (
    "embedding", "lagrange", "recursive", "augmented", "newton_euler", "amalgamated", "gibbs_appell", "hamilton",
)  # fmt: skip
#: Both targets of a test: NumPy's functions always, compiled code by ``make thorough``.
TARGETS = ["numpy", pytest.param("cython", marks=pytest.mark.thorough)]
#: Examples that together have every type of joint, force, constraint and shape of all of them, every description of
#: rotations, every function in an expression, and events, inputs and outputs (tests/code/test_targets.py looks).
OF_ALL_KINDS = (
    "bicycle", "cam_follower", "compass_gait", "double_pendulum", "double_wishbone", "engine", "four_bar", "gait_leg",
    "gear_train", "hydraulic_boom", "planetary_gear", "quadrotor_load", "rolling_disc", "satellite", "slider_crank",
    "spatial_slider_crank", "stewart_platform", "two_link_manipulator", "wheelset",
)  # fmt: skip
#: Fewer examples, which together have every type of element and every section of a model file that any example has, for
#: sweeps over methods, variants and checks.
COVERING = (
    "slider_crank", "cam_follower", "stewart_platform", "wheelset", "planetary_gear", "bicycle", "hydraulic_boom",
    "gait_leg", "flyball_governor", "satellite", "gear_train", "rimless_wheel", "double_wishbone",
)  # fmt: skip


def seeds(count: int, kept: int) -> list[Any]:
    """Seeds of random cases, of which the first ``kept`` run always."""
    return part_of(range(count), lambda seed: seed < kept)


def part_of(cases: Iterable[Any], keep: Callable[[Any], bool]) -> list[Any]:
    """The cases of a sweep as parameters; those that are not to be kept are marked thorough.

    Parameters
    ----------
    cases : iterable
        Values of one parameter, tuples of values of several, or ``pytest.param``.
    keep : callable
        Whether a case runs always, of its value, or of the tuple of its values.
    """
    found = []
    for case in cases:
        values, id_, marks = (case.values, case.id, list(case.marks)) if hasattr(case, "marks") else (None, None, [])
        if values is None:
            values = case if isinstance(case, tuple) else (case,)
        kept = keep(values if len(values) > 1 else values[0])
        found.append(pytest.param(*values, id=id_, marks=[*marks, *([] if kept else [pytest.mark.thorough])]))
    return found
