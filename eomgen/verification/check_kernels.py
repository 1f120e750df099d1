"""Stage verification, check kernels: generated code against the graph it was made from, and the graph in 50 digits."""

from __future__ import annotations

import numpy as np

from .bench import Bench, numbers
from .comparison import Comparison, size_of, terms_size
from .finding import Finding
from .rounding_sizes import UNIT, bounded

COLUMNS = 9  #: states of a batch: more than a vector holds, and no multiple of it


def check(bench: Bench) -> list[Finding]:
    """All straight-line kernels, one finding each; batches; double arithmetic."""
    return [*(_kernel(bench, name) for name in bench.graph_kernels), *_derived(bench), _batches(bench), _digits(bench)]


def _kernel(bench: Bench, name: str) -> Finding:
    """Two evaluations of one expression in different orders differ by two bounds at most."""
    found, labels = Comparison(f"{name}: generated code and graph"), bench.labels(name)
    values, bounds = bench.bounds(name, bench.graph_kernels[name])
    for k, case in enumerate(bench.cases):
        actual = bench.call(name, case).ravel()
        found.add(k, actual - values[:, k], 2.0 * bounds[:, k], terms_size(values[:, k], bounds[:, k]), labels)
    return found.finding()


def _derived(bench: Bench) -> list[Finding]:
    """Kernels that are other kernels in disguise: the outputs, and the matrix of the independent coordinates."""
    module, found = bench.module, []
    if module.n_y and "motion_outputs" in bench.graph_kernels:
        outputs = Comparison("outputs: at the accelerations of the motion")
        for k, case in enumerate(bench.cases):
            a = bench.rhs(case)[module.n_q :]
            expected = module.kernels.motion("motion_outputs")(case.q, case.v, a, p=case.p, u=case.u, t=case.t)
            actual = module.outputs(case.t, case.x, p=case.p, u=case.u)
            bound = bench.bounds("motion_outputs", lambda: bench.terms.outputs)[1][:, k]
            slope = module.kernels.motion("output_derivatives")(case.q, case.v, a, p=case.p, u=case.u, t=case.t)
            C = module.kernels.constraint_jacobian(case.q, p=case.p, u=case.u, t=case.t)
            shift, n = bench.shift(k, C), module.n_x
            limit = (
                2.0 * bound
                + np.abs(slope[:, :n]) @ shift
                + np.abs(slope[:, n : n + module.layout.n_v]) @ bench.moved(k, C)
            )
            outputs.add(k, actual - expected, limit, size_of(expected), bench.layout.y)
        found.append(outputs.finding())
    return found


def _batches(bench: Bench) -> Finding:
    """A batch gives what single calls give; the vector library's functions may differ by units in the last place."""
    module, found = bench.module, Comparison("batches: same as single calls")
    case = bench.cases[0]
    rng = np.random.default_rng(COLUMNS)
    q = case.q[:, None] + 0.1 * rng.standard_normal((module.n_q, COLUMNS))
    x = np.concatenate([q, case.v[:, None] + rng.standard_normal((module.layout.n_v, COLUMNS))])
    terms = bench.terms
    symbols = {name: np.full(COLUMNS, float(v[0])) for name, v in bench.symbols.items()}
    symbols |= dict(zip((*terms.q, *terms.v), x, strict=True))
    for name in ("mass_matrix", "bias", "energy", "poses", "constraints", "constraint_jacobian"):
        if name not in bench.graph_kernels:
            continue
        outputs = list(bench.graph_kernels[name]())
        bounds = bounded(outputs, symbols, COLUMNS)[1]
        kernel = module.kernels.state(name)
        states = x if KERNEL_STATES[name] == "x" else q
        batch = np.asarray(kernel(states, p=case.p, u=case.u, t=case.t)).reshape(-1, COLUMNS)
        for k in range(COLUMNS):
            single = np.asarray(kernel(np.ascontiguousarray(states[:, k]), p=case.p, u=case.u, t=case.t)).ravel()
            labels = [f"{name} {label}" for label in bench.labels(name)]
            found.add(0, batch[:, k] - single, 2.0 * bounds[:, k], terms_size(single, bounds[:, k]), labels)
    found.cases = 1
    return found.finding()


KERNEL_STATES = {
    "mass_matrix": "q",
    "bias": "x",
    "energy": "x",
    "poses": "q",
    "constraints": "q",
    "constraint_jacobian": "q",
}


def _digits(bench: Bench) -> Finding:
    """The graph in double arithmetic against the graph in 50 digits: that the bounds of rounding are bounds."""
    found = Comparison("graph: double arithmetic and 50 digits")
    every = {**bench.graph_kernels, "gamma": lambda: bench.terms.gamma}
    for name, outputs in every.items():
        values, bounds = bench.bounds(name, outputs)
        labels = [f"{name} {label}" for label in bench.labels(name)] or [name] * len(values)
        for k, truth in enumerate(bench.truths):
            exact = bench.system.evaluate(f"kernel {name}", outputs, truth.values)
            apart = numbers([truth.mp.mpf(float(x)) - y for x, y in zip(values[:, k], exact, strict=True)])
            found.add(
                k, apart, bounds[:, k] + UNIT * np.abs(numbers(exact)), terms_size(values[:, k], bounds[:, k]), labels
            )
    found.cases = len(bench.truths)
    return found.finding()
