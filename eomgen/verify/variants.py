"""The same mechanism described differently -> how far its accelerations differ.

Each change is a function of a Mechanism.  Coordinates keep their names and meaning, so the same state gives the same
accelerations, by whatever method, target, frames of bodies and cuts of loops they were derived.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import pipeline
from ..elements.frames import GROUND, Frame, Marker
from ..elements.rotations import matrix_from_euler_parameters, normalize_quaternion
from ..errors import EomgenError, ToolchainError
from ..expr import vectors as vec
from ..expr.core import copied
from ..expr.vectors import Mat3, Vec3
from ..mechanics.methods import METHODS
from ..mechanics.topology import Topology, find_topology
from ..model.mechanism import Body, Mechanism
from ..reading.derivation import Derivation, derive_mechanism
from ..runtime.bound_model import BoundModel
from .check_bodies import true_accelerations
from .finding import NOT_REACHED, Comparison, Finding, failed

if TYPE_CHECKING:
    from ..base.algebra import Array
    from .checked import CheckedModel
    from .random_states import SystemState

SHIFT = 0.5  #: of the frames of bodies, in lengths of the model


class NotApplicable(Exception):
    """The change has no meaning for this model; the text says why."""


def variant_findings(model: CheckedModel, seconds: float, seed: int = 0) -> list[Finding]:
    """Every change that applies to a model, one finding each.

    Parameters
    ----------
    seconds : float
        Time after which the changes that remain are left out, each with a note.
    seed : int
        Of the turns of frames, and of which joint is cut.
    """
    end = perf_counter() + seconds
    target = model.module.info.target
    changes: dict[str, Callable[[], BoundModel]] = {
        "body frames turned": partial(_turned, model, seed),
        "another joint cut": partial(_cut_another, model, seed),
        **{f"method {name}": partial(_derived, model, name) for name in METHODS if name != model.equations.method},
        "target numpy": partial(_interpreted, model, target),
    }
    result = []
    for name, change in changes.items():
        check = f"variants: {name}"
        if perf_counter() > end:
            result.append(Finding.skipped(check, f"{NOT_REACHED} in {seconds:g} s"))
            continue
        try:
            result.append(_compared(model, check, change()))
        except (NotApplicable, ToolchainError) as why:
            result.append(Finding.skipped(check, str(why)))
        except (EomgenError, ArithmeticError, LookupError) as error:  # though the model itself was not refused
            result.append(failed(check, error))
    return result


def _compared(model: CheckedModel, check: str, other: BoundModel) -> Finding:
    """Accelerations of another module at the states of this one, against those found in many digits."""
    result = Comparison(check)
    if other.n_dof != model.module.n_dof:
        note = f"{other.n_dof} degrees of freedom instead of {model.module.n_dof}"
        return Finding(check, np.inf, 0.0, note=note)
    for k, truth in enumerate(model.truths):
        try:
            a, limit, size = true_accelerations(model, k)
        except ZeroDivisionError:
            return Finding.skipped(check, "the system of accelerations and multipliers is singular")
        case, names = truth.case, model.layout.v
        x = _state_of(model, case, other)
        rates = dict(zip(other.layout.v, other.rhs(case.t, x, **case.values)[other.n_q :], strict=True))
        shared = [i for i, name in enumerate(names) if name in rates]
        actual = np.array([rates[names[i]] for i in shared])
        result.add(k, actual - a[shared], limit[shared], size, [f"{names[i]}'" for i in shared])
    return result.finding()


def _state_of(model: CheckedModel, case: SystemState, other: BoundModel) -> Array:
    """A state in the coordinates of another module, those of joints that are cut here among them."""
    values = dict(zip(model.module.x_names, case.x.tolist(), strict=True))
    loops = model.layout.loops
    if loops:
        cut = model.call("loop_coordinates", case).reshape(3, -1)
        for name, place, rate in zip(loops, *cut[:2].tolist(), strict=True):
            values |= {name: place, f"{name}_dot": rate}
    if lacking := [name for name in other.x_names if name not in values]:
        raise NotApplicable(f"{', '.join(lacking)} cannot be determined from the coordinates here")
    return np.array([values[name] for name in other.x_names])


def _made(mechanism: Mechanism, method: str) -> BoundModel:
    derived = derive_mechanism(Derivation, mechanism, method)
    return BoundModel(pipeline.compile_core(derived, "numpy", ["rhs"]))


def _copy(model: CheckedModel) -> Mechanism:
    return copied(model.mechanism)


def _derived(model: CheckedModel, method: str) -> BoundModel:
    if model.mechanism.bare:
        raise NotApplicable("the equations are given")
    return _made(_copy(model), method)


def _interpreted(model: CheckedModel, target: str) -> BoundModel:
    if target == "numpy":
        raise NotApplicable("the module is of target numpy itself; verify one of target cython")
    return _made(_copy(model), model.equations.method)


# -- frames of bodies --------------------------------------------------------------------------------------------------
def _turned(model: CheckedModel, seed: int) -> BoundModel:
    """Every body's frame turned by any angle about any axis, and shifted."""
    mechanism, random = _copy(model), np.random.default_rng(seed)
    if not mechanism.bodies:
        raise NotApplicable("there are no bodies")
    graph, size = mechanism.graph, SHIFT * float(model.module.info.length_scale or 1.0)
    places = {
        k: Frame(
            vec.matrix(graph, matrix_from_euler_parameters(normalize_quaternion(random.normal(size=4))).tolist()),
            vec.vector(graph, (size * random.uniform(-1.0, 1.0, 3)).tolist()),
        )
        for k in range(len(mechanism.bodies))
    }
    bodies = tuple(_described_in(body, places[k]) for k, body in enumerate(mechanism.bodies))
    unseen = replace(mechanism.presentation, body_shapes=())
    made = _Moved(places).of(replace(mechanism, bodies=(), presentation=unseen))
    return _made(replace(made, bodies=bodies), model.equations.method)


