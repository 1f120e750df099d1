"""Stage runtime: values by name -> an assembled position or state.

Values given explicitly are held exactly.  Declared initial values are held too, as long as the given ones leave them
room: one after the other in the order of the model, each if it is independent of those before.  The values are followed
from the model's reference position, so that the mechanism stays on its branch; where that way is blocked, the loops are
closed from the nearest guess, and a warning says so.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.constraints import GONE, INDEPENDENT, MEASURED, SETTLED, SHORT, STILL, UNMOVED
from ..errors import AssemblyError, calls_within
from ..numeric.assembly_velocity import VelocityEquations, assemble_velocity
from ..numeric.closure import close, closed
from ..numeric.constraint_system import RESTARTS
from ..numeric.held_path import follow
from ..numeric.projection import largest
from ..numeric.ranks import rank
from ..numeric.starts import starts
from .constraint_kernels import constraint_system
from .failure import place
from .kernels import Kernels
from .late_rank import require_rank
from .near_names import UnknownNameError, unknown, without_dots


class Given(NamedTuple):
    """Values by the name of a coordinate, its rate, a loop coordinate or its rate."""

    positions: dict[str, float]
    rates: dict[str, float]


class Initial:
    """Assembly of one model with one set of parameters at one time.

    Parameters
    ----------
    kernels : Kernels
    t : float
        Time; matters for driven constraints only.
    """

    def __init__(self, kernels: Kernels, t: float = 0.0) -> None:
        self.kernels = kernels
        self.layout = layout = kernels.layout
        self.t = t
        self.system = constraint_system(kernels).at(t)
        self._C_q = kernels.state("constraint_jacobian", nan=True)
        self.scales, self.place = layout.scales, layout.place_scales
        self.coordinates = layout.q + layout.loops

    def sort(self, values: Mapping[str, float]) -> Given:
        """Split values into positions and rates; raises UsageError for a name that is neither."""
        layout = self.layout
        rates = layout.v + layout.loop_rates
        values = without_dots(values, layout.instances)
        for name in values:
            if name in layout.p:
                raise UnknownNameError(f"{name!r} is a parameter, not a coordinate; bind(p={{{name!r}: ...}}) sets it")
            if name in layout.parameter_rates:
                wanted = ", ".join(n for n in layout.v if not n.endswith("_dot"))
                what = "angular velocity" if layout.quaternion_slots else "velocities"
                raise UnknownNameError(f"{name!r} follows from the {what}; give one of {wanted} instead")
            if name not in self.coordinates and name not in rates:
                raise unknown("coordinate or rate", name, self.coordinates + rates + layout.y)
        positions = {n: x for n, x in values.items() if n in self.coordinates}
        return Given(self.system.settle(positions), {n: x for n, x in values.items() if n in rates})

    # functions of q

    def rate(self, q: Array) -> Array:
        """C_t (n_c,)."""
        return self.kernels.velocity_constraints.every(np.concatenate([q, np.zeros(self.layout.n_v)]), t=self.t)

    def follow(self, start: Array, held: Mapping[str, float]) -> Array:
        """From a closed position steadily to held values; raises AssemblyError when blocked."""
        q = follow(self.system, start, held)
        if not self.system.aligned(q):
            raise AssemblyError("the axes of a joint flipped on the path there", code="EG-UNDETERMINED")
        return q

    def reference(self, given: Iterable[str] = (), rough: bool = True) -> Array:
        """The reference position, closed again for these parameters and this time.

        Declared values lead there but those to be `given`; unless ``rough``, it warns where they leave its branch.
        """
        if (later := self.later(given, rough)) is not None:
            return later
        declared = self.sort(self.layout.initial).positions
        try:
            return self.close_near(self.layout.q_reference, declared, restarts=2)
        except AssemblyError:
            return self.system.close(self.layout.q_reference, {}).q

    def close_near(self, start: Array, held: Mapping[str, float], restarts: int = RESTARTS) -> Array:
        """The closed position near a start, also where Newton's steps halve the distance only, as at a change point."""
        found = self.system.close(start, held, restarts)
        if found.residual > SETTLED:
            from .start_branch import where_lost

            return where_lost(self.system.closure(held), found.q)
        return found.q

    def used(self, declared: dict[str, float]) -> dict[str, float]:
        """Declared values of which a start is made; refuses one that is no number with the parameters bound."""
        return declared if self.layout.late is None else self.layout.late.used(declared)

    def later(self, given: Iterable[str], rough: bool) -> Array | None:
        """Where drivers by this time, or later parameters, bring the reference position; None without, or blocked."""
        if not self.t or largest(self.scales.residual(self.system.position(self.layout.q_reference)[0])) <= SETTLED:
            return None if self.layout.late is None else self.layout.late.follow(self, given, rough)
        first = Initial(self.kernels).reference(given, rough)
        try:
            return follow(self.system.at(0.0), first, {}, self.t)
        except AssemblyError as error:
            self.tell_branch(f"the position at t = {self.t:.6g} s", error)
            return None

    def tell_branch(self, what: str, error: AssemblyError | None) -> None:
        """Warn that a position was found by closing the loops anew."""
        warnings.warn(
            f"{what} cannot be reached from the reference position on the same branch: {error}.  The loops are closed "
            "from the nearest guess instead; branches() gives all positions found, assemble() the one near a guess",
            stacklevel=calls_within() + 1,
        )

    @np.errstate(all="ignore")
    def assembled(self, given: Mapping[str, float], rough: bool = False) -> Array:
        """Position with the given values exact, and the declared ones where they leave room.

        Warns where that leaves the branch of the reference position, unless the values are a ``rough`` guess.
        """
        layout = self.layout
        declared = {name: x for name, x in self.sort(layout.initial).positions.items() if name not in given}
        if not layout.n_h and not any(name in self.system.cut.names for name in (*declared, *given)):
            return self.system.with_values(layout.q_reference, {**self.used(declared), **given})
        if not given:
            if (later := self.later((), rough)) is None:
                return self.close_near(layout.q_reference, self.used(declared))
            return self.follow(later, self.used(self.compatible(later, {}, declared)))
        try:
            start = self.reference(given, rough)
        except AssemblyError:
            return self.close_near(layout.q_reference, given)  # these parameters close somewhere else, if anywhere
        soft = self.used(self.compatible(start, given, declared))
        blocked = None
        for held in ({**given, **soft}, given):
            try:
                return self.follow(start, held)
            except AssemblyError as error:
                blocked = error
        try:
            found = self.close_near(start, {**given, **soft}, restarts=4 if soft else RESTARTS)
        except AssemblyError:
            if not soft:
                raise
            found = self.close_near(start, given)
        # where they stand still at the reference, it is on no branch of theirs
        if not rough and len(self.compatible(start, (), given)) == len(given):
            self.tell_branch(place(tuple(given), np.array(list(given.values()))).removeprefix(", "), blocked)
        return found

    def from_guess(self, guess: Mapping[str, float]) -> Array:
        """Position near a guess: its values are kept as far as they can be, independent coordinates first."""
        layout = self.layout
        if not layout.n_h:
            return self.assembled(guess, rough=True)
        favoured = [layout.velocity_labels[i] for i in layout.independent]
        ordered = {name: guess[name] for name in favoured if name in guess} | dict(guess)
        if set(guess) <= set(favoured):
            with suppress(AssemblyError):
                return self.assembled(guess, rough=True)
        from ..numeric.nearest_branch import close_nearest

        declared = {**self.sort(layout.guess).positions, **self.sort(layout.initial).positions}
        declared = self.used({k: v for k, v in declared.items() if k not in guess})
        start = self.system.with_values(layout.q_reference, {**declared, **guess})
        soft = self.compatible(start, {}, {**ordered, **declared})
        for held in (soft, {k: v for k, v in soft.items() if k in guess}):
            found = close_nearest(self.system, start, held, guess)
            if found is not None:
                return found.q
        return self.system.close(start, {}).q

    def branches(self, given: Mapping[str, float], first: Array, tries: int = 60, many: int = 16) -> list[Array]:
        """Every position found that holds the given values and, if they leave freedom, further ones of `first`.

        Each is searched around too, until there are more than `many`.
        """
        layout, found = self.layout, [first]
        there = dict(zip(layout.q, first.tolist(), strict=True))
        favoured = [n for i in layout.independent if (n := layout.velocity_labels[i]) in there]
        rest = {} if given else self.sort(layout.initial).positions
        more = self.compatible(first, given, rest | {n: there[n] for n in (*favoured, *layout.q)})
        room = max(layout.n_q - layout.n_h - len(given), 0)  # a singular position seems to have more freedom
        system = self.system.closure({**given, **dict([*more.items()][:room])})
        for here in found:  # which grows: the legs of a platform flip one by one
            for start in starts(here, system.free, self.place, tries if len(found) <= many or here is first else 0):
                q, residual = close(system, start)
                if closed(residual) and self.system.aligned(q) and all(self._apart(q, other) for other in found):
                    found.append(q)
        return found

    def _apart(self, a: Array, b: Array) -> bool:
        kinds = self.layout.coordinate_kinds if self.layout.given_rates else self.layout.velocity_kinds
        gap = np.abs(self.place.distance(a, b))
        turns = np.array([kind != "length" for kind in kinds], dtype=bool)
        gap[turns] = np.abs((gap[turns] + np.pi) % (2 * np.pi) - np.pi)
        if largest(gap) <= MEASURED or largest(gap[~turns]) > MEASURED or not self.layout.n_bodies:
            return largest(gap) > MEASURED
        poses = self.kernels.state("poses", nan=True)  # Euler angles describe each rotation twice
        return not largest((poses(a, t=self.t) - poses(b, t=self.t))[:, :3, :3].ravel()) <= MEASURED

    def side(self, q: Array) -> float:
        """det(J_d): its sign tells the branches of a position apart, 0 is a dead centre."""
        layout = self.layout
        J = self.scales.jacobian(self._C_q(q, t=self.t))
        dependent = np.delete(np.arange(layout.n_v), layout.independent)
        return float(np.linalg.det(J[np.ix_(layout.rows, dependent)])) if len(layout.rows) else 1.0

    # velocities

    def velocities(self, q: Array, given: Mapping[str, float | Array] | None) -> Array:
        """Velocities with the given rates exact, and the declared ones where they leave room; None: declared exact.

        Rates of shape (m,) give m motions at this position, velocities (n, m).
        """
        if self.layout.n_c:
            require_rank(self.kernels, self.scales.jacobian(self._C_q(q, t=self.t)))
        declared = {name: x for name, x in self.sort(self.layout.initial).rates.items() if name not in (given or {})}
        if given is not None:
            self._require_motion(q, given)
            declared = self.compatible(q, given, declared, positions=False) if declared else {}
        held: dict[str, float | Array] = {**(given or {}), **self.used(declared)}
        return self.on_branch(q, self._solve_rates(q, held), list(held))

    def on_branch(self, q: Array, v: Array, names: Sequence[str]) -> Array:
        """Velocities (n,) or (n, m), of which those named were given, as those of a motion also at a change point.

        Raises
        ------
        AssemblyError
            The position is a change point, and no branch has the velocities given, or several have.
        """
        rank = self.layout.rank
        if rank in (0, len(v)) or not np.any(v):
            return v  # what drivers move entirely is refused there by what solves for it
        sizes = algebra.singular_values(J := self.scaled_jacobian(q))
        if sizes[rank - 1] > GONE * sizes[0]:
            return v
        from .start_branch import on_branches

        return on_branches(self.kernels, self.t, q, J, {n: self.gradients(q, n) for n in names}, v)

    def scaled_jacobian(self, q: Array) -> Array:
        """J (n_c, n_v): C_q, scaled."""
        return self.scales.jacobian(self._C_q(q, t=self.t))

    def _require_motion(self, q: Array, given: Mapping[str, float | Array]) -> None:
        """Refuse the rate of a coordinate that stands still at q, whatever moves: it would need boundless rates.

        Raises
        ------
        AssemblyError
        """
        layout = self.layout
        if not layout.n_c:
            return
        J = self.scales.jacobian(self._C_q(q, t=self.t))
        basis = algebra.svd(J)[2][rank(J).rank :]
        driven = self._solve_rates(q, {}) / self.scales.q  # what driven constraints impose
        for name, values in given.items():
            value = max(np.ravel(values).tolist(), key=abs)
            scale = self.scales.q[layout.v.index(name)] if name in layout.v else self.rate_equation(q, name)[2]
            row = self.gradients(q, name)[0]
            still = np.linalg.norm(basis @ row) < STILL * max(1.0, float(np.linalg.norm(row)))
            if still and abs(row @ driven) < UNMOVED and abs(value / scale) > SHORT:
                moves = np.linalg.norm(basis, axis=0)
                ordered = dict.fromkeys([*layout.independent, *np.argsort(-moves, kind="stable")])
                others = [layout.v[i] for i in ordered if moves[i] > 0.1]
                instead = " or ".join(others[:2])
                remedy = f"give {instead} instead, or another position" if others else "no velocity is possible here"
                raise AssemblyError(
                    f"{name} = {value:.6g} cannot be reached: the constraints allow no such velocity here, as "
                    f"at a dead centre or across a blade{place(layout.q, q)}; {remedy}",
                    code="EG-CONTRADICTION",
                )

    def _solve_rates(self, q: Array, held: Mapping[str, float | Array]) -> Array:
        layout = self.layout
        columns = np.broadcast_shapes(*map(np.shape, held.values()))
        v = np.zeros((layout.n_v, *columns))
        indices = [layout.v.index(name) for name in held if name in layout.v]
        v[indices] = np.reshape([np.broadcast_to(held[layout.v[i]], columns) for i in indices], v[indices].shape)
        others = [name for name in held if name not in layout.v]
        if not (layout.n_c or others):
            return v
        equations = None
        if others:
            y_q, y_t, scales = map(np.array, zip(*(self.rate_equation(q, name) for name in others), strict=True))
            wanted = np.array([np.broadcast_to(held[name], columns) for name in others])
            equations = VelocityEquations(y_q, y_t, wanted, scales, others)
        C_q, labels = self._C_q(q, t=self.t), layout.constraint_labels
        return assemble_velocity(C_q, self.rate(q), self.scales, v, indices, equations, layout.v, labels)

    def rate_equation(self, q: Array, name: str) -> tuple[Array, float, float]:
        """y_q (n,), y_t and the typical size of a rate y' = y_q v + y_t that is no velocity of the tree."""
        layout, zero, k = self.layout, np.zeros(self.layout.n_v), self.layout.loop_rates.index(name)
        y_t = self.kernels.motion("loop_coordinates")(q, zero, zero, t=self.t)[1]
        return self.system.cut.evaluate(q, self.t)[1][k], y_t[k], layout.loop_scales[k]

    # which values can be held together

    def compatible(
        self, q: Array, given: Iterable[str], rest: Mapping[str, float], positions: bool = True
    ) -> dict[str, float]:
        """Those of `rest`, in order, that are independent of the constraints, of `given` and of each other at q.

        Nonholonomic constraints count for rates only, where `positions` is False.
        """
        layout, scales = self.layout, self.place if positions else self.scales
        C_q = self.system.position(q)[1][: self.layout.n_h] if positions else self._C_q(q, t=self.t)
        rows = [*scales.jacobian(C_q), *(row for name in given for row in self.gradients(q, name))]
        stacked = np.reshape(rows, (len(rows), len(scales.q)))
        basis = algebra.svd(stacked)[2][: rank(stacked).rank] if rows else stacked
        kept = {}
        for name, value in rest.items():
            added = basis
            for row in self.gradients(q, name):
                length = np.linalg.norm(row)
                left = row - added.T @ (added @ row)
                left -= added.T @ (added @ left)
                size = np.linalg.norm(left)
                if not (length > UNMOVED and size > INDEPENDENT * length):
                    break
                added = np.vstack([added, left / size])
            else:
                basis = added
                kept[name] = value
        # Euler parameters are held together or not at all
        whole = [layout.q[i : i + 4] for i, _ in layout.quaternion_slots]
        torn = {name for four in whole if not all(name in kept for name in four) for name in four}
        return {name: value for name, value in kept.items() if name not in torn}

    def gradients(self, q: Array, name: str) -> list[Array]:
        """Scaled gradients of a coordinate or rate: three for e0, which stands for its rotation, none for e1 .. e3."""
        layout = self.layout
        if name in layout.v:
            return [np.eye(layout.n_v)[layout.v.index(name)]]
        if name in layout.loop_rates:
            name = layout.loops[layout.loop_rates.index(name)]
        return self.system.gradients(q, name)
