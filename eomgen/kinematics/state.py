"""Stage kinematics: Topology -> the layout of q and v, and q' = N(q) v."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from ..describe.mechanism import Mechanism
from ..frames import GROUND
from ..graph.core import Expr, Graph
from ..graph.differentiate import jacobian
from ..joints import QuaternionSlot
from ..joints.rotation_coordinates import parameter_rates
from ..records import dataclass
from .topology import Topology


def acceleration_name(velocity: str) -> str:
    """``theta_dot`` -> ``theta_ddot``; ``ball_wx`` -> ``ball_wx_dot``."""
    return velocity[:-4] + "_ddot" if velocity.endswith("_dot") else velocity + "_dot"


@dataclass(frozen=True)
class StateLayout:
    """Names and kinds of the tree's coordinates and velocities.

    ``parent`` is per velocity the branch-induced parent (Featherstone, RBDA, sec. 6.4); ``quaternion_slots`` says where
    Euler parameters are, the other velocities being the rates of the other coordinates in the same order.  ``given`` is
    q' of given equations where it is not v itself.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    velocity_names: tuple[str, ...]
    velocity_kinds: tuple[str, ...]
    parent: tuple[int, ...]
    quaternion_slots: tuple[QuaternionSlot, ...] = ()
    given: tuple[Expr, ...] = ()

    def rates(self, graph: Graph, q: Sequence[Expr], v: Sequence[Expr]) -> tuple[Expr, ...]:
        """q' = N(q) v."""
        if self.given:
            return self.given
        if not self.quaternion_slots:
            return tuple(v)
        turning = {k for slot in self.quaternion_slots for k in range(slot.velocity, slot.velocity + 3)}
        plain = iter([x for k, x in enumerate(v) if k not in turning])
        starts = {slot.coordinate: slot.velocity for slot in self.quaternion_slots}
        result: list[Expr] = []
        while len(result) < len(q):
            i = len(result)
            if i in starts:
                result += parameter_rates(q[i : i + 4], v[starts[i] : starts[i] + 3])
            else:
                result.append(next(plain))
        return tuple(result)


@dataclass(frozen=True)
class MotionSymbols:
    """The symbols of the motion: coordinates, velocities, accelerations, time; and q' in terms of them."""

    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    a: tuple[Expr, ...]
    t: Expr
    rates: tuple[Expr, ...]
    clock: Mapping[Expr, Expr]  #: t' = 1, and the rates of the inputs
    in_order: bool = True  #: whether velocities are rates of coordinates, or angular velocities: not so if given

    @cached_property
    def along(self) -> dict[Expr, Expr]:
        """The direction of d/dt: q' = N v, v' = a, t' = 1, and the rates of the inputs."""
        flow = dict(zip(self.q, self.rates, strict=True)) | dict(zip(self.v, self.a, strict=True))
        return {**flow, **self.clock}

    def slopes(self, values: Sequence[Expr], rates: Sequence[Expr]) -> dict[tuple[int, int], Expr]:
        """Derivatives by v of the rates of functions of q: df/dq N."""
        if self.rates == self.v:
            return jacobian(list(values), list(self.q))
        return jacobian(list(rates), list(self.v))


def lay_out(mechanism: Mechanism, topology: Topology) -> StateLayout:
    """The coordinates and velocities of the tree, in its order."""
    if mechanism.lagrangian is not None:
        names = mechanism.lagrangian.coordinates
        kinds = ("angle",) * len(names)
        return StateLayout(names, kinds, tuple(n + "_dot" for n in names), kinds, tuple(range(-1, len(names) - 1)))
    if mechanism.given is not None:
        given, n = mechanism.given, len(mechanism.given.velocities)
        rates = () if given.rates == tuple(map(mechanism.graph.symbol, given.velocities)) else given.rates
        angles, turns = ("angle",) * len(given.coordinates), ("angle",) * n
        return StateLayout(given.coordinates, angles, given.velocities, turns, tuple(range(-1, n - 1)), given=rates)
    names_list: list[str] = []
    kinds_list: list[str] = []
    velocity_names: list[str] = []
    velocity_kinds: list[str] = []
    parent: list[int] = []
    quaternion_slots: list[QuaternionSlot] = []
    last = {GROUND: -1}  # the velocity next to a body towards ground
    for branch in topology.branches:
        spec = mechanism.joints[branch.joint]
        quaternion_slots += [
            QuaternionSlot(len(names_list) + i, len(velocity_names) + j) for i, j in spec.joint.quaternion_slots
        ]
        names_list += spec.coordinates
        kinds_list += [coordinate.kind for coordinate in spec.joint.coordinates]
        above = last[branch.parent]
        for name, velocity in zip(spec.velocities, spec.joint.velocities, strict=True):
            parent.append(above)
            above = len(velocity_names)
            velocity_names.append(name)
            velocity_kinds.append(velocity.kind)
        last[branch.body] = above
    return StateLayout(
        tuple(names_list),
        tuple(kinds_list),
        tuple(velocity_names),
        tuple(velocity_kinds),
        tuple(parent),
        tuple(quaternion_slots),
    )
