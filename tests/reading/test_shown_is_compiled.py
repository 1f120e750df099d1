"""Every quantity that is shown, evaluated through SymPy, against the compiled module at random consistent states.

All examples with the method that is chosen for them; every method with one example of each kind: an open chain, a loop
with force elements, rolling (nonholonomic), motion over time, Euler parameters.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shown_numbers import LONG, evaluate, number, random_state, state_values
from sweeps import part_of

import eomgen as eg
from eomgen.equations import METHODS

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(path.stem for path in EXAMPLES.glob("*.yaml"))
KINDS = ("double_pendulum", "slider_crank", "rolling_disc", "car_axis", "satellite")
OTHERS = [method for method in METHODS if method != "embedding"]
MATRICES = ("mass_matrix", "constraint_jacobian", "velocity_transformation", "poses", "body_mass_matrix")
MATRICES += ("body_velocity_transformation",)
CLOSE = 1e-10


def agree(shown: object, wanted: object, size: float = 0.0) -> None:
    """Equal to 1e-10 of the largest entry, or of the size of the terms that they are sums of."""
    shown, wanted = np.asarray(shown, dtype=float), np.asarray(wanted, dtype=float)
    assert shown.shape == wanted.shape
    largest = max(np.abs(wanted).max(initial=0.0), size, 1e-12)
    assert np.abs(shown - wanted).max(initial=0.0) <= CLOSE * largest


class Compared:
    """Equations, their module and one state with its numbers."""

    def __init__(self, name: str, method: str = "auto", seed: int = 7) -> None:
        self.model = eg.load(EXAMPLES / f"{name}.yaml")
        self.equations = self.model.derive(method)
        self.module: Any = self.equations.compile(target="numpy")
        self.x = random_state(self.module, seed)
        self.values = state_values(self.module, self.x, 0.0)
        n = self.module.n_q + self.module.n_v
        self.q, self.v = self.x[: self.module.n_q], self.x[self.module.n_q : n]
        self.a = self.module.rhs(0.0, self.x)[self.module.n_q : n]
        self.free = self.module.layout.independent_moving.tolist()

    def shown(self, name: str, part: str | None = None) -> Any:
        """The number, vector or matrix of a quantity."""
        found = number(self.equations, name, self.values, part)
        return found if np.ndim(found) < 2 or name in MATRICES else found[:, 0]


def compare_motion(c: Compared) -> None:
    """Energies, the equations of motion and their parts."""
    T, V = c.module.energy(c.x)
    for name, wanted in (("T", T), ("V", V), ("lagrangian", T - V)):
        agree(c.shown(name), wanted, abs(T) + abs(V))
    mass = c.shown("mass_matrix")
    agree(mass, c.module.embedded_mass_matrix(c.q))
    force, Q, Q_v = (c.shown(name) for name in ("force", "generalized_forces", "quadratic_velocity"))
    agree(force, mass @ c.a[c.free], np.abs(mass * c.a[c.free]).max(initial=0.0))
    agree(Q + Q_v, force, np.abs(Q).max(initial=0.0) + np.abs(Q_v).max(initial=0.0))
    parts = c.equations.generalized_forces.parts
    each = evaluate(c.equations.written("generalized_forces")[0], [x for p in parts.values() for x in p], c.values)
    agree(each.reshape(len(parts), c.module.n_dof).sum(axis=0), Q)
    moved = c.module.mass_matrix(c.q) @ c.v
    agree(c.shown("momenta"), moved)


def compare_constraints(c: Compared) -> None:
    """Constraints, their derivatives, and the dependent velocities."""
    module, scale = c.module, c.equations.mobility.length_scale
    agree(c.shown("constraints"), module.constraints(c.q), max(1.0, scale))
    C_q = module.constraint_jacobian(c.q)
    agree(c.shown("constraint_jacobian"), C_q)
    agree(c.shown("velocity_constraints"), module.velocity_constraints(c.x), np.abs(C_q * c.v).max(initial=0.0))
    agree(c.shown("gamma"), -C_q @ c.a, np.abs(C_q * c.a).max(initial=0.0))
    B = c.shown("velocity_transformation")
    agree(B @ c.v[c.free] + c.shown("velocity_offset"), c.v)
    agree(B @ c.a[c.free] + c.shown("acceleration_offset"), c.a, np.abs(c.a).max())


def compare_bodies(c: Compared) -> None:
    """Poses, and M = B_b^T M_b B_b where drives have no inertia."""
    poses = c.module.poses(c.q)
    for k, body in enumerate(c.module.body_names):
        agree(c.shown("poses", body), poses[k])
    if all(spec.armature is None for spec in c.equations.kinematics.mechanism.joints):
        B, M = c.shown("body_velocity_transformation"), c.shown("body_mass_matrix")
        agree(B.T @ M @ B, c.module.embedded_mass_matrix(c.q))


@pytest.mark.parametrize("name", part_of(NAMES, lambda name: name not in (*LONG, "spatial_four_bar", "peaucellier")))
def test_of_every_example(name: str) -> None:
    c = Compared(name)
    compare_motion(c)
    compare_constraints(c)
    compare_bodies(c)


@pytest.mark.parametrize("method", OTHERS)
@pytest.mark.parametrize("name", KINDS)
def test_of_every_method(name: str, method: str) -> None:
    compare_motion(Compared(name, method))


def _with_motion_of(model: Any, place: str) -> list[str]:
    """Outputs of the motion of a body or marker, in the order of ``velocities`` and ``accelerations``."""
    words = [*(f"w{a}" for a in "xyz"), *(f"v{a}" for a in "xyz"), *(f"w{a}_dot" for a in "xyz")]
    words += [f"a{a}" for a in "xyz"]
    names = [f"{word}_of_it" for word in words]
    for name, word in zip(names, words, strict=True):
        model.output(name, f"{word}({place})")
    return names


@pytest.mark.parametrize(
    ("name", "place"),
    [("slider_crank", "rod.tip"), ("slider_crank", "rod"), ("rolling_disc", "disc"), ("satellite", "hub")],
)
def test_velocities_and_accelerations(name: str, place: str) -> None:
    model = eg.load(EXAMPLES / f"{name}.yaml")
    if place not in model.derive().poses:
        place = next(iter(model.derive().poses))
    names = _with_motion_of(model, place)
    equations = model.derive()
    module: Any = equations.compile(target="numpy")
    x = random_state(module, 5)
    values = state_values(module, x, 0.0)
    wanted = dict(zip(module.y_names, module.outputs(0.0, x), strict=True))
    wanted = np.array([wanted[name] for name in names]).reshape(4, 3)
    for name, (angular, linear) in (("velocities", wanted[:2]), ("accelerations", wanted[2:])):
        found = number(equations, name, values, place)
        agree(found[0], angular)
        agree(found[1], linear)
