"""Derivatives of a run: between events by the variational equation, at events by their saltation.

An impact of one gap with normal n (see :mod:`.impact`) solves

    M (v+ - v-) + C_q^T l = n^T g        C_q v+ + C_t = 0        r+ + e r- = 0,  r = n v + gap_t

with the rows of what is closed for a time among those of C_q, and velocities that a reset has set to v* go to the
nearest on the constraints, (v+ - v*) / s^2 + C_q^T l = 0.  Both are differentiated implicitly; changes of l drop out
along the free motions B, C_q B = 0.

An event g(t, x, u, p) = 0 happens at a time T that moves with what a run is differentiated by:

    dT = -(g_x S- + g_p) / (g_t + g_x f-),  S+ = R_x (S- + f- dT) + R_t dT + R_p - f+ dT

with the state x+ = R(t, x-, p) after it and f-, f+ the rates on both sides (I. A. Hiskens, M. A. Pai, Trajectory
sensitivity analysis of hybrid systems, IEEE Trans. Circuits Syst. I 47 (2000), 204-220; R. I. Leine, H. Nijmeijer,
Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7; N. J. Kong et al., Saltation matrices: the
essential tool for linearizing hybrid dynamical systems, Proc. IEEE 112 (2024), 585-608).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.impacts import ASIDE, CONTRADICTS, OFF, SIMULTANEOUS, SMOOTH, TOUCHING
from ..base.scales import minimum_norm
from ..errors import NoDerivativeError, cannot
from ..runtime.constrained import closed_rows, free_motions, solve_multipliers, with_closed_rows
from ..runtime.inputs import Forcing, Table, rate_places
from ..runtime.layout import Layout
from ..runtime.runs.events import GO_ON, PAUSE, RESET, UNWATCHED, WAIT, Events

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.trajectory import Trajectory


# -- what is differentiated by, and inputs -----------------------------------------------------------------------------


class EventSlopes(NamedTuple):
    """What happened at one event, and its derivatives by the k names.

    The states' derivatives go with the event: they are those of the state at the event, whenever that is, as a
    Poincare section takes them.  Those at a fixed time are in ``Sensitivities.dx``.
    """

    name: str
    t: float  #: time (s)
    before: Array  #: (n_x,) state right before
    after: Array  #: (n_x,) state right after, the same without a reset
    dt: Array  #: (k,) of the time
    d_before: Array  #: (n_x, k)
    d_after: Array  #: (n_x, k)


class SlopesNow(NamedTuple):
    """Derivatives of all inputs at a time and state."""

    by_t: Array  #: (n_u,)
    by_x: Array  #: (n_u, n_x)
    by_p: Array  #: (n_u, n_p)


class InputSlopes:
    """Derivatives of the inputs of one run.

    An expression is differentiated on the graph, a table piece by piece.  A Python function is called without the
    state from here on: one that reads it has derivatives that nobody knows.

    Parameters
    ----------
    forcing : Forcing
        Attached to the module of the run.
    p : (n_p,) array
    """

    def __init__(self, layout: Layout, forcing: Forcing, p: Array) -> None:
        self.layout = layout
        self.formulas = {i: formula.slopes(p) for i, formula in forcing.formulas.items()}
        self.forcing = forcing
        self.rates = rate_places(layout)
        self.tables: dict[int, Table] = {}
        self.functions: set[int] = set()
        for i, signal in forcing.varying.items():
            if i in self.formulas:
                continue
            if isinstance(signal, Table):
                self.tables[i] = signal.derivative()
            else:
                self.functions.add(i)
                forcing.varying[i] = AtOneState(layout.u[i], signal)

    @property
    def by_state_or_parameters(self) -> bool:
        """Whether an input may depend on more than time."""
        return bool(self.formulas)

    def __call__(self, t: float, x: Array) -> SlopesNow:
        """The derivatives; NaN by time for a Python function, unless its rate is an input too."""
        n_u, n_x, n_p = self.layout.n_u, self.layout.n_x, self.layout.n_p
        every = np.zeros((n_u, 1 + n_x + n_p))
        for i, slopes in self.formulas.items():
            every[i] = slopes(t, x)
        within = self.forcing.within
        for i, table in self.tables.items():
            every[i, 0] = table.beside(t, t if within is None else min(max(t, within[0]), within[1]))
        for i in self.functions:
            rate = self.rates.get(i)
            every[i, 0] = np.nan if rate is None else self.forcing(t, x)[rate]
        return SlopesNow(every[:, 0], every[:, 1 : 1 + n_x], every[:, 1 + n_x :])


class AtOneState:
    """A user's function f(t, x) as one of time alone.

    Parameters
    ----------
    name : str
        Of the input.
    function : callable f(t, x)
    """

    def __init__(self, name: str, function: Callable[[float, Any], float]) -> None:
        self.name, self.function = name, function

    def __call__(self, t: float, x: Array) -> float:
        """The value, without the state."""
        try:
            return self.function(t, None)
        except Exception:
            self.function(t, x)  # a fault of its own comes out as it is
        raise cannot(
            f"input {self.name} is a Python function of the state, and its derivatives are not known; give it as an "
            'expression in a text, such as "-k*theta", or as a function of time alone'
        )


class Differentiated(NamedTuple):
    """What a trajectory is differentiated by: k names, each a parameter, an input or an initial value."""

    names: tuple[str, ...]
    parameters: tuple[tuple[int, int], ...]  #: (column, index of the parameter)
    inputs: tuple[tuple[int, int], ...]  #: (column, index of the input)
    initial: tuple[tuple[int, str], ...]  #: (column, name of the coordinate or rate)

    def spread(self, by_parameters: Array, by_inputs: Array) -> Array:
        """Derivatives (rows, k) from those by all parameters and all inputs; zero for initial values."""
        result = np.zeros((len(by_parameters), len(self.names)))
        for column, index in self.parameters:
            result[:, column] = by_parameters[:, index]
        for column, index in self.inputs:
            result[:, column] = by_inputs[:, index]
        return result


def assembly_rows(module: BoundModel, t: float, x: Array, inputs: SlopesNow | None) -> Array:
    """The derivatives of what an assembly solves, inputs that depend on the state and on parameters included."""
    layout, E = module.layout, module.kernels.assembly_jacobian(x, t=t)
    if inputs is not None:
        by_u = E[:, layout.n_x : layout.n_x + layout.n_u]
        by_x, by_p = E[:, : layout.n_x], E[:, layout.n_x + layout.n_u :]
        E = np.hstack([by_x + by_u @ inputs.by_x, by_u, by_p + by_u @ inputs.by_p])
    return E


def keep_consistent(
    module: BoundModel,
    t: float,
    x: Array,
    S: Array,
    columns: Differentiated,
    inputs: SlopesNow | None = None,
) -> Array:
    """The nearest sensitivities (n_x, k) that keep the constraints to first order, at a state on them.

    ``inputs`` are the derivatives of the inputs there.
    """
    layout, scales = module.layout, module.layout.scales
    n_q, n_x, n_h, n_c = layout.n_q, layout.n_x, layout.n_h, layout.n_c
    if not n_c:
        return S
    E = assembly_rows(module, t, x, inputs)
    other = columns.spread(E[:, n_x + layout.n_u :], E[:, n_x : n_x + layout.n_u])
    N = scales.rates(x[:n_q], np.eye(layout.n_v))
    dq, dv = S[:n_q], S[n_q:]
    if n_h:
        C_q = E[:n_h, :n_q]
        dq = dq - scales.rates(x[:n_q], minimum_norm(C_q @ N, C_q @ dq + other[:n_h], scales))
    lines = slice(n_h, n_h + n_c)
    gap = E[lines, :n_q] @ dq + E[lines, n_q:n_x] @ dv + other[lines]
    return np.vstack([dq, dv - minimum_norm(E[lines, n_q:n_x], gap, scales)])


# -- between events ----------------------------------------------------------------------------------------------------


class Move(NamedTuple):
    """Changes of all that a law may depend on, for unit changes of the k names."""

    x: Array  #: (n_x, k)
    t: Array  #: (k,)
    u: Array  #: (n_u, k), NaN for an input whose rate is not known
    p: Array  #: (n_p, k)

    def along(self, slopes: Array, what: str, names: tuple[str, ...]) -> Array:
        """The changes (m, k) of a law from its derivatives (m, ...) by x, t, u and p."""
        n_x, n_u = len(self.x), len(self.u)
        by_u = slopes[:, n_x + 1 : n_x + 1 + n_u]
        for j in np.flatnonzero(by_u.any(axis=0) & ~np.isfinite(self.u).all(axis=1)):
            raise cannot(
                f"{what} depends on input {names[j]}, a Python function, and its rate is not known; give it as an "
                "expression in a text, or as a table"
            )
        known = np.isfinite(self.u).all(axis=1)
        result = slopes[:, :n_x] @ self.x + np.multiply.outer(slopes[:, n_x], self.t)
        return np.asarray(result + by_u[:, known] @ self.u[known] + slopes[:, n_x + 1 + n_u :] @ self.p)


class Variational:
    """x' = f and S' = J S + df/dp as one system z = [x; S * weights].

    Parameters
    ----------
    module : BoundModel
        With parameters and constant inputs bound.
    forcing : Forcing
        The inputs of the run.
    columns : Differentiated
        What is differentiated by.
    """

    def __init__(self, module: BoundModel, forcing: Forcing, columns: Differentiated) -> None:
        self.module, self.forcing, self.columns = module, forcing, columns
        self.inputs = InputSlopes(module.layout, forcing, module.p)
        self.weights = _weights(module, columns)
        kernels, layout = module.kernels, module.layout
        self.rhs, self.tangent = kernels.kernel("rhs", nan=True), kernels.kernel("jacobian", nan=True)
        self.by_p, self.by_u = (
            kernels.kernel("parameter_jacobian", nan=True),
            kernels.kernel("input_jacobian", nan=True),
        )
        k = len(columns.names)
        self.dp = columns.spread(np.eye(layout.n_p), np.zeros((layout.n_p, layout.n_u)))
        self.du = columns.spread(np.zeros((layout.n_u, layout.n_p)), np.eye(layout.n_u))
        self.still = Move(np.zeros((layout.n_x, k)), np.zeros(k), self.du, self.dp)

    def slopes(self, t: float, x: Array, S: Array) -> tuple[Array, Array]:
        u = self.forcing(t, x)
        S_dot = self.tangent(t, x, u=u) @ S
        if self.columns.parameters:
            S_dot = S_dot + self.by_p(t, x, u=u) @ self.dp
        if self.columns.inputs or self.inputs.by_state_or_parameters:
            S_dot = S_dot + self.by_u(t, x, u=u) @ self.move(t, x, S).u
        return self.rhs(t, x, u=u), S_dot

    def move(self, t: float, x: Array, dx: Array, dt: Array | None = None) -> Move:
        """Everything that goes with changes of the state (n_x, k), and of the time (k,) at which it is looked at."""
        moved = self.still._replace(x=dx)
        if not self.forcing:
            return moved if dt is None else moved._replace(t=dt)
        by_t, by_x, by_p = self.inputs(t, x)
        du = self.du + by_x @ dx + by_p @ self.dp
        if dt is None:
            return moved._replace(u=du)
        return moved._replace(t=dt, u=du + np.multiply.outer(by_t, dt))

    def at(self, t: float, x: Array) -> BoundModel:
        return self.module.bind(u=self.forcing(t, x))

    def input_slopes(self, t: float, x: Array) -> SlopesNow | None:
        """Derivatives of the inputs that vary; None without any."""
        return self.inputs(t, x) if self.forcing else None

    def consistent(self, t: float, x: Array, S: Array) -> Array:
        return keep_consistent(self.at(t, x), t, x, S, self.columns, self.input_slopes(t, x))

    def __call__(self, t: float, z: Array) -> Array:
        x, S = self.split(z)
        x_dot, S_dot = self.slopes(t, x, S)
        return self.joined(x_dot, S_dot)

    def split(self, z: Array) -> tuple[Array, Array]:
        """x (n_x,) and S (n_x, k) without weights."""
        n = self.module.n_x
        return z[:n], z[n:].reshape(n, -1) / self.weights

    def joined(self, x: Array, S: Array) -> Array:
        return np.concatenate([x, (S * self.weights).ravel()])

    def rates(self, t: Array, x: Array, S: Array | None) -> tuple[Array, Array, Array, Array, Array]:
        """At times (m,) and states (n_x, m): inputs and x', the tangent (m, n_x, n_x), what drives S' beside it, and
        the changes of inputs (m, n_u, k) that go with S (m, n_x, k)."""
        u = self.forcing.sample(t, x) if self.forcing else np.repeat(self.module.u[:, None], len(t), axis=1)
        du = np.broadcast_to(self.du, (len(t), *self.du.shape))
        if self.forcing and S is not None:
            du = np.array([self.move(float(at), x[:, j], S[j]).u for j, at in enumerate(t)])
        J, by = np.moveaxis(self.tangent(t, x, u=u), -1, 0), np.zeros((len(t), *self.still.x.shape))
        if self.columns.parameters:
            by = np.moveaxis(self.by_p(t, x, u=u), -1, 0) @ self.dp
        if self.columns.inputs or self.inputs.by_state_or_parameters:
            by = by + np.moveaxis(self.by_u(t, x, u=u), -1, 0) @ du
        return u, self.rhs(t, x, u=u), J, by, du

    def with_outputs(self, run: Trajectory, S: Array) -> tuple[Array, Array]:
        """S (n_t, n_x, k) of a run, and the derivatives of its outputs, as (n_x, k, n_t) and (n_y, k, n_t)."""
        layout, t, x = self.module.layout, run.t, run.x
        n_q, n_x, n_v, n_u = layout.n_q, layout.n_x, layout.n_v, layout.n_u
        dy = np.zeros((len(t), layout.n_y, S.shape[2]))
        if layout.n_y:
            u, x_dot, J, by, du = self.rates(t, x, S)
            kernel = self.module.kernels.kernel("output_derivatives")
            Y = np.moveaxis(kernel(x[:n_q], x[n_q:], x_dot[n_q:], t=t, u=u), -1, 0)
            by_x, by_a, by_u, by_p = np.split(Y, np.cumsum((n_x, n_v, n_u)), axis=2)
            dy = by_x @ S + by_a @ (J @ S + by)[:, n_q:] + by_u @ du + by_p @ self.dp
        return np.moveaxis(S, 0, -1), np.moveaxis(dy, 0, -1)


def _weights(module: BoundModel, columns: Differentiated) -> Array:
    """Sizes of what is differentiated by, so that one tolerance fits all columns."""
    weights = np.ones(len(columns.names))
    for column, index in columns.parameters:
        weights[column] = abs(module.p[index]) or 1.0
    for column, index in columns.inputs:
        weights[column] = abs(module.u[index]) or 1.0
    return weights


# -- resets and impacts ------------------------------------------------------------------------------------------------


class Strike:
    """The laws that rule velocities at one instant.

    Parameters
    ----------
    module : BoundModel
        With the inputs at that instant bound.
    x : (n_x,) array
        The state right after.
    closed : sequence of int
        Equations of constraints that close and open that rule too.
    """

    def __init__(self, module: BoundModel, t: float, x: Array, closed: Sequence[int] = ()) -> None:
        self.module, self.t, self.layout, self.closed = module, t, module.layout, closed
        self.q, self.v = x[: self.layout.n_q], x[self.layout.n_q :]
        self.C_q, self.scales = module.kernels.constraint_jacobian(self.q, t=t), self.layout.scales
        if closed:
            self.C_q, self.scales = with_closed_rows(module, t, x, self.C_q)
        self.B = free_motions(self.C_q, self.scales)
        self._slopes = module.kernels.strike_derivatives

    def rows(self, v: Array, change: Array, l: Array, g: Array) -> tuple[Array, Array, Array, Array]:
        """Derivatives by [q, v, t, u, p] of M a + C_q^T l - n^T g, of a / s^2 + C_q^T l, of C_q v + C_t and of the
        events' rates."""
        n_v, n_c = self.layout.n_v, self.layout.n_c
        switched = np.zeros(self.layout.n_held // 2)
        switched[[*self.closed]] = l[n_c:]
        every = self._slopes(self.t, np.concatenate([self.q, v, change, l[:n_c], g, switched]))
        ends = np.cumsum([n_v, n_v, n_c, self.layout.n_events])
        first, second, third, fourth, fifth = np.split(every, ends)
        return first, second, np.vstack([third, fifth[[*self.closed]]]), fourth

    def solve(self, metric: Array, dv: Array, force: Array, rate: Array, n: Array, gap: Array) -> Array:
        """The changes (n_v, k) of v+: metric (dv+ - dv) + force = n^T dg along B, C_q dv+ = -rate, n dv+ = -gap."""
        w = -minimum_norm(self.C_q, rate, self.scales) if len(rate) else np.zeros_like(dv)
        B, free, closed = self.B, self.B.shape[1], n @ self.B
        K = np.zeros((free + len(n), free + len(n)))
        K[:free, :free], K[:free, free:], K[free:, :free] = B.T @ metric @ B, -closed.T, closed
        right = np.vstack([B.T @ (metric @ (dv - w) - force), -gap - n @ w])
        return np.asarray(w + B @ algebra.solve(K, right)[:free])


def after_impact(
    run: Variational, module: BoundModel, t: float, v: Array, move: Move, x: Array, event: int, e: float
) -> Array:
    """How the state after the impact of one gap changes, (n_x, k).

    Parameters
    ----------
    module : BoundModel
        With the inputs at that instant bound.
    v : (n_v,) array
        Velocities before.
    move : Move
        Changes of the state before, of time, inputs and parameters.
    x : (n_x,) array
        The state after.
    event : int
        The model's event whose expression is the gap.
    e : float
        Restitution.
    """
    layout, strike = module.layout, Strike(module, t, x, closed_rows(module, x))
    n_q, n_x, names = layout.n_q, layout.n_x, layout.u
    change, none, rest = strike.v - v, np.zeros(len(strike.C_q)), np.zeros(layout.n_events)
    M = module.kernels.mass_matrix(strike.q, t=t)
    n = strike.rows(v, change, none, rest)[3][event : event + 1, n_q:n_x]
    g = np.array(rest)
    g[event] = algebra.lstsq(strike.B.T @ n.T, strike.B.T @ M @ change, rcond=None)[0]
    force = M @ change - n[0] * g[event]
    l = solve_multipliers(strike.C_q[None], force[:, None], strike.scales)[:, 0]
    resting = move._replace(x=np.vstack([move.x[:n_q], np.zeros_like(move.x[n_q:])]))
    balance, _, rate, after = strike.rows(strike.v, change, l, g)
    before = strike.rows(v, change, l, g)[3]
    what = f"event {layout.info.events[event]['name']}"
    gap = resting.along(after[event : event + 1], what, names) + e * move.along(before[event : event + 1], what, names)
    pushed, rates = resting.along(balance, what, names), resting.along(rate, what, names)
    return np.vstack([move.x[:n_q], strike.solve(M, move.x[n_q:], pushed, rates, n, gap)])


def after_reset(
    run: Variational, module: BoundModel, t: float, before: Array, move: Move, x: Array, event: int, u: Array
) -> Array:
    """How the state after a reset changes, (n_x, k); arguments as for :func:`after_impact`, u (n_u,) before it."""
    layout = module.layout
    n_q, names, what = layout.n_q, layout.u, f"event {layout.info.events[event]['name']}"
    resets = layout.info.resets
    chosen = [k for k, (owner, _) in enumerate(resets) if owner == event]
    places = [resets[k][1] for k in chosen]
    slopes = module.kernels.rows("event_derivatives", [layout.n_events + k for k in chosen], t, before, u)
    star, moved = np.array(before), np.array(move.x)
    star[places] = module.kernels.rows("resets", chosen, t, before, u)
    moved[places] = move.along(slopes, what, names)
    dq, dv = moved[:n_q], moved[n_q:]
    if layout.space is not None:
        for i, _ in layout.quaternion_slots:
            dq[i : i + 4] /= np.linalg.norm(star[i : i + 4])
        star[:n_q] = layout.space.normalized(star[:n_q])
        dq = dq - layout.space.stretch(star[:n_q], dq)
    if not layout.n_c:
        return np.vstack([dq, dv])
    off = float(np.abs(layout.scales.distance(x[:n_q], star[:n_q])).max())
    if off > OFF:
        raise NoDerivativeError(
            f"{what} resets coordinates to values that do not close the loops (the projection moves them by {off:.2g}, "
            "scaled), so the derivative is not known; reset all coordinates so that the loops stay closed"
        )
    strike, scales = Strike(module, t, x), layout.scales
    dq = dq - _back(run, module, strike, dq, move)
    star_v = star[n_q:]
    m = solve_multipliers(strike.C_q[None], ((strike.v - star_v) / scales.q**2)[:, None], scales)[:, 0]
    changed = run.move(t, x, np.vstack([dq, np.zeros_like(dv)]), move.t)
    _, least, rate, _ = strike.rows(strike.v, strike.v - star_v, m, np.zeros(layout.n_events))
    pushed, rates = changed.along(least, what, names), changed.along(rate, what, names)
    nothing = np.zeros((0, layout.n_v)), np.zeros((0, dv.shape[1]))
    return np.vstack([dq, strike.solve(np.diag(scales.q**-2), dv, pushed, rates, *nothing)])


def _back(run: Variational, module: BoundModel, strike: Strike, dq: Array, move: Move) -> Array:
    """What brings changes of coordinates (n_q, k) back onto the constraints."""
    layout, t, q = module.layout, strike.t, strike.q
    n_h, n_q, n_x = layout.n_h, layout.n_q, layout.n_x
    if not n_h:
        return np.zeros_like(dq)
    x = np.concatenate([q, np.zeros(layout.n_v)])
    E = assembly_rows(module, t, x, run.input_slopes(t, x))[:n_h]
    drift = module.kernels.velocity_constraints(x, t=t)[:n_h]
    off = E[:, :n_q] @ dq + np.multiply.outer(drift, move.t) + E[:, n_x + layout.n_u :] @ move.p
    off = off + E[:, n_x : n_x + layout.n_u] @ run.du
    N = layout.scales.rates(q, np.eye(layout.n_v))
    return layout.scales.rates(q, minimum_norm(E[:, :n_q] @ N, off, layout.scales))


# -- across an event ---------------------------------------------------------------------------------------------------


GRAZING = 100.0  #: how much larger the square of an event's rate is than what the error of the state makes of it


class Saltation(Events):
    """The events of one run, through which it carries its derivatives.

    Parameters
    ----------
    given : None, or one event or several
        As for :class:`~..runtime.runs.events.Events`.
    span : (float, float)
    tolerances : (float, array or float)
        rtol and atol of the run.
    corners : sequence of float
        Times at which inputs jump or bend.
    """

    def __init__(
        self, run: Variational, raw: Any, span: tuple[float, float], tolerances: tuple[float, Any],
        corners: Sequence[float],
    ) -> None:  # fmt: skip
        super().__init__(run.module.layout, raw)
        if self.functions:
            raise cannot(
                f"event {self.functions[0].name} is a Python function, and its derivatives are not known; give its "
                "expression as a text"
            )
        self.run, self.span, self.tolerances, self.corners = run, span, tolerances, corners
        self.module, self.n = run.module, run.module.n_x
        self.slopes = [formula.slopes(self.module.p) for _, formula in self.formulas]
        self.crossed: list[EventSlopes] = []

    def encode(self) -> dict[str, Any] | None:
        """The events, at each of which the loop stops, whatever it does: rates may jump there."""
        encoded = super().encode()
        actions = [PAUSE if event.action == GO_ON else event.action for event in self.every]
        return encoded and {**encoded, "action": actions, "resets": []}

    def reset(self, module: BoundModel, forcing: Forcing, t: float, z: Array, fired: Sequence[int]) -> Array:
        """z = [x; S] right after events that happened at time t."""
        changed: list[str] = []
        fixed = all(self._is_fixed(t, *self.run.split(z), index) for index in fired)
        for index in sorted(fired, key=lambda index: self.every[index].action != GO_ON):
            after = self._pass(t, z, index)
            changed += [self.names[index]] if after is not z else []
            z = after
        if len(changed) > 1 and not fixed:
            raise self._at_once(t, changed)
        return z

    def _pass(self, t: float, z: Array, index: int) -> Array:
        """z right after one event; z itself where the event changes nothing."""
        forcing, event, name = self.run.forcing, self.every[index], self.names[index]
        raw, S = self.run.split(z)
        x, S = self._consistent(t, raw, S)
        before, after = self._sides(t, x)
        changes = event.action != GO_ON or bool(np.abs(before - after).max() > 0.0)
        fixed = self._is_fixed(t, x, S, index)
        if changes and not fixed:
            self._refuse_ends(t, index)
            self._refuse_others(t, x, index, before)
        dt = np.zeros(S.shape[1]) if fixed else self._time(t, x, S, index, before, changes)
        move = self.run.move(t, x, S + np.multiply.outer(before, dt), dt)
        if not changes:
            self.crossed.append(EventSlopes(name, t, x, x, dt, move.x, move.x))
            return z
        x_after, d_after = x, move.x
        if event.action != GO_ON:
            x_after = super().reset(self.module, forcing, t, x, [index])
            d_after = self._after(t, x, move, x_after, index)
            after = self._sides(t, x_after)[1]
        self.crossed.append(EventSlopes(name, t, x, x_after, dt, move.x, d_after))
        x_after, S = self._consistent(t, x_after, d_after - np.multiply.outer(after, dt))
        return self.run.joined(x_after, S)

    def stop(self, t: float, z: Array, index: int) -> None:
        x, S = self._consistent(t, *self.run.split(z))
        before = self._sides(t, x)[0]
        self._refuse_others(t, x, index, before)
        dt = self._time(t, x, S, index, before, True)
        moved = S + np.multiply.outer(before, dt)
        self.crossed.append(EventSlopes(self.names[index], t, x, x, dt, moved, moved))

    def _after(self, t: float, x: Array, move: Move, x_after: Array, index: int) -> Array:
        forcing, here = self.run.forcing, self.run.at(t, x)
        if self.model[index].action == RESET:
            result = after_reset(self.run, here, t, x, move, x_after, index, forcing(t, x))
            self._refuse_contradictions(t, (x, x_after), (move.x, result), move, index)
            return result
        declared = self.declared
        values = self.module.kernels.kernel("events", nan=True)(t, x, u=forcing(t, x))
        near = TOUCHING * max(1.0, self.module.layout.length)
        gaps = [j for j, other in enumerate(declared) if other.get("restitution") is not None]
        touching = [str(declared[j]["name"]) for j in gaps if j != index and abs(values[j]) <= near]
        if touching:
            raise self._at_once(t, [str(declared[index]["name"]), *touching])
        self._refuse_moving(t, x, index)
        if declared[index].get("friction"):
            raise NoDerivativeError(
                f"event {declared[index]['name']} is an impact with friction, whose derivative is not available; leave "
                "the friction out, or end the run before it"
            )
        v, e = x[self.module.n_q :], float(declared[index]["restitution"])
        return after_impact(self.run, here, t, v, move, x_after, index, e)

    def _refuse_moving(self, t: float, x: Array, index: int) -> None:
        layout = self.module.layout
        by_u = self._gradient(t, x, index)[0, self.n + 1 : self.n + 1 + layout.n_u]
        for j in np.flatnonzero(by_u):
            if j in self.run.forcing.varying and layout.u[j] not in layout.input_rates:
                raise NoDerivativeError(
                    f"event {self.declared[index]['name']}: the gap moves with input {layout.u[j]}, and the "
                    "derivative of such an impact is not available; write the motion into the gap's expression"
                )

    # -- the time of an event -------------------------------------------------------------------------------------
    def _is_fixed(self, t: float, x: Array, S: Array, index: int) -> bool:
        """Whether an event is a sampling time that no change moves."""
        clocks = [clock["event"] for clock in self.module.info.clocks]
        if index not in clocks:
            return False
        gradient = self._gradient(t, x, index)
        return not self.run.move(t, x, S).along(gradient, f"event {self.names[index]}", self.module.layout.u).any()

    def _gradient(self, t: float, x: Array, index: int) -> Array:
        """Derivatives (1, ...) of an event's value by [x, t, u, p]."""
        first = len(self.model)
        if index < first:
            return self.module.kernels.rows("event_derivatives", [index], t, x, self.run.forcing(t, x))
        every, n_u = self.slopes[index - first](t, x), self.module.layout.n_u
        return np.concatenate([every[1 : 1 + self.n], every[:1], np.zeros(n_u), every[1 + self.n :]])[None]

    def _value(self, t: float, x: Array, index: int) -> float:
        first = len(self.model)
        if index < first:
            kernel = self.module.kernels.kernel("events", nan=True)
            return float(kernel(t, x, u=self.run.forcing(t, x) if self.run.forcing else None)[index])
        return float(self.formulas[index - first][1].function(self.module.p)(t, x))

    def _rate(self, t: float, x: Array, index: int, f: Array) -> float:
        """How fast an event's value changes along rates f (n_x,)."""
        layout = self.module.layout
        u = np.zeros((layout.n_u, 1))
        if self.run.forcing:
            by_t, by_x, _ = self.run.inputs(t, x)
            u = (by_t + by_x @ f)[:, None]
        flow = Move(f[:, None], np.ones(1), u, np.zeros((layout.n_p, 1)))
        return float(flow.along(self._gradient(t, x, index), f"event {self.names[index]}", layout.u)[0, 0])

    def _time(self, t: float, x: Array, S: Array, index: int, f: Array, needed: bool) -> Array:
        """The derivatives (k,) of the time of an event; NaN where they do not exist and nothing depends on them."""
        gradient, rate, name = self._gradient(t, x, index), self._rate(t, x, index, f), self.names[index]
        h = ASIDE * (self.span[1] - self.span[0])
        earlier = x - h * f
        with np.errstate(all="ignore"):
            bend = (rate - self._rate(t - h, earlier, index, self._f(t - h, earlier))) / h
        error = self._error(x, gradient)
        if needed and t == self.span[0]:
            raise self._at_an_end(t, name, "start")
        if not rate * rate > GRAZING * abs(bend) * error or rate == 0.0 or t == self.span[0]:
            if needed:
                raise NoDerivativeError(
                    f"event {name} at t = {t:.6g} s only grazes its surface (its rate is {rate:.3g}): "
                    "the run has no derivative there, nor where impacts die away; end the run before it, or give "
                    "tighter tolerances if the event does cross"
                )
            return np.full(S.shape[1], np.nan)
        along = self.run.move(t, x, S).along(gradient, f"event {name}", self.module.layout.u)
        return np.asarray(-along[0] / rate)

    def _error(self, x: Array, gradient: Array) -> float:
        """What the errors that the integrator allows make of an event's value."""
        rtol, atol = self.tolerances
        sizes = np.broadcast_to(np.asarray(atol, dtype=float), np.shape(atol) or (1,))
        allowed = rtol * np.abs(x) + (sizes[: self.n] if len(sizes) > 1 else sizes)
        return float(np.abs(gradient[0, : self.n]) @ allowed)

    # -- both sides -----------------------------------------------------------------------------------------------
    def _f(self, t: float, x: Array) -> Array:
        return np.asarray(self.run.rhs(t, x, u=self.run.forcing(t, x)))

    def _sides(self, t: float, x: Array) -> tuple[Array, Array]:
        """The rates (n_x,) before and after an event at x, extrapolated from either side where they jump."""
        f, step = self._f(t, x), ASIDE * (self.span[1] - self.span[0])
        limit, sides = SMOOTH * np.abs(f).max(initial=0.0), []
        for h in (-step, step):
            with np.errstate(all="ignore"):
                near, far = (self._f(t + k * h, x + k * h * f) for k in (1.0, 2.0))
            side = 2.0 * near - far
            smooth = not np.isfinite(side).all() or np.abs(side - f).max(initial=0.0) <= limit
            sides.append(f if smooth else side)
        return sides[0], sides[1]

    def _consistent(self, t: float, x: Array, S: Array) -> tuple[Array, Array]:
        x = np.asarray(self.module.project(x, t=t, u=self.run.forcing(t, x)))
        return x, self.run.consistent(t, x, S)

    # -- what has no derivative -----------------------------------------------------------------------------------
    def _refuse_ends(self, t: float, index: int) -> None:
        near = SIMULTANEOUS * abs(self.span[1] - self.span[0])
        for end, what in ((self.span[0], "start"), (self.span[1], "end")):
            if abs(t - end) <= near:
                raise self._at_an_end(t, self.names[index], what)
        if any(abs(t - corner) <= near for corner in self.corners):
            raise NoDerivativeError(
                f"event {self.names[index]} happens at t = {t:.6g} s, exactly where an input jumps or bends; the run "
                "has no "
                "derivative there"
            )

    def _refuse_others(self, t: float, x: Array, index: int, f: Array) -> None:
        """Refuse another event at the same instant that changes the state or ends the run."""
        for other, event in enumerate(self.every):
            if other == index or event.direction == UNWATCHED or (event.action == GO_ON and not event.terminal):
                continue
            value = self._value(t, x, other)
            if np.isnan(value):
                continue
            gradient, rate = self._gradient(t, x, other), self._rate(t, x, other, f)
            onward = rate if self.span[1] >= self.span[0] else -rate
            if (event.action == WAIT and onward > 0.0) or event.direction * onward < 0.0:
                continue  # it has just happened, and leaves
            near = max(self._error(x, gradient), abs(rate) * SIMULTANEOUS * abs(self.span[1] - self.span[0]))
            if abs(value) <= near:
                raise self._at_once(t, [self.names[index], self.names[other]])

    def _refuse_contradictions(
        self, t: float, x: tuple[Array, Array], d: tuple[Array, Array], move: Move, index: int
    ) -> None:
        """Refuse a reset whose new positions obey what is closed here, but not where a parameter changes.

        ``x`` and ``d`` are states and their derivatives (n_x, k) before and after it.
        """
        module, layout = self.module, self.module.layout
        rows = module.info.rows_to_hold
        closed = [k for k, (_, state, _) in enumerate(rows) if x[0][layout.x.index(state)] > 0.5]
        if not closed or "held_errors" not in module.kernels.core.names:
            return
        errors = module.kernels.held_errors
        for column, name in enumerate(self.run.columns.names):
            h = ASIDE / max(1.0, float(np.abs(d[0][:, column]).max()), float(np.abs(d[1][:, column]).max()))
            slopes = []
            for state, slope in zip(x, d, strict=True):
                ends = [
                    errors(t + s * move.t[column], state + s * slope[:, column], p=module.p + s * move.p[:, column])
                    for s in (h, -h)
                ]
                slopes.append((ends[0] - ends[1])[::2][closed] / (2.0 * h))
            least = CONTRADICTS * float(np.abs(d[1][:, column]).max())
            if np.minimum(np.abs(slopes[1] - slopes[0]), np.abs(slopes[1])).max() > least:
                raise NoDerivativeError(
                    f"event {self.declared[index]['name']} gives positions at t = {t:.6g} s that contradict "
                    f"what is closed ({', '.join(rows[k][0] for k in closed)}) as soon as {name} changes, so there is "
                    "no derivative; give positions that obey it for all values"
                )

    @staticmethod
    def _at_an_end(t: float, name: str, what: str) -> NoDerivativeError:
        return NoDerivativeError(
            f"event {name} happens at the {what} of the run, t = {t:.6g} s, so a small change can move it "
            "out of the run, which has no derivative there; give another span"
        )

    def _at_once(self, t: float, names: Sequence[str]) -> NoDerivativeError:
        return NoDerivativeError(
            f"the events {' and '.join(names)} happen at once at t = {t:.6g} s; a small change decides which of them "
            "comes first, so the run has no derivative there"
        )
