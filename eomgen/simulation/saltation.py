"""Simulation: derivatives of a run on one side of an event -> those on the other (saltation), and those of its time.

An event g(t, x, u, p) = 0 happens at a time T that moves with what a run is differentiated by:

    dT = -(g_x S- + g_p) / (g_t + g_x f-),  S+ = R_x (S- + f- dT) + R_t dT + R_p - f+ dT

with the state x+ = R(t, x-, p) after it and f-, f+ the rates on both sides (I. A. Hiskens, M. A. Pai, Trajectory
sensitivity analysis of hybrid systems, IEEE Trans. Circuits Syst. I 47 (2000), 204-220; R. I. Leine, H. Nijmeijer,
Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7; N. J. Kong et al., Saltation matrices: the
essential tool for linearizing hybrid dynamical systems, Proc. IEEE 112 (2024), 585-608).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.algebra import Array
from ..base.limits.impacts import ASIDE, CONTRADICTS, SIMULTANEOUS, SMOOTH, TOUCHING
from ..errors import NoDerivativeError, cannot
from .events import GO_ON, RESET, STOP, UNWATCHED, WAIT, Events, RunEvent, Together
from .impact_slopes import after_impact, after_reset
from .sensitivity_result import EventSlopes
from .sensitivity_start import keep_consistent
from .variational import Move, Variational

GRAZING = 100.0  #: how much larger the square of an event's rate is than what the error of the state makes of it


class Saltation:
    """Carries the derivatives of one run through its events.

    Parameters
    ----------
    run : Variational
    events : Events
    span : (float, float)
    tolerances : (float, array or float)
        rtol and atol of the run.
    corners : sequence of float
        Times at which inputs jump or bend.
    """

    def __init__(
        self, run: Variational, events: Events, span: tuple[float, float], tolerances: tuple[float, Any],
        corners: Sequence[float],
    ) -> None:  # fmt: skip
        if events.functions:
            raise cannot(
                f"event {events.functions[0].name} is a Python function, and its derivatives are not known; give its "
                "expression as a text"
            )
        self.run, self.events, self.span, self.tolerances, self.corners = run, events, span, tolerances, corners
        self.module, self.n = run.module, run.module.n_x
        every = events.listed(self.module, run.forcing)
        self.listed = [(i, event) for i, event in enumerate(every) if event.direction != UNWATCHED]
        self.names = [events.names[i] for i, _ in self.listed]
        sources = {id(event.source[0]): self._shared(event.source[0]) for event in every if event.source is not None}
        self.watched = [self._of_both(event, name) for (_, event), name in zip(self.listed, self.names, strict=True)]
        for (_, event), both in zip(self.listed, self.watched, strict=True):
            both.source = None if event.source is None else (sources[id(event.source[0])], event.source[1])
        self.formulas = [formula.slopes(self.module.p) for _, formula in events.formulas]
        self.found: list[EventSlopes] = []

    def _of_both(self, event: RunEvent, name: str) -> RunEvent:
        """The same event of z = [x; S], at which the integrator stops whatever it does: rates may jump there."""
        action = STOP if event.action == GO_ON else event.action
        return RunEvent(lambda t, z: event.function(t, z[: self.n]), name, event.terminal, event.direction, action)

    def _shared(self, source: Together) -> Together:
        """What gives several values, of z too."""
        n, columns = self.n, source.columns
        every = None if columns is None else lambda t, z: columns(t, np.ascontiguousarray(z[:n]))
        return Together(lambda t, z: source.values(t, z[:n]), every)

    def reset(self, t: float, z: Array, fired: Sequence[int]) -> Array:
        """z = [x; S] right after events that happened at time t."""
        changed: list[str] = []
        fixed = all(self._is_fixed(t, *self.run.split(z), self.listed[own][0], self.names[own]) for own in fired)
        for own in sorted(fired, key=lambda own: self.listed[own][1].action != GO_ON):
            after = self._pass(t, z, own)
            changed += [self.names[own]] if after is not z else []
            z = after
        if len(changed) > 1 and not fixed:
            raise self._at_once(t, changed)
        return z

    def _pass(self, t: float, z: Array, own: int) -> Array:
        """z right after one event; z itself where the event changes nothing."""
        forcing, (index, event) = self.run.forcing, self.listed[own]
        raw, S = self.run.split(z)
        x, S = self._consistent(t, raw, S)
        before, after = self._sides(t, x)
        changes = event.action != GO_ON or bool(np.abs(before - after).max() > 0.0)
        fixed = self._is_fixed(t, x, S, index, self.names[own])
        if changes and not fixed:
            self._refuse_ends(t, own)
            self._refuse_others(t, x, own, before)
        dt = np.zeros(S.shape[1]) if fixed else self._time(t, x, S, index, before, self.names[own], changes)
        move = self.run.move(t, x, S + np.multiply.outer(before, dt), dt)
        if not changes:
            self.found.append(EventSlopes(self.names[own], t, x, x, dt, move.x, move.x))
            return z
        x_after, d_after = x, move.x
        if event.action != GO_ON:
            x_after = self.events.reset(self.module, forcing, t, x, [index])
            d_after = self._after(t, x, move, x_after, index)
            after = self._sides(t, x_after)[1]
        self.found.append(EventSlopes(self.names[own], t, x, x_after, dt, move.x, d_after))
        x_after, S = self._consistent(t, x_after, d_after - np.multiply.outer(after, dt))
        return self.run.joined(x_after, S)

    def stop(self, t: float, z: Array, own: int) -> None:
        """Note an event that ended the run."""
        x, S = self._consistent(t, *self.run.split(z))
        before = self._sides(t, x)[0]
        self._refuse_others(t, x, own, before)
        dt = self._time(t, x, S, self.listed[own][0], before, self.names[own], True)
        moved = S + np.multiply.outer(before, dt)
        self.found.append(EventSlopes(self.names[own], t, x, x, dt, moved, moved))

    def _after(self, t: float, x: Array, move: Move, x_after: Array, index: int) -> Array:
        forcing = self.run.forcing
        here = self.module.bind(u=forcing(t, x))
        if self.events.model[index].action == RESET:
            found = after_reset(self.run, here, t, x, move, x_after, index, forcing(t, x))
            self._refuse_contradictions(t, (x, x_after), (move.x, found), move, index)
            return found
        declared = self.events.declared
        values = self.module.kernels.timed("events", nan=True)(t, x, u=forcing(t, x))
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
                    f"event {self.events.declared[index]['name']}: the gap moves with input {layout.u[j]}, and the "
                    "derivative of such an impact is not available; write the motion into the gap's expression"
                )

    # -- the time of an event -------------------------------------------------------------------------------------
    def _is_fixed(self, t: float, x: Array, S: Array, index: int, name: str) -> bool:
        """Whether an event is a sampling time that no change moves."""
        clocks = [clock["event"] for clock in self.module.metadata.get("clocks", [])]
        if index not in clocks:
            return False
        gradient = self._gradient(t, x, index)
        return not self.run.move(t, x, S).along(gradient, f"event {name}", self.module.layout.u).any()

    def _gradient(self, t: float, x: Array, index: int) -> Array:
        """Derivatives (1, ...) of an event's value by [x, t, u, p]."""
        first = len(self.events.model)
        if index < first:
            return self.module.kernels.rows("event_derivatives", [index], t, x, self.run.forcing(t, x))
        every, n_u = self.formulas[index - first](t, x), self.module.layout.n_u
        return np.concatenate([every[1 : 1 + self.n], every[:1], np.zeros(n_u), every[1 + self.n :]])[None]

    def _rate(self, t: float, x: Array, index: int, f: Array, name: str) -> float:
        """How fast an event's value changes along rates f (n_x,)."""
        layout = self.module.layout
        u = np.zeros((layout.n_u, 1))
        if self.run.forcing:
            by_t, by_x, _ = self.run.inputs(t, x)
            u = (by_t + by_x @ f)[:, None]
        flow = Move(f[:, None], np.ones(1), u, np.zeros((layout.n_p, 1)))
        return float(flow.along(self._gradient(t, x, index), f"event {name}", layout.u)[0, 0])

    def _time(self, t: float, x: Array, S: Array, index: int, f: Array, name: str, needed: bool) -> Array:
        """The derivatives (k,) of the time of an event; NaN where they do not exist and nothing depends on them."""
        gradient, rate = self._gradient(t, x, index), self._rate(t, x, index, f, name)
        h = ASIDE * (self.span[1] - self.span[0])
        earlier = x - h * f
        with np.errstate(all="ignore"):
            bend = (rate - self._rate(t - h, earlier, index, self._f(t - h, earlier), name)) / h
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
        """A state and its derivatives, brought onto the constraints."""
        module, forcing = self.module, self.run.forcing
        x = np.asarray(module.project(x, t=t, u=forcing(t, x)))
        slopes = self.run.inputs(t, x) if forcing else None
        return x, keep_consistent(module.bind(u=forcing(t, x)), t, x, S, self.run.columns, slopes)

    # -- what has no derivative -----------------------------------------------------------------------------------
    def _refuse_ends(self, t: float, own: int) -> None:
        near = SIMULTANEOUS * abs(self.span[1] - self.span[0])
        for end, what in ((self.span[0], "start"), (self.span[1], "end")):
            if abs(t - end) <= near:
                raise self._at_an_end(t, self.names[own], what)
        if any(abs(t - corner) <= near for corner in self.corners):
            raise NoDerivativeError(
                f"event {self.names[own]} happens at t = {t:.6g} s, exactly where an input jumps or bends; the run "
                "has no "
                "derivative there"
            )

    def _refuse_others(self, t: float, x: Array, own: int, f: Array) -> None:
        """Refuse another event at the same instant that changes the state or ends the run."""
        for other, (index, event) in enumerate(self.listed):
            if other == own or (event.action == GO_ON and not event.terminal):
                continue
            value = float(event.function(t, x))
            if np.isnan(value):
                continue
            gradient = self._gradient(t, x, index)
            rate = self._rate(t, x, index, f, self.names[other])
            onward = rate if self.span[1] >= self.span[0] else -rate
            if (event.action == WAIT and onward > 0.0) or event.direction * onward < 0.0:
                continue  # it has just happened, and leaves
            near = max(self._error(x, gradient), abs(rate) * SIMULTANEOUS * abs(self.span[1] - self.span[0]))
            if abs(value) <= near:
                raise self._at_once(t, [self.names[own], self.names[other]])

    def _refuse_contradictions(
        self, t: float, x: tuple[Array, Array], d: tuple[Array, Array], move: Move, index: int
    ) -> None:
        """Refuse a reset whose new positions obey what is closed here, but not where a parameter changes.

        ``x`` and ``d`` are states and their derivatives (n_x, k) before and after it.
        """
        module, layout = self.module, self.module.layout
        rows = module.metadata.get("held_rows", [])
        closed = [k for k, (_, state, _) in enumerate(rows) if x[0][layout.x.index(state)] > 0.5]
        if not closed or "held_errors" not in module.kernels.core.names:
            return
        errors = module.kernels.timed("held_errors")
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
                    f"event {self.events.declared[index]['name']} gives positions at t = {t:.6g} s that contradict "
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
