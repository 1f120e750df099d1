"""States over time -> projected states, residuals, columns that are worked out when they are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsIndex, overload

import numpy as np

from ..base.algebra import Array, Indices
from ..base.scales import largest
from ..errors import too_large
from .argument_checks import plain_name, unknown
from .inputs import Forcing
from .layout import Layout

if TYPE_CHECKING:
    from .bound_model import BoundModel
    from .change_points import ChangePoint

# -- parts of a result -------------------------------------------------------------------------------------------------


class Named(list[Array]):
    """What belongs to each event, by its place or its name.

    It is a list, so that a loop over it meets the arrays; ``in``, ``keys()``, ``items()`` and ``get`` go by name.
    """

    def __init__(
        self, values: Sequence[Array], names: Sequence[str], instances: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(values)
        self.names, self.instances = tuple(names), instances or {}

    @classmethod
    def of(cls, values: Sequence[Array], header: Mapping[str, Any]) -> Named:
        """What belongs to the events of a run, by the names in its header; without names they are counted."""
        names = header.get("event_names") or [f"event_{k}" for k in range(len(values))]
        return cls(values, names, header.get("instances", {}))

    @overload
    def __getitem__(self, key: str | SupportsIndex) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> list[Array]: ...
    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            name = plain_name(key, self.instances)
            if name not in self.names:
                raise unknown("event", key, self.names)
            key = self.names.index(name)
        return super().__getitem__(key)

    def __contains__(self, name: object) -> bool:
        """Whether an event has this name; an array is in it if it is one of those here."""
        if isinstance(name, str):
            return plain_name(name, self.instances) in self.names
        return any(name is values for values in self)

    def keys(self) -> tuple[str, ...]:
        """Names of the events."""
        return self.names

    def values(self) -> list[Array]:
        """What belongs to each event."""
        return list(self)

    def items(self) -> list[tuple[str, Array]]:
        """Names, and what belongs to them."""
        return list(zip(self.names, self, strict=True))

    def get(self, name: str, default: Any = None) -> Any:
        """What belongs to the event of a name, ``default`` if there is none."""
        return self[name] if name in self else default  # noqa: SIM401  (this is that method)

    def __reduce__(self) -> tuple[Any, ...]:
        return Named, (list(self), self.names, self.instances)


class Residuals(NamedTuple):
    """Largest violation of the constraints over a run, all rows, redundant ones included."""

    raw_position: float = 0.0  #: of the integrator's states (m, rad)
    raw_velocity: float = 0.0  #: (m/s, rad/s)
    position: float = 0.0  #: of the stored, projected states
    velocity: float = 0.0
    correction_position: float = 0.0  #: largest change of a coordinate by the projection
    correction_velocity: float = 0.0  #: largest change of a velocity

    @classmethod
    def of(cls, raw: Residuals | Mapping[str, float] | Callable[[], Residuals]) -> Residuals:
        """Residuals as a run has them: themselves, by name, or a function that evaluates them."""
        if isinstance(raw, Residuals):
            return raw
        return raw() if callable(raw) else cls(**raw)


# -- columns -----------------------------------------------------------------------------------------------------------


FEW = 10_000  #: numbers at most of the raw states that are kept with a run, until its residuals are asked for
NO_RESIDUALS = Residuals()


class Columns:
    """Everything that can be read from the states of a run, evaluated when first asked for.

    The module has parameters and constant inputs bound; x (n_x, n_t) is projected, and u (n_u, n_t) may be a function
    that gives it when it is first needed.  ``steps()`` gives t, x and u of the integrator's steps, where other times
    are stored.
    """

    def __init__(
        self,
        module: BoundModel,
        t: Array,
        x: Array,
        u: Array | Callable[[], Array],
        steps: Callable[[], tuple[Array, Array, Array]] | None = None,
    ) -> None:
        self.module, self.t, self.x, self._u, self._steps = module, t, x, u, steps
        self._known: dict[str, Array] = {}
        # the first group wins: an output may repeat the coordinate of its own name, and the model may use T for its own
        self.names = column_names(module.layout)

    @cached_property
    def u(self) -> Array:
        """Inputs (n_u, n_t)."""
        return self._u() if callable(self._u) else self._u

    @cached_property
    def _groups(self) -> list[tuple[tuple[str, ...], Callable[[], Array]]]:
        layout = self.module.layout
        loops = layout.loops + layout.loop_rates + layout.loop_accelerations
        return [
            (layout.x, lambda: self.x),
            (layout.a, lambda: self.slopes[layout.n_q :]),
            (layout.parameter_rates, self._parameter_rates),
            (loops, self._loops),
            (layout.y, self._outputs),
            (layout.u, lambda: self.u),
            (("T", "V", "energy") if layout.energy_known else (), lambda: self.energies),
        ]

    def __getitem__(self, name: str) -> Array:
        if name not in self._known:
            names, evaluate = next(group for group in self._groups if name in group[0])
            for key, row in zip(names, evaluate(), strict=True):
                self._known.setdefault(key, row)
        return self._known[name]

    def _varying(self) -> Array | None:
        return self.u if self.u.size else None

    @cached_property
    def slopes(self) -> Array:
        """x' (n_x, n_t)."""
        return self.module.rhs(self.t, self.x, u=self._varying())

    def _parameter_rates(self) -> Array:
        layout = self.module.layout
        return self.slopes[[layout.q.index(name[:-4]) for name in layout.parameter_rates]]

    def _outputs(self) -> Array:
        return self.module.outputs(self.t, self.x, u=self._varying())

    def _loops(self) -> Array:
        layout = self.module.layout
        if not layout.n_loop_coordinates:
            return np.empty((0, len(self.t)))
        a = np.array([self[name] for name in layout.a])
        q, v = self.x[: layout.n_q], self.x[layout.n_q :]
        y = self.module.kernels.loop_coordinates(q, v, a, u=self._varying(), t=self.t)
        angles = layout.loop_angles
        y[0, angles] = self._unwrapped(y[0, angles], angles)
        parameters = [k for k, kind in enumerate(layout.loop_kinds) if kind == "parameter"]
        for k in range(0, len(parameters), 4):  # e and -e are one rotation: the nearer one goes on
            four = parameters[k : k + 4]
            e = y[0, four]
            turns = np.where((e[:, 1:] * e[:, :-1]).sum(axis=0) < 0.0, -1.0, 1.0)
            y[:, four] *= np.concatenate([[1.0], np.cumprod(turns)])
        return y.reshape(3 * layout.n_loop_coordinates, -1)

    def _unwrapped(self, result: Array, angles: Array) -> Array:
        """Angles of cut joints (k, n_t), whose turns count along the steps of the run, whatever times are stored."""
        passed = self._passed() if len(angles) else None
        if passed is None:
            return np.unwrap(result, axis=-1)
        t, x, u, order = passed
        n = self.module.layout.n_q
        kernel = self.module.kernels.loop_coordinates
        between = kernel(x[:n], x[n:], np.zeros_like(x[n:]), u=u if u.size else None, t=t)[0, angles]
        turned = np.empty((len(angles), len(order)))
        turned[:, order] = np.unwrap(np.concatenate([between, result], axis=-1)[:, order], axis=-1)
        return turned[:, len(t) :]

    def _passed(self) -> tuple[Array, Array, Array, Indices] | None:
        """t, x and u that the run passed besides those stored, and the order of both together; None if not kept."""
        t, x, u = (self.t[:0],) * 3 if self._steps is None else self._steps()
        forward = 1.0 if len(t) and t[-1] >= t[0] else -1.0
        order = np.argsort(forward * np.concatenate([t, self.t]), kind="stable")
        return (t, x, u, order) if len(t) else None

    @property
    def has_energies(self) -> bool:
        """Whether the model knows its energy."""
        return self.module.layout.energy_known

    @cached_property
    def energies(self) -> Array:
        """Kinetic, potential and total energy (3, n_t), whatever the model calls T and V."""
        T, V = self.module.energy(self.x, u=self._varying(), t=self.t)
        return np.array([T, V, T + V])

    @cached_property
    def change_points(self) -> list[ChangePoint]:
        """Where the mobility changes on the way."""
        from .change_points import find_change_points

        t, x, u = (self.t, self.x, self.u) if self._steps is None else self._steps()
        if self._steps is not None and not len(t):
            raise too_large(
                "the run took too many steps to keep all of them besides t_eval; for its change points run it without "
                "t_eval, or in parts"
            )
        return find_change_points(self.module, t, x, u)


