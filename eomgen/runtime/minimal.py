"""States x = [q_i; v_i] of the degrees of freedom alone -> its derivative, dependent coordinates solved."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.algebra import Array
from ..errors import PartitionError, at_odds, ill_shaped, no_number
from .argument_checks import read_number, read_numbers
from .argument_names import both_names
from .refusals import require_switched
from .tree_motion import STEP, DependentMotion

if TYPE_CHECKING:
    from .bound_model import BoundModel

AMPLIFIED = 10.0  #: v_d / v_i above which a dead centre is near
REMEMBERED = 7  #: calls that the next one is compared with, less one
SUDDEN = 3.0  #: a change of velocity this many times what the accelerations explain is a change of branch


class Memory(threading.local):
    """What the calls of one thread leave for its next one.

    Attributes
    ----------
    q : (n_q,) array or None
        Where Newton's iteration starts; in a new thread, the position that was set last.
    recent : list of (time, velocities and accelerations)
        Of the last calls.
    """

    def __init__(self, start: list[Array | None]) -> None:
        self.q = start[0]
        self.recent: list[tuple[float, Array]] = []


class Minimal:
    """The equations of motion in independent coordinates and velocities only: x = [q_i; v_i].

    First-order states follow: x = [q_i; v_i; s].

    The set of independent coordinates is fixed.  The dependent ones are solved by Newton's iteration, starting from the
    last converged position, which is the only memory a call leaves; :meth:`reset` sets it.  Each thread has a memory of
    its own, so that threads do not disturb one another; a new thread begins where :meth:`reset` was told last.  A step
    that would end on another branch of the mechanism is refused.

    Attributes
    ----------
    x_names : tuple of str
        Names of the entries of x.
    q_names, v_names, s_names : tuple of str
        Their parts.
    n_x : int
    """

    def __init__(self, module: BoundModel) -> None:
        layout = module.layout
        layout.require_minimal_form()
        self._module = module
        self._layout = layout
        self._path = DependentMotion(module.kernels)
        self.q_names = tuple(layout.q[i] for i in layout.independent_q)
        self.v_names, self.s_names = tuple(layout.v[i] for i in layout.independent_moving), layout.states
        self.x_names = self.q_names + self.v_names + self.s_names
        self.n_x = len(self.x_names)
        self._start: list[Array | None] = [None]
        self._memory = Memory(self._start)

    def __repr__(self) -> str:
        return f"<minimal form of {self._layout.name}: x = [{', '.join(self.x_names)}]>"

    def reset(self, q: ArrayLike | None = None) -> None:
        """Set the position from which the next Newton iteration starts.

        Parameters
        ----------
        q : (n_q,) array, optional
            Position of the whole tree, closed or nearly; the assembled initial position by default.
        """
        start = self._module.assemble() if q is None else np.array(read_numbers("q", q))
        if start.shape != (self._layout.n_q,):
            raise ill_shaped(f"q must have shape ({self._layout.n_q},), not {start.shape}")
        self._start[0] = self._memory.q = start
        self._memory.recent = []

    def x0(self, values: Mapping[str, float] | None = None, /, *, t: float = 0.0, **named: float) -> Array:
        """Assembled initial state (n_x,), from the same named values as ``Module.x0``; calls :meth:`reset`."""
        x = self._module.x0(values, t=t, **named)
        require_switched(self._layout, x[self._layout.n_x - self._layout.n_states :])
        self.reset(x[: self._layout.n_q])
        return self.reduce(x)

    def reduce(self, x: ArrayLike) -> Array:
        """The independent part (n_x,) or (n_x, k) of full states (2 n,) or (2 n, k)."""
        full = read_numbers("x", x)
        layout = self._layout
        if full.ndim not in (1, 2) or len(full) != layout.n_x:
            raise ill_shaped(f"x must be of shape ({layout.n_x},) or ({layout.n_x}, k), not {full.shape}")
        return np.concatenate([full[layout.independent_q], full[layout.n_q + layout.independent]])

    def expand(self, x_min: ArrayLike, t: ArrayLike = 0.0) -> Array:
        """Compute full states x = [q; v] from minimal ones.

        Parameters
        ----------
        x_min : (n_x,) or (n_x, k) array
            Columns are taken one after the other, each starting from the position of the one before.
        t : float or (k,) array

        Returns
        -------
        (2 n,) or (2 n, k) array

        Raises
        ------
        ProjectionError, PartitionError
            A position out of reach, or at a dead centre of the independent coordinates.
        """
        x = read_numbers("x", x_min, self._layout.n_x)
        if x.shape[:1] != (self.n_x,) or x.ndim > 2:
            raise ill_shaped(f"x must have shape ({self.n_x},) or ({self.n_x}, k), not {x.shape}")
        if x.ndim == 1:
            return self._solve(read_number("t", t), x)
        times = read_numbers("t", t)
        if times.shape not in ((), x.shape[1:]):
            raise ill_shaped(f"t must be a number or have shape {x.shape[1:]}, one a state, not {times.shape}")
        times = np.broadcast_to(times, x.shape[1:])
        result = np.empty((self._layout.n_x, x.shape[1]))
        for j in range(x.shape[1]):
            result[:, j] = self._solve(float(times[j]), x[:, j])
        self._memory.recent = []
        return result

    @both_names
    def rhs(self, t: float, x: ArrayLike, p: Any = None, u: ArrayLike | None = None) -> Array:
        """Derivative (n_x,) of x = [q_i; v_i].

        Parameters
        ----------
        t : float
        x : (n_x,) array
        p : None
            Parameters belong to the module: ``module.bind(p=...).minimal``.
        u : (n_u,) array, optional
            Inputs.

        Raises
        ------
        PartitionError
            The independent coordinates cannot move the mechanism here, or a dead centre was crossed.
        ProjectionError
            The position is out of reach.
        """
        if p is not None:
            raise at_odds("the minimal form takes its parameters from its module: module.bind(p=...).minimal")
        state = read_numbers("x", x)
        if state.shape != (self.n_x,):
            raise ill_shaped(f"x must have shape ({self.n_x},) [{', '.join(self.x_names)}], not {state.shape}")
        t = read_number("t", t)
        memory = self._memory
        before = memory.q
        full = self._solve(t, state)
        x_dot = self._module.rhs(t, full, u=u)
        moving = slice(self._layout.n_q, self._layout.n_q + self._layout.moving)
        motion = np.concatenate([full[moving], x_dot[moving]])
        self._check_crossing(t, motion, state, before)
        memory.recent = [*memory.recent[-REMEMBERED:], (t, motion)]
        return self.reduce(x_dot)

    def _solve(self, t: float, x: Array) -> Array:
        n, k = self._layout.n_q, len(self._layout.independent_q)
        memory = self._memory
        if memory.q is None:
            self.reset()
        assert memory.q is not None
        q_i, v_i = x[:k], x[k:]
        way = np.abs((q_i - memory.q[self._layout.independent_q]) / self._path.scales_i)
        near = memory.q
        if way.size and not way.max() <= STEP:
            if not np.isfinite(way).all():
                raise no_number(f"x is not finite: {x}")
            near = self._path.follow(near, q_i, t)
        full = self._path.motion(q_i, v_i, np.zeros_like(v_i), near, t)[: self._layout.n_x]
        memory.q = full[:n].copy()
        return full

    def _check_crossing(self, t: float, motion: Array, x: Array, before: Array | None) -> None:
        """Refuse a reflection at a dead centre of the independent coordinates.

        Near it they look the same on both sides, so an integrator can step across and come back on the old branch: the
        dependent velocities then reverse at once, which no acceleration explains.
        """
        layout = self._layout
        scales, chosen = layout.scales.q[: layout.moving], layout.independent_moving
        if not layout.rank or before is None or not len(chosen):
            return
        v, a = np.abs(motion.reshape(2, -1) / scales).max(axis=1)
        own = np.abs(motion[chosen] / scales[chosen]).max()
        if v <= AMPLIFIED * own:
            return
        for time, other in self._memory.recent:
            gap = abs(t - time)
            v_other, a_other = np.abs(other.reshape(2, -1) / scales).max(axis=1)
            own_other = np.abs(other[chosen] / scales[chosen]).max()
            if v_other <= AMPLIFIED * own_other or gap == 0.0 or min(v, v_other) * gap > 1.0:
                continue
            change = (motion - other)[: layout.moving] / scales
            turned = (motion[: layout.moving] / scales) @ (other[: layout.moving] / scales) < 0.0
            if turned and np.abs(change).max() > SUDDEN * max(a, a_other) * gap:
                self._memory.q = before
                raise PartitionError(
                    f"t = {t:.6g}: {', '.join(self.q_names)} passed a dead centre, so the branch is not known any "
                    "more; "
                    "choose other independent coordinates, or integrate the full state",
                    t,
                    x,
                )
