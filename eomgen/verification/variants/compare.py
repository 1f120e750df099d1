"""Stage verification, comparison: a variant at the states of the original -> a Finding."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...describe.rewritten_texts import names_of
from ...errors import EomgenError, ModelError
from ...kinematics.idle_rows import IDLE
from ...limits.rounding import EPS
from ..comparison import NO_LIMIT
from ..finding import Finding
from .probe_states import OBSERVED, ROUNDINGS, Original, compiled, reactions_of
from .variant import NotApplicable, Variant

#: Names whose constant is free: it changes where ground is shifted.
FREE_CONSTANT = ("potential_energy", "total_energy")


def compare(check: str, original: Original, make: Any, random: Any, reactions: bool = False) -> Finding:
    """Make a variant, compile it and compare it; a change without meaning here is left out, a refusal is a breach."""
    try:
        variant = make(original.description, random)
    except NotApplicable as why:
        return Finding.skipped(check, str(why))
    try:
        module = compiled(variant.description, kernels=None if reactions else OBSERVED)
        return compare_module(check, original, variant, module, reactions)
    except EomgenError as error:
        if isinstance(error, ModelError) and all(IDLE in problem.message for problem in error.problems):
            return Finding.skipped(
                check, "a constraint without effect is allowed as a joint, but refused as an equation"
            )
        return refused(check, error)


def refused(check: str, error: Exception) -> Finding:
    """The finding of a variant that is refused although the original runs."""
    words = " ".join(str(error).split())
    return Finding(check, np.inf, 0.0, note=f"refused: {type(error).__name__}: {words[:300]}")


def compare_module(
    check: str, original: Original, variant: Variant, module: Any, reactions: bool = False, **given: Any
) -> Finding:
    """Degrees of freedom, outputs and, if asked, reactions of a module against the original's; ``given`` is p=, u=."""
    if module.n_dof != original.module.n_dof:
        note = f"{module.n_dof} degrees of freedom instead of {original.module.n_dof}"
        return Finding(check, np.inf, 0.0, note=note)
    states = states_of(original, variant, module)
    values = module.outputs(0.0, states, **given) if len(module.y_names) else np.zeros((0, states.shape[1]))
    worst = Worst(check)
    place = {name: i for i, name in enumerate(module.y_names)}
    texts = {e.name: e.values["expression"] for e in original.description.sections["outputs"]}
    for i, name in enumerate(original.module.y_names):
        own = place.get(variant.outputs.get(name, name))
        if own is None:
            continue
        a, b = original.values[i], values[own]
        if names_of(texts[name]) & set(FREE_CONSTANT):
            a, b = a - a[0], b - b[0]
        worst.take(name, np.abs(a - b) / original.sizes[i], original.limits)
    if reactions and not given and "" not in variant.joints.values():
        _compare_reactions(worst, original, variant, module, states)
    return worst.finding(states.shape[1])


def states_of(original: Original, variant: Variant, module: Any) -> Any:
    """The original's states in the variant's coordinates."""
    columns = []
    for k in range(original.states.shape[1]):
        named = variant.state(original.named(k))
        columns.append([named[name] for name in module.x_names])
    return np.array(columns, dtype=float).T.reshape(len(module.x_names), -1)


class Worst:
    """The largest ratio of difference and limit so far."""

    def __init__(self, check: str) -> None:
        self.check, self.ratio, self.where = check, -1.0, ""
        self.unlimited = False  #: whether a state had no finite limit
        self.worst, self.limit = 0.0, ROUNDINGS * EPS

    def take(self, where: str, errors: Any, limits: Any) -> None:
        """Differences and limits at all states; a difference that is no number counts as infinite.

        States without a finite limit are left out.
        """
        errors = np.where(np.isfinite(errors), errors, np.inf)
        limited = np.isfinite(limits)
        self.unlimited |= not limited.all()
        if not limited.any():
            return
        k = int(np.argmax(np.where(limited, errors / limits, -1.0)))
        if errors[k] / limits[k] > self.ratio:
            self.ratio = float(errors[k] / limits[k])
            self.worst, self.limit = float(errors[k]), float(limits[k])
            self.where = f"{where}, state {k}"

    def finding(self, cases: int) -> Finding:
        """What was found; left out where no state has a finite limit."""
        if self.ratio < 0.0 and self.unlimited:
            return Finding.skipped(self.check, NO_LIMIT)
        return Finding(self.check, self.worst, self.limit, self.where, cases)


def _compare_reactions(worst: Worst, original: Original, variant: Variant, module: Any, states: Any) -> None:
    """Reactions; of those that rigid bodies leave undetermined the smallest, which is the same in every description."""
    found = reactions_of(module, states)
    if original.reactions is None or found is None:
        return
    numbers = {name: i for i, name in enumerate(module.joint_names)}
    force = variant.scales.force
    turn = np.eye(3) if variant.turn is None else variant.turn
    for i, name in enumerate(original.module.joint_names):
        own = numbers.get(variant.joints.get(name, name))
        if own is None:
            continue
        forces = np.einsum("ji,jk->ik", turn, found[own, :3]) / force
        moments = np.einsum("ji,jk->ik", turn, found[own, 3:]) / (force * variant.scales.length)
        errors = np.concatenate([forces, moments]) - original.reactions[i]
        errors[3:] /= original.length
        worst.take(f"reaction of {name}", np.abs(errors).max(axis=0) / original.force, original.limits)