@lru_cache(maxsize=64)
def column_names(layout: Layout) -> tuple[str, ...]:
    """All columns, each once."""
    cut = layout.loops + layout.loop_rates + layout.loop_accelerations
    energies = ("T", "V", "energy") if layout.energy_known else ()
    return tuple(dict.fromkeys(layout.x + layout.a + layout.parameter_rates + cut + layout.y + layout.u + energies))


@lru_cache(maxsize=64)
def units_of_layout(layout: Layout) -> dict[str, str]:
    """Units of all columns, by name."""
    return {name: layout.unit(name) for name in ("t", *column_names(layout)) if layout.unit(name)}


def describe(module: BoundModel) -> dict[str, Any]:
    """What the columns of any run of a module are called, where it comes from, and its parameters."""
    known = {**_described(module.layout), "parameters": dict(module._parameters)}
    from .identity import origin

    return known | {"origin": origin(module)}


@lru_cache(maxsize=64)
def _described(layout: Layout) -> dict[str, Any]:
    return {
        "name": layout.name,
        "q_names": list(layout.q),
        "v_names": list(layout.v[: layout.moving]),
        **({"s_names": list(layout.states)} if layout.states else {}),
        "x_names": list(layout.x),
        "loop_names": list(layout.loops),
        "y_names": list(layout.y),
        "u_names": list(layout.u),
        "model_method": layout.info.method,
        "docs": layout.info.docs,
        "latex": layout.info.latex,
        **({"printed": layout.info.printed} if layout.info.printed else {}),
        "instances": layout.info.instances,
    }


