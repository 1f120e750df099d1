"""A guess -> a position where all forces are in balance, with parameters that make it so."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import STATE
from ..base.results import Result, same_keys
from ..base.scales import largest
from ..base.texts import number
from ..errors import AssemblyError, PartitionError, ill_placed, ill_shaped
from ..runtime.argument_checks import check_names, read_names, read_number, read_numbers, unknown
from ..runtime.initial import Initial
from ..runtime.kernels import constraint_system
from ..runtime.refusals import refuse_closed, require_support
from .balance import Balance, balance_forces, force_slopes
from .limits import DIFFERENCES
from .linear import linearize
from .linearization import Linearization, SecondOrder, stability_of_matrix, stiffness_errors, verdict, without_noise
from .search import REACH, Search, SearchPoint, find_balance, newton

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- the result --------------------------------------------------------------------------------------------------------


class Equilibrium(Result):
    """A position in which all forces are in balance; ``eq["theta"]`` reads a coordinate or an unknown found.

    Attributes
    ----------
    x : (n_x,) array
        The state, at rest.
    q : (n_q,) array
    coordinates : dict of str to float
        All of them, those of cut joints included.
    states : dict of str to float
        First-order states, whose rates vanish too.
    unknowns : dict of str to float
        Parameters and inputs that were solved for.
    forces : dict of str to float
        What is left of the generalized force along each independent coordinate (N, N m), and of the rates of states.
    supports : dict of str to float
        Generalized force (N, N m) that holds each held coordinate, where no unknowns balance it.
    eigenvalues : (n,) complex array
        Of the motion near it, held coordinates held (1/s).
    stability : {'asymptotically stable', 'stable (undamped)', 'marginal', 'unstable', 'no freedom'}
        By the eigenvalues, or by the sign of the stiffness; as ``Linearization.stability``.
    linear : Linearization or None
        About the equilibrium; None where supports hold it.
    module : BoundModel
        With the unknowns found bound.
    steps : int
        Steps of Newton's iteration.
    """

    KEYS = same_keys("coordinates", "unknowns", "supports", "forces", "steps", "eigenvalues", "stability")
    coordinates: dict[str, float]
    states: dict[str, float]
    unknowns: dict[str, float]
    forces: dict[str, float]
    supports: dict[str, float]
    linear: Linearization | None
    eigenvalues: Any
    stability: str
    steps: int

    def __init__(self, module: BoundModel, t: float, x: Array, result: dict[str, Any]) -> None:
        self.module, self.t, self.x, self.q = module, t, x, x[: module.n_q]
        vars(self).update(result)

    def __getitem__(self, name: str) -> float:
        values, name = {**self.coordinates, **self.states, **self.unknowns}, self.module.layout.plain(name)
        if name not in values:
            raise unknown("coordinate, state or unknown", name, values)
        return values[name]

    @property
    def title(self) -> str:
        return f"Equilibrium of {self.module.name}"

    @property
    def facts(self) -> list[tuple[str, str]]:
        layout = self.module.layout
        units = [layout.unit(name) for name in self.coordinates]
        typical = {"rad": 1.0, "m": layout.length}
        sizes = [
            max(abs(self.coordinates[name]), typical.get(unit, 0.0))
            for name, unit in zip(self.coordinates, units, strict=True)
        ]
        rounded = without_noise([*self.coordinates.values()], units, sizes)
        lines = [(name, f"{value:.10g}") for name, value in zip(self.coordinates, rounded, strict=True)]
        lines += [(name, f"{value:.10g}") for name, value in self.states.items()]
        lines += [(f"{name} (solved)", f"{value:.10g}") for name, value in self.unknowns.items()]
        lines += [(f"support at {name}", f"{value:.6g}") for name, value in self.supports.items()]
        lines.append(("largest remaining force", f"{max(map(abs, self.forces.values()), default=0.0):.2g}"))
        lines.append(("eigenvalues", ", ".join(number(value) for value in self.eigenvalues)))
        return [*lines, ("stability", self.stability)]


def describe(search: Search, point: SearchPoint, steps: int) -> Equilibrium:
    """The result at a balanced position."""
    t, module, q, s = search.t, point.module, point.q, point.s
    layout = module.layout
    fixed = search.gradients(module, q) if search.supported else None
    here = balance_forces(module, t, q, s, fixed)
    result: dict[str, Any] = {
        "coordinates": read_coordinates(module, q, t),
        "states": dict(zip(layout.states, s.tolist(), strict=True)),
        "unknowns": dict(zip(search.names, point.unknowns.tolist(), strict=True)),
        "forces": {layout.velocity_labels[k]: float(f) for k, f in zip(here.velocities, here.forces, strict=True)},
        "supports": {},
        "linear": None,
        "steps": steps,
    }
    if fixed is None:
        linear = linearize(module, here.x, t)
        result |= {"linear": linear, "eigenvalues": linear.eigenvalues, "stability": linear.stability}
    else:
        free = balance_forces(module, t, q, s)
        pull = algebra.lstsq((fixed @ free.B).T, free.forces, rcond=STATE)
        rows = search.rows_to_hold(module, q)
        result["supports"] = {row.label: -float(f) / row.scale for row, f in zip(rows, pull, strict=True)}
        A, second = _motion_with_holds(search, module, here, t)
        if second is None:
            stability = stability_of_matrix(A, error=DIFFERENCES)
        else:
            stability = verdict(second, A, error=DIFFERENCES)
        result |= {"eigenvalues": np.sort_complex(algebra.eigvals(A)), "stability": stability}
    return Equilibrium(module, t, here.x, result)


def _motion_with_holds(search: Search, module: BoundModel, here: Balance, t: float) -> tuple[Array, SecondOrder | None]:
    """A of the motion with the held coordinates held, and its equations of second order where it has such."""
    n_q, s = module.n_q, module.layout.scales.q
    tree = module.kernels.mass_matrix(here.x[:n_q], t=t)
    M = here.B.T @ tree @ here.B
    slopes, rates = force_slopes(module, t, here, lambda q: search.gradients(module, q))
    kept = here.positions < len(s) - here.n_states  # states are among the velocities
    positions, slopes, rates = here.positions[kept], slopes[:, kept], rates[:, kept]
    damping = module.jacobian(t, here.x)[n_q:, n_q:]
    K, C = -slopes, -here.B.T @ tree @ damping @ here.B
    A = np.block([
        [rates[positions], here.B[positions]],
        [-algebra.solve(M, K), -algebra.solve(M, C)],
    ])  # fmt: skip
    if len(positions) != len(M) or np.any(here.v):
        return A, None
    K_error = stiffness_errors(M, A[len(M) :, : len(M)], np.zeros(0), s[positions], DIFFERENCES)
    C_error = DIFFERENCES * np.abs(here.B).T @ np.abs(tree) @ np.abs(damping) @ np.abs(here.B)
    return A, SecondOrder(M, C, K, C_error, K_error)


def read_coordinates(module: BoundModel, q: Array, t: float) -> dict[str, float]:
    """All coordinates by name, those of cut joints included."""
    values = dict(zip(module.q_names, q.tolist(), strict=True))
    if module.layout.n_loop_coordinates:
        y = constraint_system(module.kernels).cut.evaluate(q, t)[0]
        values |= dict(zip(module.layout.loops, y.tolist(), strict=True))
    return values


# -- the search --------------------------------------------------------------------------------------------------------


@np.errstate(all="ignore")
def equilibrium(
    module: BoundModel,
    /,
    guess: Mapping[str, float] | ArrayLike | None = None,
    t: float = 0.0,
    *,
    p: Any = None,
    u: Any = None,
    hold: Mapping[str, float | None] | Sequence[str] = (),
    unknowns: Sequence[str] = (),
) -> Equilibrium:
    """Find a position at rest in which all forces are in balance (by virtual work) and no first-order state changes.

    Newton's iteration is tried first, then the motion in a viscous fluid, then damped Gauss-Newton steps.  Angles in
    loops are those to which a motion leads from the declared position, or from a guess of all coordinates, not whole
    turns away.

    Parameters
    ----------
    guess : mapping of str to float, or (n_q,) array, optional
        Where to start: coordinates and states by name, or all coordinates; the declared initial position by default.
    t : float
        Time (s), held fixed.  Constraints that move in time move with the velocities they have then.
    p, u : optional
        As for ``bind``.
    hold : mapping of str to float or None, or sequence of str
        Coordinates, of the tree or of cut joints, and the values at which they are held; None for that of the guess.
        With ``unknowns`` these balance the held coordinates; otherwise supports hold them (forces in ``supports``).
    unknowns : sequence of str
        Parameters or inputs to solve for, such as a spring's free length: at least as many as held coordinates.

    Returns
    -------
    Equilibrium
        ``x``, ``q``, ``eq["theta"]``, ``unknowns``, ``supports``, ``eigenvalues``, ``stability``, ``linear``.

    Raises
    ------
    EquilibriumError
        No equilibrium was found from the guess; the message names the coordinate with the largest force, or one that
        nonholonomic constraints move even at rest.
    AssemblyError
        The loops do not close with the held values.
    UsageError
        A name is unknown, or there are too few unknowns.
    UnavailableError
        A constraint that closes and opens is closed there, or states are sampled, or contacts rigid.
    """
    require_support(module.layout, "equilibrium")
    module = module.bind(p, u)
    time = read_number("t", t)
    unknowns = read_names("unknowns", unknowns)
    by_name = isinstance(hold, Mapping)
    wanted: dict[str, float | None] = dict(hold) if by_name else dict.fromkeys(read_names("hold", hold))  # type: ignore[arg-type]
    raw = {name: read_number(f"hold: {name}", value) for name, value in wanted.items() if value is not None}
    states = _states(module, guess)
    refuse_closed(module.layout, states, "equilibrium")
    initial = Initial(module.kernels, time)
    if initial.sort(raw).rates:
        raise ill_placed(f"hold takes coordinates, not rates or states: {', '.join(initial.sort(raw).rates)}")
    q = _start(module, guess, raw, time)
    here = read_coordinates(module, q, time)
    check_names("coordinate", wanted, here)
    for name in wanted:
        raw.setdefault(name, here[name])
    raw = initial.sort(raw).positions
    search = Search(module, time, raw, unknowns, states)
    rows = len(search.gradients(module, q))
    if unknowns and len(unknowns) < rows:
        raise ill_shaped(
            f"{rows} held coordinates need {rows} unknowns, and these are given: {', '.join(unknowns)}; give as many "
            "unknowns as held coordinates, or none: supports then hold the coordinates"
        )
    point, steps = find_balance(search, q)
    if module.layout.n_h:
        named = [*(guess or {}), *wanted] if guess is None or isinstance(guess, Mapping) else None
        point = reached(search, point, q, named)
    return describe(search, point, steps)


def reached(search: Search, point: SearchPoint, start: Array, named: Sequence[str] | None) -> SearchPoint:
    """The same position with its angles as a motion leads there that moves the named coordinates, or independent ones.

    Steps of a search may turn a rocker right round, which no motion does.  The motion begins at the declared position,
    or at the start of the search where that is a whole position (``named`` is None) or of another assembly mode.
    """
    layout, q = search.layout, point.q
    initial = Initial(point.module.kernels, search.t)
    angles = [layout.q.index(name) for name in layout.q if layout.unit(name) == "rad"]
    free = {layout.q[i]: float(q[i]) for i in layout.independent_q}
    values = {
        name: value for name, value in read_coordinates(point.module, q, search.t).items() if name in (named or ())
    }
    motions: list[tuple[Callable[[], Array], dict[str, float]]] = [(lambda: start, free)]
    if named is not None:
        motions.insert(0, (initial.reference, values or free))
    for begin, ends in motions:
        with suppress(AssemblyError, PartitionError):
            here = begin()
            if largest((q - here)[angles]) < np.pi:
                return point
            there = initial.follow(here, ends)
            if not initial.apart(there, q):
                break
    else:
        return point
    if np.allclose(there, q, atol=1.0):
        return point
    turned, _, balanced = newton(search, search.at(there, point.s, point.unknowns), reach=REACH)
    return turned if balanced and not initial.apart(turned.q, q) else point


def _states(module: BoundModel, guess: Any) -> Array:
    """First-order states where the search begins: of the guess, else declared, else 0."""
    layout = module.layout
    raw = {} if guess is None else guess if isinstance(guess, Mapping) else None
    if raw is None:
        whole = np.array(read_numbers("guess", guess))
        if whole.shape == (layout.n_x,):
            return whole[layout.n_x - len(layout.states) :]
        raw = {}
    declared = {name: x for name, x in layout.initial.items() if name in layout.states and name not in raw}
    values = {**Initial(module.kernels).used(declared), **raw}
    return np.array([read_number(name, values.get(name, 0.0)) for name in layout.states])


def _start(module: BoundModel, guess: Any, fixed: Mapping[str, float], t: float) -> Array:
    """A closed position near the guess that has the held values."""
    initial = Initial(module.kernels, t, guess if isinstance(guess, Mapping) else ())
    if guess is None or isinstance(guess, Mapping):
        named = {name: value for name, value in (guess or {}).items() if name not in module.layout.states}
        values = {name: read_number(name, value) for name, value in named.items()}
        if initial.sort(values).rates:
            raise ill_placed("guess is a position: name coordinates in it, not rates")
        loose = {name: value for name, value in values.items() if name not in fixed}
        q = initial.from_guess(loose) if loose else initial.assembled({})
    else:
        q = np.array(read_numbers("guess", guess))
        if q.shape not in ((module.n_q,), (module.n_x,)):
            raise ill_shaped(f"guess must name coordinates or have shape ({module.n_q},), not {q.shape}")
        q = q[: module.n_q]
    if fixed:
        if not module.layout.n_h:
            return initial.system.with_values(q, fixed)
        try:
            return initial.follow(q, fixed)
        except AssemblyError:
            return initial.system.close(q, fixed).q
    return initial.system.close(q, {}).q if module.layout.n_h else q
