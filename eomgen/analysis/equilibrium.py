"""Analysis: a guess -> a position where all forces are in balance, with parameters that make it so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import AssemblyError, ill_placed, ill_shaped
from ..runtime.assembled import initial_of
from ..runtime.initial import Initial
from ..runtime.near_names import read_names, unknown
from ..runtime.refusals import refuse_closed, refuse_rigid, refuse_sampled, require_velocities
from ..runtime.room import read_number, read_numbers
from .balance_search import find_balance
from .balanced import Equilibrium, describe, read_coordinates
from .search import Search

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


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

    Newton's iteration is tried first, then the motion in a viscous fluid, then the method of Levenberg and Marquardt.

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
    require_velocities(module.layout)
    refuse_rigid(module.layout, "equilibrium")
    refuse_sampled(module.layout, "equilibrium")
    module = module if p is None and u is None else module.bind(p, u)
    time = read_number("t", t)
    unknowns = read_names("unknowns", unknowns)
    by_name = isinstance(hold, Mapping)
    wanted: dict[str, float | None] = dict(hold) if by_name else dict.fromkeys(read_names("hold", hold))  # type: ignore[arg-type]
    given = {name: read_number(f"hold: {name}", value) for name, value in wanted.items() if value is not None}
    states = _states(module, guess)
    refuse_closed(module.layout, states, "equilibrium")
    initial = Initial(module.kernels, time)
    if initial.sort(given).rates:
        raise ill_placed(f"hold takes coordinates, not rates or states: {', '.join(initial.sort(given).rates)}")
    q = _start(module, guess, given, time)
    here = read_coordinates(module, q, time)
    for name in wanted:
        if name not in here:
            raise unknown("coordinate", name, here)
        given.setdefault(name, here[name])
    given = initial.sort(given).positions
    search = Search(module, time, given, unknowns, states)
    rows = len(search.gradients(module, q))
    if unknowns and len(unknowns) < rows:
        raise ill_shaped(
            f"{rows} held coordinates need {rows} unknowns, and these are given: {', '.join(unknowns)}; give as many "
            "unknowns as held coordinates, or none: supports then hold the coordinates"
        )
    point, steps = find_balance(search, q)
    return describe(search, point, steps)


def _states(module: BoundModel, guess: Any) -> Array:
    """First-order states where the search begins: of the guess, else declared, else 0."""
    layout = module.layout
    given = {} if guess is None else guess if isinstance(guess, Mapping) else None
    if given is None:
        whole = np.array(read_numbers("guess", guess))
        if whole.shape == (layout.n_x,):
            return whole[layout.n_x - len(layout.states) :]
        given = {}
    declared = {name: x for name, x in layout.initial.items() if name in layout.states and name not in given}
    values = {**Initial(module.kernels).used(declared), **given}
    return np.array([read_number(name, values.get(name, 0.0)) for name in layout.states])


def _start(module: BoundModel, guess: Any, held: Mapping[str, float], t: float) -> Array:
    """A closed position near the guess that has the held values."""
    initial = initial_of(module.kernels, t, guess if isinstance(guess, Mapping) else ())
    if guess is None or isinstance(guess, Mapping):
        named = {name: value for name, value in (guess or {}).items() if name not in module.layout.states}
        values = {name: read_number(name, value) for name, value in named.items()}
        if initial.sort(values).rates:
            raise ill_placed("guess is a position: name coordinates in it, not rates")
        loose = {name: value for name, value in values.items() if name not in held}
        q = initial.from_guess(loose) if loose else initial.assembled({})
    else:
        q = np.array(read_numbers("guess", guess))
        if q.shape not in ((module.n_q,), (module.n_x,)):
            raise ill_shaped(f"guess must name coordinates or have shape ({module.n_q},), not {q.shape}")
        q = q[: module.n_q]
    if held:
        if not module.layout.n_h:
            return initial.system.with_values(q, held)
        try:
            return initial.follow(q, held)
        except AssemblyError:
            return initial.system.close(q, held).q
    return initial.system.close(q, {}).q if module.layout.n_h else q
