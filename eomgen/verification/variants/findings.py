"""Stage verification, findings: every change of the table tried on a model, one Finding each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np

from ...describe.builder import Builder
from ...describe.description import Description
from ...describe.joint_locks import with_locks
from ...errors import EomgenError
from ..finding import NOT_REACHED, Finding
from .body_frames import turn_bodies, turn_ground
from .chains import chain, split
from .compare import compare, refused
from .cuts import cut_another
from .joints_as_constraints import as_constraints, as_equations
from .other_calls import CALLS
from .other_rotations import redescribe
from .other_units import in_units
from .plain import plain
from .probe_states import Original, observe
from .probes import with_probes
from .renamed import rename, reorder
from .short_runs import run_findings
from .swaps import swap
from .variant import NotApplicable, Variant

Change = Callable[[Description, Any], Variant]


def all_at_once(description: Description, random: Any) -> Variant:
    """Joints swapped, frames and ground turned, units scaled, names and order changed, one after the other."""
    variant = Variant(description)
    for change in (swap, turn_bodies, turn_ground, in_units, reorder, rename):
        try:
            variant = variant.then(change, random)
        except NotApplicable:
            continue
    return variant


#: Name of a change -> what makes it of a description.
CHANGES: Mapping[str, Change] = {
    "body frames turned": turn_bodies,
    "ground turned": turn_ground,
    "units mm, t, ms": in_units,
    "order changed": reorder,
    "names changed": rename,
    "joints swapped": swap,
    "another joint cut": cut_another,
    "joints as chains": chain,
    "bodies in halves": split,
    "joint as constraints": as_constraints,
    "joint as equations": as_equations,
    "rotations otherwise": redescribe,
    "all at once": all_at_once,
}


#: Changes after which reactions are compared too, which takes longest.
REACTIONS = ("body frames turned", "ground turned", "units mm, t, ms", "another joint cut")


RUN = "short runs"  #: of all changes at once, and of another cut


def variant_findings(
    model: Builder | Description, *, seed: int = 0, seconds: float = 10.0, only: str | None = None
) -> list[Finding]:
    """Try every change on a model.

    Parameters
    ----------
    model : Builder or Description
    seed : int
        Of the random turns, orders and states.
    seconds : float
        Time after which the changes that remain are left out, each with a note.
    only : str, optional
        The name of one change.

    Returns
    -------
    list of Finding
        One for each change: the largest difference from the original, relative to the size of what was compared;
        infinite where the variant has other degrees of freedom or is refused.

    Raises
    ------
    EomgenError
        The model itself is refused.
    """
    end = perf_counter() + seconds
    made = model if isinstance(model, Builder) else Builder.from_description(model)
    try:
        original = original_of(made, seed)
    except NotApplicable as why:
        return [Finding.skipped("variants", str(why))]
    findings = []
    for number, name in enumerate((*CHANGES, *CALLS, RUN)):
        if only is not None and name != only:
            continue
        check = f"variants: {name}"
        random = np.random.default_rng([seed, number])
        if perf_counter() > end:
            findings.append(Finding.skipped(check, f"{NOT_REACHED} in {seconds:g} s"))
        else:
            try:
                findings.append(_found(name, check, made, original, random))
            except (ArithmeticError, AssertionError, LookupError, TypeError, ValueError) as error:
                findings.append(refused(check, error))  # whose fault it is has to be looked for
    return findings


def _found(name: str, check: str, model: Builder, original: Original, random: Any) -> Finding:
    if name == RUN:
        return run_findings(check, original, {"all at once": all_at_once}, random)
    if name in CALLS:
        return CALLS[name](check, model, original, random)
    return compare(check, original, CHANGES[name], random, name in REACTIONS)


def original_of(model: Builder, seed: int, motion_only: bool = False) -> Original:
    """The plain form of a model with probes, observed; every change starts from it."""
    try:
        base = plain(model)
    except EomgenError as error:
        raise NotApplicable(f"the model cannot be written in its plain form: {error}") from None
    description, kinds = with_probes(with_locks(base))
    original = observe(description, kinds, np.random.default_rng([seed, 99]), motion_only=motion_only)
    # variants whose coordinates differ are assembled from the same configuration
    start = original.named(0)
    declared = description.values.get("guess", {})
    coordinates = [what.partition(" ")[2] for what in kinds.values() if what.startswith("coordinate ")]
    description.values["guess"] = {name: start[name] for name in coordinates} | {
        name: value for name, value in declared.items() if name not in start
    }
    return original
