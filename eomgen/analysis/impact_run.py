"""Analysis: a run that stops at every closing gap, applies the impact and goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UsageError
from ..numeric.scales import Array
from .impact import TOUCHING, Impact, check_gaps, strike

if TYPE_CHECKING:
    from ..runtime.module import Module
    from ..runtime.trajectory import Trajectory

STEP = 1e-5  #: (s) over which the curvature of a gap is estimated
REST = 1e-6  #: rate after an impact, relative to the largest rate at an impact so far, at which a gap counts as closed


@dataclass(frozen=True)
class ImpactRun:
    """A motion with impacts.

    Attributes
    ----------
    t : (n_t,) array
        Times (s); each impact has two, the same one before and after.
    x : (n_x, n_t) array
    impacts : list of (float, Impact)
    pieces : list of Trajectory
        Between impacts.
    ended : {'end', 'impacts', 'rest'}
        Why it ended: the span is over, as many impacts as allowed, or a gap that no longer opens (bodies that stay in
        contact need a joint or a contact force).
    """

    t: Array
    x: Array
    impacts: list[tuple[float, Impact]]
    pieces: list[Trajectory]
    ended: str

    def __getitem__(self, name: str) -> Array:
        return np.concatenate([piece[name] for piece in self.pieces])

    def __repr__(self) -> str:
        return f"<ImpactRun: {len(self.t)} points, t = {self.t[0]:.6g} .. {self.t[-1]:.6g} s, {self.count}>"

    @property
    def count(self) -> str:
        """How many impacts there were, and how it ended."""
        reasons = {"end": "", "impacts": "; as many as allowed", "rest": "; a gap stays closed"}
        return f"{len(self.impacts)} impact{'s' * (len(self.impacts) != 1)}{reasons[self.ended]}"


def gap_functions(module: Module, names: tuple[str, ...]) -> list[Callable[[float, Array], float]]:
    """f(t, x) of each gap."""
    layout = module.layout
    found: list[Callable[[float, Array], float]] = []
    for name in names:
        if name in layout.q:
            i = layout.q.index(name)
            found.append(lambda t, x, i=i: float(x[i]))  # type: ignore[misc]
        elif name in layout.loops:
            kernel, k = module.kernels.motion("loop_coordinates"), layout.loops.index(name)

            def of_loop(t: float, x: Array, k: int = k, kernel: Any = kernel) -> float:
                q, v = x[: layout.n_q], x[layout.n_q :]
                return float(kernel(q, v, np.zeros_like(v), t=t)[0, k])

            found.append(of_loop)
        elif name in layout.y:
            j = layout.y.index(name)
            found.append(lambda t, x, j=j: float(module.outputs(t, x)[j]))  # type: ignore[misc]
        else:
            raise UsageError(f"gaps: {name!r} is no coordinate or output, whose value can be followed")
    return found


def run_with_impacts(
    module: Module,
    span: float | tuple[float, float],
    gaps: Mapping[str, float],
    initial: Mapping[str, float] | ArrayLike | None = None,
    parameters: Any = None,
    inputs: Mapping[str, Any] | None = None,
    *,
    most: int = 1000,
    **options: Any,
) -> ImpactRun:
    """See :meth:`~..runtime.analyses.Analyses.simulate_impacts`."""
    for key in ("events", "t_eval", "dense_output"):
        if key in options:
            raise UsageError(f"simulate_impacts has no {key}=; the pieces of the run are what the solver stepped")
    names = tuple(gaps)
    check_gaps(module.layout, gaps, ())
    steady = {k: v for k, v in (inputs or {}).items() if isinstance(v, (int, float))}
    bound = module.bind(parameters, steady or None)
    functions = gap_functions(bound, names)
    start, end = (0.0, float(span)) if np.ndim(span) == 0 else map(float, span)  # type: ignore[arg-type]
    x: Any = initial
    if initial is None or isinstance(initial, Mapping):
        x = bound.x0(initial, t=start)
    limit = TOUCHING * max(1.0, module.layout.length)
    for name, f in zip(names, functions, strict=True):
        if f(start, np.asarray(x, dtype=float)) < -limit:
            raise UsageError(f"gaps: {name} is {f(start, np.asarray(x)):.3g} at the start; a gap is 0 or positive")

    def event_of(f: Callable[[float, Array], float]) -> Any:
        def closing(t: float, state: Array) -> float:
            return f(t, state)

        closing.terminal, closing.direction = True, -1.0  # type: ignore[attr-defined]
        return closing

    events = {name: event_of(f) for name, f in zip(names, functions, strict=True)}
    pieces: list[Trajectory] = []
    impacts: list[tuple[float, Impact]] = []
    fastest, ended = 0.0, "end"
    leaving: dict[str, float] = {}  # gaps that an impact opened, and when they are widest
    while True:
        until = min([end, *leaving.values()])
        watched = [event for name, event in events.items() if name not in leaving]
        piece = bound.simulate((start, until), x, None, inputs, events=watched, **options)
        pieces.append(piece)
        start, x = float(piece.t[-1]), np.array(piece.x[:, -1])
        leaving = {name: t for name, t in leaving.items() if t > start}
        if piece.status != 1:
            if start >= end:
                break
            continue
        closed = {name: e for (name, e), f in zip(gaps.items(), functions, strict=True) if f(start, x) <= limit}
        impact = strike(bound, start, x, closed)
        impacts.append((start, impact))
        fastest = max(fastest, float(np.abs(impact.rates_before).max()))
        x = impact.x
        hit = impact.impulses > 0.0
        if (impact.rates_after[hit] <= REST * fastest).any():
            ended = "rest"
            break
        if len(impacts) >= most:
            ended = "impacts"
            break
        if start >= end:
            break
        for name, rate in zip(impact.names, impact.rates_after, strict=True):
            bend = _curvature(bound, functions[names.index(name)], start, x, float(rate))
            if rate > 0.0 > bend and start - rate / bend > start:
                leaving[name] = start - rate / bend
    times = np.concatenate([piece.t for piece in pieces])
    return ImpactRun(times, np.concatenate([piece.x for piece in pieces], axis=1), impacts, pieces, ended)


def _curvature(module: Module, f: Callable[[float, Array], float], t: float, x: Array, rate: float) -> float:
    """Second derivative of a gap along the motion, roughly: it tells when an opened gap begins to close."""
    middle = x + 0.5 * STEP * module.rhs(t, x)
    after = x + STEP * module.rhs(t + 0.5 * STEP, middle)
    return 2.0 * (f(t + STEP, after) - f(t, x) - rate * STEP) / STEP**2
