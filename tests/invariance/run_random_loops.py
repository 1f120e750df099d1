"""Random closed mechanisms and variants against a reference with multipliers: freedoms, refusals, accelerations.

``python -m invariance.run_random_loops 1000`` from the folder ``tests`` prints a table and exits 1 on a breach.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from invariance.loop_judge import Verdict, judge
from invariance.random_loops import FAMILIES, Loops, random_loops

import eomgen as eg
from eomgen.verification.variants import NotApplicable, Variant
from eomgen.verification.variants.chains import chain
from eomgen.verification.variants.compare import states_of
from eomgen.verification.variants.cuts import cut_another
from eomgen.verification.variants.findings import all_at_once, original_of
from eomgen.verification.variants.joints_as_constraints import as_constraints, as_equations
from eomgen.verification.variants.probe_states import Original, compiled

LIMIT = 1e-9  #: of accelerations, relative to the largest, times max(1, condition / 1000)
FIRST = (None, cut_another, as_constraints, as_equations, chain)


@dataclass
class Result:
    """What one mechanism showed."""

    family: str
    change: str
    faults: list[str] = field(default_factory=list)
    plain: float = 0.0  #: largest error of the model as written, in parts of the limit's size
    variant: float = 0.0


def try_one(number: int) -> Result:
    """Make one mechanism and a variant, and compare both with the reference."""
    loops = random_loops(number)
    first = FIRST[(number // len(FAMILIES)) % len(FIRST)]
    result = Result(list(FAMILIES)[number % len(FAMILIES)], first.__name__ if first else "as it is")
    try:
        original = original_of(loops.model, number, motion_only=True)
    except eg.EomgenError as error:
        result.faults.append(f"refused as written: {type(error).__name__}: {str(error)[:160]}")
        return result
    verdicts = [verdict_of(loops, original, k) for k in range(original.states.shape[1])]
    if original.module.n_dof != verdicts[-1].dof:
        result.faults.append(f"{original.module.n_dof} freedoms as written, {verdicts[-1].dof} by the reference")
        return result
    result.plain = max(error_of(loops, original, original.values[:, k], v, k) for k, v in enumerate(verdicts))
    random = np.random.default_rng([number, 7])
    variant = Variant(original.description)
    try:
        variant = variant.then(first, random) if first else variant
    except NotApplicable:
        result.change = "as it is"
    try:
        variant = variant.then(all_at_once, random)
        module = compiled(variant.description)
        values = module.outputs(0.0, states_of(original, variant, module))
    except eg.EomgenError as error:
        result.faults.append(f"refused as a variant: {type(error).__name__}: {str(error)[:160]}")
        return result
    if module.n_dof != verdicts[-1].dof:
        result.faults.append(f"{module.n_dof} freedoms as a variant, {verdicts[-1].dof} by the reference")
        return result
    order = {name: i for i, name in enumerate(module.y_names)}
    rows = [order.get(variant.outputs.get(name, name)) for name in original.module.y_names]
    values = np.array([np.full(values.shape[1], np.nan) if row is None else values[row] for row in rows])
    result.variant = max(error_of(loops, original, values[:, k], v, k) for k, v in enumerate(verdicts))
    for what, error in (("as written", result.plain), ("as a variant", result.variant)):
        if not error <= LIMIT:
            result.faults.append(f"accelerations {what} off by {error:.2g}")
    return result


def probes(original: Original, values: np.ndarray, quantities: tuple[str, ...], bodies: int) -> np.ndarray:
    """Outputs of the probes, a row for each body."""
    place = {name: i for i, name in enumerate(original.module.y_names)}
    return np.array([[values[place[f"probe_{k}_{quantity}"]] for quantity in quantities] for k in range(bodies)])


def verdict_of(loops: Loops, original: Original, k: int) -> Verdict:
    """The reference's result at a state of the model as written; its poses and velocities count."""
    module, x = original.module, original.states[:, k]
    order = [module.body_names.index(name) for name in loops.names]
    poses = module.poses(x[: module.n_q])[order]
    n = len(loops.bodies)
    v = probes(original, original.values[:, k], ("vx", "vy", "vz"), n)
    w = probes(original, original.values[:, k], ("wx", "wy", "wz"), n)
    return judge(loops.bodies, loops.joints, loops.gravity, poses, v, w, loops.size)


def error_of(loops: Loops, original: Original, values: np.ndarray, verdict: Verdict, k: int) -> float:
    """Largest difference of accelerations over their size and max(1, condition / 1000)."""
    found = probes(original, values, ("ax", "ay", "az", "wx_dot", "wy_dot", "wz_dot"), len(loops.bodies))
    per = np.array([loops.size] * 3 + [1.0] * 3)
    w = probes(original, original.values[:, k], ("wx", "wy", "wz"), len(loops.bodies))
    size = max(float(np.abs(verdict.accelerations / per).max()), float((w**2).max()), 1.0)
    return float(np.abs((found - verdict.accelerations) / per).max()) / size / max(1.0, verdict.condition / 1e3)


def main() -> int:
    """Run as many as asked for; print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first mechanism")
    given = parser.parse_args()
    start, results = perf_counter(), []
    for number in range(given.first, given.first + given.count):
        result = try_one(number)
        results.append(result)
        for fault in result.faults:
            print(f"{number} {result.family}, {result.change}: {fault}", flush=True)
        if number % 100 == 99:
            print(f"# {number + 1 - given.first} done", file=sys.stderr, flush=True)
    families: dict[str, list[Result]] = defaultdict(list)
    for result in results:
        families[result.family].append(result)
    print(f"\n{'family':28}{'tried':>7}{'faults':>8}{'as written':>12}{'variant':>12}")
    for family, own in families.items():
        worst = [max((getattr(r, key) for r in own), default=0.0) for key in ("plain", "variant")]
        print(f"{family:28}{len(own):7}{sum(bool(r.faults) for r in own):8}{worst[0]:12.1e}{worst[1]:12.1e}")
    print("changes besides:", dict(Counter(r.change for r in results)))
    bad = sum(bool(result.faults) for result in results)
    print(f"{len(results)} mechanisms in {perf_counter() - start:.0f} s, {bad} with faults")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