def _point(place: Frame, at: Vec3) -> Vec3:
    return vec.transpose_times(place.rotation, vec.sub(at, place.position))


def _described_in(body: Body, place: Frame) -> Body:
    """A body in other axes: R^T (c - d), R^T I R."""
    back = vec.transpose(place.rotation)

    def tensor(rows: Mat3) -> Mat3:
        return vec.product(vec.product(back, rows), place.rotation)

    return replace(
        body,
        com=_point(place, body.com),
        inertia=tensor(body.inertia),
        moment=None,
        inertia_origin=None,
        about=None if body.about is None else _point(place, body.about),
        plane=None if body.plane is None else vec.times(back, body.plane),
    )


class _Moved:
    """Whatever holds markers -> the same with the markers of turned bodies where they were."""

    def __init__(self, places: Mapping[int, Frame]) -> None:
        self.places = places

    def of(self, x: Any) -> Any:
        if isinstance(x, Marker):
            return self._marker(x)
        if isinstance(x, tuple):
            parts = [self.of(part) for part in x]
            return tuple.__new__(type(x), parts) if any(a is not b for a, b in zip(parts, x, strict=True)) else x
        if isinstance(x, dict):
            return {key: self.of(part) for key, part in x.items()}
        if is_dataclass(x) and not isinstance(x, type):
            values = {f.name: getattr(x, f.name) for f in fields(x)}
            changed = {name: new for name, old in values.items() if (new := self.of(old)) is not old}
            return replace(x, **changed) if changed else x
        return x

    def _marker(self, marker: Marker) -> Marker:
        if marker.body == GROUND:
            return marker
        place, frame = self.places[marker.body], marker.frame
        turn = vec.product(vec.transpose(place.rotation), frame.rotation)
        return replace(marker, frame=Frame(turn, _point(place, frame.position)))


# -- cuts --------------------------------------------------------------------------------------------------------------
def _cut_another(model: CheckedModel, seed: int) -> BoundModel:
    """Of a loop another joint is cut: the only one of it whose coordinates the user did not name."""
    mechanism, topology = _copy(model), model.kinematics.topology
    joints = mechanism.joints
    able = [k for cut in topology.cut for k in _way_round(mechanism, topology, cut) if joints[k].joint.role == "either"]
    for chosen in np.random.default_rng(seed).permutation(able).astype(int).tolist():
        named = tuple(replace(joint, named=k != chosen) for k, joint in enumerate(joints))
        made = replace(mechanism, joints=named, independent=())
        if chosen in find_topology(made).cut:
            return _made(made, model.equations.method)
    raise NotApplicable("no loop has another joint that can be cut")


def _way_round(mechanism: Mechanism, topology: Topology, cut: int) -> list[int]:
    """The joints of the tree between the ends of a cut joint."""
    above = {branch.body: branch for branch in topology.branches}

    def down(body: int) -> list[int]:
        result = []
        while body != GROUND:
            result.append(above[body].joint)
            body = above[body].parent
        return result

    first, second = (down(end.body) for end in (mechanism.joints[cut].predecessor, mechanism.joints[cut].successor))
    return [k for k in (*first, *second) if (k in first) != (k in second)]