def project(
    module: BoundModel, t: Array, raw: Array, forcing: Forcing | None = None
) -> tuple[Residuals | Callable[[], Residuals], Array]:
    """Projected states (n_x, k), and how far the raw ones were off, with the inputs of the run as they are then.

    Of a short run the residuals are a function, which evaluates them when they are first asked for.
    """
    if not t.size or not (module.n_rows or module.layout.space):
        return NO_RESIDUALS, raw
    led = forcing is not None and forcing.constrained
    u = forcing.sample(t, raw) if led and forcing is not None else None
    x = module.project(raw, t, None, u)
    if not module.n_rows:
        return NO_RESIDUALS, x
    here = u
    if led and forcing is not None and forcing.feedback:
        here = forcing.sample(t, x)
        x = module.project(x, t=t, u=here)
    if raw.size <= FEW and u is None:
        return partial(_residuals, module, t.copy(), raw), x  # the user may change what he is given
    return _residuals(module, t, raw, x, u, here), x


def _residuals(
    module: BoundModel, t: Array, raw: Array, x: Array | None = None, u: Array | None = None, here: Array | None = None
) -> Residuals:
    """How far raw states and projected ones are from the constraints, at the inputs of each."""
    n = module.n_q
    x = module.project(raw, t) if x is None else x
    position, velocity = module.kernels.constraints, module.kernels.velocity_constraints
    correction = np.abs(x - raw)
    for i, _ in module.layout.quaternion_slots:  # their length means nothing
        e = raw[i : i + 4]
        correction[i : i + 4] = np.abs(x[i : i + 4] - e / np.sqrt((e * e).sum(axis=0)))
    return Residuals(
        raw_position=largest(position(raw[:n], t=t, u=u)),
        raw_velocity=largest(velocity(raw, t=t, u=u)),
        position=largest(position(x[:n], t=t, u=here)),
        velocity=largest(velocity(x, t=t, u=here)),
        correction_position=largest(correction[:n]),
        correction_velocity=largest(correction[n:]),
    )
