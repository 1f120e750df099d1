"""What holds of any mechanism: balance of every body and of power, derivatives, methods, targets, other descriptions.

Thirty mechanisms of each property run always, a thousand by ``make thorough``.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache
from math import inf
from time import perf_counter
from typing import Any

import judges
import numpy as np
import pytest
from hypothesis import Phase, given, reject, seed, settings
from hypothesis import strategies as st
from models import IN_C
from random_models import (
    ANCHOR,
    AXES,
    BALL,
    CLOSING,
    CONTACT,
    CORNER,
    DAMPING,
    DEPTH,
    FLOOR,
    FREE_LENGTH,
    PUSH,
    SLIDING,
    SPATIAL,
    SPHERE,
    STIFFNESS,
    STOP,
    TIME,
    TIP,
    TWIST,
    Clothes,
    Made,
    Recipe,
    basis,
    gamma,
    mechanisms,
    random_recipe,
)
from scipy.linalg import null_space
from sweeps import METHODS, part_of

import eomgen as eg

SHRINKING = 30.0  #: s
BATCHES = [0, *(pytest.param(k, marks=pytest.mark.thorough) for k in range(1, 34))]


def for_each(batch: int, check: Callable[..., None], *more: Any, count: int = 30) -> None:
    """Thirty mechanisms; those of a batch are the same for all properties of one mechanism, and built once.

    A smaller one than the first that fails is sought for half a minute.
    """
    failed: set[Any] = set()
    end = inf

    def judged(case: tuple[Any, ...]) -> None:
        nonlocal end
        if perf_counter() > end and case not in failed:
            reject()
        try:
            check(*case)
        except (AssertionError, ArithmeticError, LookupError, eg.EomgenError):
            failed.add(case)
            end = min(end, perf_counter() + SHRINKING)
            raise

    options = settings(max_examples=count, phases=[Phase.generate, Phase.shrink], print_blob=False)
    seed(batch)(options(given(st.tuples(mechanisms(), *more))(judged)))()


@lru_cache(maxsize=64)  # of two batches: all take gigabytes
def compiled(recipe: Recipe) -> tuple[Made, Any]:
    """The mechanism, with its module; where a screw was to be cut and another joint is, its recipe says so."""
    made = Made(recipe)
    try:
        module = made.compile()
    except eg.ModelError as why:  # its loop holds what is driven; a screw stays, and a law has the angle that is cut
        assert any(words in str(why) for words in ("the driver has no effect", "only known up to full turns"))
        reject()
    cut = [k for k, name in enumerate(made.loop) if name in module.metadata["loop_joint_names"]]
    if not cut or recipe.cut in cut:
        return made, module
    assert made.kind(recipe.cut) == "screw"
    return compiled(replace(recipe, cut=cut[0]))


def sized(a: np.ndarray) -> float:
    return float(np.abs(a).max(initial=0.0))


class Balance:
    """Loads on the bodies of a mechanism as it is made, and what moves them, from outside."""

    def __init__(self, recipe: Recipe, which: int = 0) -> None:
        self.made, self.module = compiled(recipe)
        made, module = self.made, self.module
        self.recipe = recipe = made.recipe
        self.x = made.state(module, which)
        self.motion = made.motion(module, self.x)
        self.wrenches = np.zeros((len(recipe.kinds), 6))  # about the bodies' origins
        self.power = 0.0  # of all that is not in the energy
        self.tau = np.zeros(module.n_v)  # along coordinates
        self.columns = {name: k for k, name in enumerate(module.v_names)}
        self.singles = [self.columns[f"{name}_dot"] for name in recipe.single]
        for kind in recipe.forces:
            getattr(self, kind, lambda: None)()
        labels = [label.partition(".")[0] for label in module.constraint_labels]
        self.multipliers: dict[str, list[float]] = {label: [] for label in labels}
        for label, multiplier in zip(labels, module.multipliers(TIME, self.x), strict=True):
            self.multipliers[label].append(multiplier)
        for kind in recipe.constraints:
            getattr(self, kind)()

    def point(self, body: int, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Its place and velocity."""
        if body < 0:
            return at, np.zeros(3)
        m = self.motion
        arm = m.R[body] @ at
        return m.r[body] + arm, m.r_dot[body] + np.cross(m.w[body], arm)

    def load(self, body: int, place: np.ndarray, force: np.ndarray, torque: np.ndarray | float = 0.0) -> None:
        if body >= 0:
            arm = place - self.motion.r[body]
            self.wrenches[body] += np.concatenate([force, torque + np.cross(arm, force)])

    def push_at(self, body: int, at: np.ndarray, force: np.ndarray) -> None:
        place, rate = self.point(body, at)
        self.load(body, place, force)
        self.power += float(force @ rate)

    def along(self, k: int, force: float) -> None:
        self.tau[k] += force
        self.power += force * self.motion.v[k]

    # -- forces
    def _reach(self) -> tuple[np.ndarray, float, np.ndarray]:
        place, rate = self.point(self.recipe.last, TIP)
        length = float(np.linalg.norm(place - ANCHOR))
        return (place - ANCHOR) / length, length, rate

    def spring(self) -> None:
        along, length, _ = self._reach()
        self.load(self.recipe.last, self.point(self.recipe.last, TIP)[0], -STIFFNESS * (length - FREE_LENGTH) * along)

    def damper(self) -> None:
        along, _, rate = self._reach()
        self.push_at(self.recipe.last, TIP, -DAMPING * float(along @ rate) * along)

    def push(self) -> None:
        self.push_at(0, CORNER, self.motion.R[0] @ PUSH)

    def twist(self) -> None:
        body = self.recipe.last // 2
        torque = self.motion.R[body] @ TWIST
        self.load(body, self.motion.r[body], np.zeros(3), torque)
        self.power += float(torque @ self.motion.w[body])

    def state(self) -> None:
        z = self.x[self.module.x_names.index("z")]
        self.push_at(0, TIP, np.array([z, 0.0, 2.0 * z]))

    def joint_spring(self) -> None:
        for name, k in zip(self.recipe.single, self.singles, strict=True):
            self.tau[k] -= 3.0 * (self.motion.q[self.module.q_names.index(name)] - 0.2)

    def joint_damper(self) -> None:
        for k in self.singles:
            self.along(k, -0.4 * self.motion.v[k])

    def armature(self) -> None:
        """Its kinetic energy is in that of the module."""
        for name, k in zip(self.recipe.single, self.singles, strict=True):
            if self.made.joints[name][0] != self.recipe.closing:
                self.tau[k] -= 0.3 * self.motion.a[k]

    def stop(self) -> None:
        for name, k in zip(self.recipe.single, self.singles, strict=True):
            depth = max(self.motion.q[self.module.q_names.index(name)], 0.0)
            elastic = STOP["stiffness"] * depth**1.5
            self.tau[k] -= elastic  # whose energy is in that of the module
            self.along(k, -elastic * max(STOP["dissipation"] * self.motion.v[k], -1.0))

    def contact(self) -> None:
        """Hunt and Crossley's force and regularized Coulomb friction in the middle of the overlap."""
        plane, ball = self.made.floor, self.recipe.last
        R = (self.motion.R[plane] if plane >= 0 else np.eye(3)) @ FLOOR
        normal, centre = R[:, 2], self.point(ball, TIP)[0]
        depth = SPHERE - float(normal @ (centre - self.point(plane, DEPTH)[0]))
        if depth <= 0.0:
            return
        place = centre - (SPHERE - depth / 2) * normal
        v = self.rate_at(ball, place) - self.rate_at(plane, place)
        along, elastic = float(normal @ v), CONTACT["stiffness"] * depth**1.5
        sliding, pressed = v - along * normal, elastic * max(0.0, 1.0 - CONTACT["dissipation"] * along)
        force = pressed * (normal - CONTACT["friction"] * sliding / np.sqrt(sliding @ sliding + SLIDING**2))
        self.load(ball, place, force)
        self.load(plane, place, -force)
        self.power += float((force - elastic * normal) @ v)

    def rate_at(self, body: int, place: np.ndarray) -> np.ndarray:
        """The velocity of the body where it is at a place."""
        m = self.motion
        return m.r_dot[body] + np.cross(m.w[body], place - m.r[body]) if body >= 0 else np.zeros(3)

    # -- constraint elements
    def driver(self) -> None:
        self.along(self.singles[0], -self.multipliers["driver"][0])

    def coupling(self) -> None:
        self.along(self.singles[-1], -self.multipliers["coupling"][0])
        self.along(self.singles[-2], 0.5 * self.multipliers["coupling"][0])

    def velocities(self) -> None:
        b = self.motion.q[self.module.q_names.index(self.recipe.single[-2])]
        self.along(self.singles[-1], -self.multipliers["velocities"][0])
        self.along(self.singles[-2], (1.0 + b**2) * self.multipliers["velocities"][0])

    def switched(self) -> None:
        self.along(self.singles[-1], -self.module.outputs(TIME, self.x)[0])

    def open(self) -> None:
        assert self.module.outputs(TIME, self.x)[0] == 0.0

    def rolling(self) -> None:
        """A force where the ball touches: along the normal, and two along the plane."""
        place = self.point(self.recipe.last, TIP)[0] - BALL * FLOOR[:, 2]
        self.load(self.recipe.last, place, -FLOOR @ np.roll(self.multipliers["rolling"], -1))
        assert sized(self.rate_at(self.recipe.last, place)) <= 1e-9

    def knife_edge(self) -> None:
        m, body = self.motion, self.recipe.last
        axis = m.R[body][:, 1]
        if "knife_edge" in self.multipliers:
            self.push_at(body, TIP, -self.multipliers["knife_edge"][0] * axis)
        else:  # its row holds identically: the edge cannot move sideways
            assert sized(axis @ (m.J_r[body] + np.cross(m.J_w[body], (m.R[body] @ TIP)[:, None], axis=0))) <= 1e-12

    # -- joints
    def relative(self, name: str, among: Iterable[int] | None = None) -> tuple[np.ndarray, list[int]]:
        """Velocity of S against P at S and angular velocity for a unit of each velocity (6, k), of the joint or all."""
        _, i, _, j, S = self.made.joints[name]
        m, place = self.motion, self.point(j, S.position)[0]
        its = (k for label, k in self.columns.items() if label == f"{name}_dot" or label.startswith(f"{name}_"))
        columns = [*(its if among is None else among)]
        result = np.zeros((6, len(columns)))
        for body, sign in ((j, 1.0), (i, -1.0)):
            if body >= 0:
                turn = m.J_w[body][:, columns]
                result[:3] += sign * (m.J_r[body][:, columns] + np.cross(turn, (place - m.r[body])[:, None], axis=0))
                result[3:] += sign * turn
        return result, columns

    def drive(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Wrench of what acts along a joint's coordinates, torques for angles and forces for lengths; its motions."""
        kind, i, P, *_ = self.made.joints[name]
        motors = self.made.motors
        if name in self.module.metadata["loop_joint_names"]:
            R, wrench = (self.motion.R[i] if i >= 0 else np.eye(3)) @ P.rotation, np.zeros(6)
            for ending, (axis, length) in AXES.get(kind, {}).items():
                first = 0 if length else 3
                wrench[first : first + 3] += motors.get(name + ending, 0.0) * R[:, axis]
            return wrench, np.zeros((6, 0))
        moves, columns = self.relative(name)
        tau, basis = self.tau[columns].copy(), moves.copy()
        for c, k in enumerate(columns):
            tau[c] += motors.get(self.module.v_names[k].removesuffix("_dot"), 0.0)
            length = self.module.metadata["velocity_kinds"][k] == "length"
            basis[3:, c] *= not length
            basis[:3, c] *= length
        return basis @ np.linalg.solve(moves.T @ basis, tau) if columns else np.zeros(6), moves

    def exert_by_joints(self) -> float:
        """Load the bodies with the reactions and drives of joints; the size of the forces."""
        reactions = dict(zip(self.module.joint_names, self.module.reactions(TIME, self.x), strict=True))
        drives = {name: self.drive(name) for name in reactions}
        size = max(1.0, *map(sized, (self.wrenches, *reactions.values(), *(drive for drive, _ in drives.values()))))
        for name, reaction in reactions.items():
            _, i, _, j, S = self.made.joints[name]
            drive, moves = drives[name]
            place, whole = self.point(j, S.position)[0], reaction + drive
            self.load(j, place, whole[:3], whole[3:])
            self.load(i, place, -whole[:3], -whole[3:])
            assert sized(reaction @ moves) <= 1e-9 * size * max(1.0, sized(moves))
        return size

    def needed(self) -> np.ndarray:
        """What must act on each body about its origin, by Newton and Euler."""
        m, numbers, needed = self.motion, self.made.numbers, []
        for k, mass in enumerate(numbers.masses):
            arm, tensor = m.R[k] @ numbers.centers[k], m.R[k] @ numbers.inertias[k] @ m.R[k].T
            a = m.r_ddot[k] + np.cross(m.w_dot[k], arm) + np.cross(m.w[k], np.cross(m.w[k], arm))
            force, spin = mass * (a - numbers.gravity), tensor @ m.w_dot[k] + np.cross(m.w[k], tensor @ m.w[k])
            needed.append(np.concatenate([force, spin + np.cross(arm, force)]))
        return np.array(needed)

    def check_motion(self) -> None:
        """M, M v' + h and v' from bodies and loads, where there are no motors: what constraints exert does no work."""
        m, numbers, module, n = self.motion, self.made.numbers, self.module, self.module.n_q
        q, rigid = self.x[:n], (numbers.masses, m.R @ numbers.inertias @ m.R.transpose(0, 2, 1))
        arms = np.einsum("kij,kj->ki", m.R, numbers.centers)
        J = m.J_r + np.cross(m.J_w, arms[:, :, None], axis=1)
        M = np.einsum("k,kia,kib->ab", rigid[0], J, J) + np.einsum("kia,kij,kjb->ab", m.J_w, rigid[1], m.J_w)
        mass = module.mass_matrix(q)
        np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-15 * sized(M))
        np.testing.assert_allclose(mass, M, rtol=0, atol=1e-10 * sized(M))
        assert (
            min(np.linalg.eigvalsh(mass)[0], np.linalg.eigvalsh(module.embedded_mass_matrix(q)).min(initial=1.0)) > 0.0
        )
        assert module.energy(self.x)[0] == pytest.approx(0.5 * m.v @ mass @ m.v, rel=1e-12)
        lacking, forces = self.needed() - self.wrenches, M @ m.a + module.bias(TIME, self.x)
        expected = np.einsum("kia,ki->a", np.concatenate([m.J_r, m.J_w], axis=1), lacking)
        size = max(sized(lacking), sized(M @ m.a), sized(forces))
        np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-9 * size)
        C_q = module.constraint_jacobian(q, rows="all")
        slopes = [judges.first(lambda y: module.constraints(y, rows="all"), q, d) for d in basis(module, q).T]
        np.testing.assert_allclose(C_q, np.stack(slopes, 1), rtol=0, atol=1e-9 * max(1.0, sized(C_q)))
        free = null_space(C_q, rcond=1e-9) if len(C_q) else np.eye(module.n_v)
        assert free.shape[1] == module.n_dof
        assert sized(expected @ free) <= 1e-9 * size
        assert sized(expected + C_q.T @ module.multipliers(TIME, self.x)) <= 1e-8 * size
        assert sized(C_q @ m.a + gamma(module, self.x, m.q_dot)) <= 1e-9 * max(1.0, sized(m.a), sized(m.v**2))
        for name, reaction in zip(module.joint_names, module.reactions(TIME, self.x), strict=True):
            moves = self.relative(name, range(module.n_v))[0] @ free
            assert sized(reaction @ moves) <= 1e-9 * size * max(1.0, sized(moves)), name

    def check_bodies(self) -> None:
        """Newton and Euler for each body with what its joints, their drives and loads exert."""
        needed = self.needed()
        size = max(self.exert_by_joints(), sized(needed))
        np.testing.assert_allclose(self.wrenches, needed, rtol=0, atol=1e-9 * size)

    def along_motion(self, f: Any) -> np.ndarray:
        """The rate of a function of the state."""
        module, m = self.module, self.motion
        x_dot = np.zeros(module.n_x)
        x_dot[: module.n_q], x_dot[module.n_q : module.n_q + module.n_v] = m.q_dot, m.a
        size = max(1.0, sized(x_dot))
        return np.asarray(judges.first(f, self.x, x_dot / size) * size)

    def check_momentum(self) -> None:
        """The rates of both momenta are what acts from outside: nothing on a free system but gravity."""
        m, numbers, size = self.motion, self.made.numbers, self.exert_by_joints()
        masses, centers = numbers.masses, m.r + np.einsum("kij,kj->ki", m.R, numbers.centers)
        arms = m.r - masses @ centers / masses.sum()
        force = self.wrenches[:, :3].sum(axis=0) + masses.sum() * numbers.gravity
        torque = (self.wrenches[:, 3:] + np.cross(arms, self.wrenches[:, :3])).sum(axis=0)
        size = max(size, sized(self.module.momentum(self.x)))
        rates = self.along_motion(self.module.momentum)
        np.testing.assert_allclose(rates, [*force, *torque], rtol=0, atol=1e-9 * size * max(1.0, sized(arms)))

    def check_power(self) -> None:
        """The rate of both energies is the power of all else."""
        rates = self.along_motion(self.module.energy)
        given = self.power
        for name, value in self.made.motors.items():
            given += value * self.rate(name)
        assert abs(rates.sum() - given) <= 1e-9 * max(1.0, sized(rates), abs(given))

    def rate(self, name: str) -> float:
        """Of a coordinate, that of a joint that is cut too."""
        if f"{name}_dot" in self.columns:
            return float(self.motion.v[self.columns[f"{name}_dot"]])
        cut = next(joint for joint in self.made.joints if name == joint or name.startswith(f"{joint}_"))
        kind, i, P, j, S = self.made.joints[cut]
        axis, length = AXES[kind][name.removeprefix(cut)]
        place = self.point(j, S.position)[0]
        along = ((self.motion.R[i] if i >= 0 else np.eye(3)) @ P.rotation)[:, axis]
        if length:
            return float(along @ (self.rate_at(j, place) - self.rate_at(i, place)))
        spins = [*self.motion.w, np.zeros(3)]  # ground is the last
        return float(along @ (spins[j] - spins[i]))


@pytest.mark.parametrize("batch", BATCHES)
def test_every_body_is_in_balance(batch: int) -> None:
    for_each(batch, lambda recipe: Balance(recipe).check_bodies())


@pytest.mark.parametrize("batch", BATCHES)
def test_energy_changes_by_the_power_of_what_has_no_potential(batch: int) -> None:
    for_each(batch, lambda recipe: Balance(recipe).check_power())


@pytest.mark.parametrize("batch", BATCHES)
def test_momenta_change_by_what_acts_from_outside(batch: int) -> None:
    for_each(batch, lambda recipe: Balance(recipe).check_momentum())


@pytest.mark.parametrize("batch", BATCHES)
def test_jacobians_are_derivatives(batch: int) -> None:
    """Of the complete right-hand side, projection included, in directions across the constraints too."""

    def check(recipe: Recipe) -> None:
        made, module = compiled(recipe)
        x = made.state(module)
        free = [k for k, name in enumerate(module.x_names) if name != "switched_closed"]  # that one is 0 or 1
        slopes = [judges.first(lambda y: module.rhs(TIME, y), x, d, h=1e-5) for d in np.eye(len(x))[free]]
        expected = np.stack(slopes, 1)
        assert sized(module.jacobian(TIME, x)[:, free] - expected) <= 1e-6 * sized(expected)

    for_each(batch, check)


def judge_alike(recipe: Recipe, other: Any) -> None:
    """Another module of a mechanism gives what the first gives."""
    made, module = compiled(recipe)
    x = made.state(module)
    q = x[: module.n_q]
    assert other.x_names == module.x_names
    M = module.embedded_mass_matrix(q) if module.n_rows else module.mass_matrix(q)
    cond = float(np.linalg.cond(M)) if M.size else 1.0
    judges.agree(other.rhs(TIME, x), module.rhs(TIME, x), 1e-11, cond)
    for call in (lambda m: m.reactions(TIME, x), lambda m: m.jacobian(TIME, x)):
        ours, theirs = call(other), call(module)
        assert sized(ours - theirs) <= 1e-10 * max(1.0, cond / 1e3) * sized(theirs)
    np.testing.assert_allclose(other.energy(x), module.energy(x), rtol=1e-12, atol=1e-12)
    for ours, theirs in ((other.mass_matrix(q), module.mass_matrix(q)), (other.bias(TIME, x), module.bias(TIME, x))):
        assert sized(ours - theirs) <= 1e-10 * sized(theirs)


@pytest.mark.parametrize("batch", BATCHES)
def test_methods_agree(batch: int) -> None:
    def check(recipe: Recipe, method: str) -> None:
        judge_alike(recipe, compiled(recipe)[0].compile(method))

    for_each(batch, check, st.sampled_from(METHODS[1:]))


def test_targets_agree() -> None:
    for_each(1, lambda recipe: judge_alike(recipe, compiled(recipe)[0].compile(target="cython", **IN_C)), count=3)


# -- each type of joint, in trees and to close a chain -----------------------------------------------------------------
LOADS = ("damper", "push", "spring", "twist")
ROTATIONS = ("euler_angles", "euler_parameters")
GROUPS = [
    ("revolute", "screw", "spherical"),
    ("continuous", "universal", "free"),
    ("prismatic", "constant_velocity", "point_on_curve"),
    ("cylindrical", "planar", "weld", "curve_slider"),
    ("surface_slider", "point_on_surface", "spherical"),
    ("revolute", "translational", "spherical"),
]
TREES = [(group, ROTATIONS[k % 2]) for k, group in enumerate(GROUPS)]
TREES += [(group, ROTATIONS[1 - k % 2]) for k, group in enumerate(GROUPS) if {"spherical", "free"} & {*group}]
TREES += [(("revolute", "spherical", "universal", "free", "cylindrical") * 2, "euler_parameters")]
CHAINS = [(kind, ROTATIONS[(k + other) % 2]) for other in (0, 1) for k, kind in enumerate(CLOSING)]


def judge_methods(recipe: Recipe, which: int) -> Balance:
    """A mechanism by two more methods, which differ from case to case, beside what moves its bodies."""
    for state in (1, 0):
        balance = Balance(recipe, state)
        balance.check_motion()
        balance.check_bodies()
        balance.check_power()
    for method in {METHODS[which % len(METHODS)], METHODS[(which + 3) % len(METHODS)]} - {"embedding"}:
        judge_alike(balance.recipe, balance.made.compile(method))
    return balance


def test_every_joint_type_is_there() -> None:
    assert {kind for group in GROUPS for kind in group} == set(SPATIAL)


@pytest.mark.parametrize(("group", "rotation"), part_of(TREES, lambda case: TREES.index(case) < 9))
def test_trees_of_every_joint(group: tuple[str, ...], rotation: str) -> None:
    """M, h, accelerations, energies, reactions and the power of each wrench; velocities of the bodies as outputs."""
    which = TREES.index((group, rotation))
    recipe = random_recipe(which, group, rotation, forces=LOADS)
    balance, made = judge_methods(recipe, which), Made(recipe)
    for k in range(len(group)):
        for name in ("wx", "wy", "wz", "vx", "vy", "vz"):
            made.model.output(f"{name}{k}", f"{name}(b{k})")
    twists = made.compile(kernels=["rhs", "outputs"]).outputs(TIME, balance.x).reshape(-1, 6)
    np.testing.assert_allclose(twists, np.hstack([balance.motion.w, balance.motion.r_dot]), rtol=0, atol=1e-10)


@pytest.mark.parametrize(("kind", "rotation"), part_of(CHAINS, lambda case: CHAINS.index(case) < len(CLOSING)))
def test_chains_that_any_joint_closes(kind: str, rotation: str) -> None:
    """A chain of ball, universal, cylindrical joint and hinge; redundant rows and Euler parameters included."""
    which = CHAINS.index((kind, rotation))
    cut = 4 if kind != "weld" else 3  # which would rather stay
    recipe = random_recipe(which, ("spherical", "universal", "cylindrical", "revolute"), rotation, forces=LOADS,
                           closing=kind, cut=cut, away=True)  # fmt: skip
    balance = judge_methods(recipe, which)
    module, x = balance.module, balance.x
    if kind not in ("weld", "screw"):
        assert module.metadata["loop_joint_names"] == ["close"]
        here = dict(zip(module.q_names, module.x0()[: module.n_q], strict=True))
        assert here == pytest.approx(balance.made.numbers.start, abs=1e-9)  # a pose that the joint allows
    assert module.n_dof == 8 - (6 - CLOSING[kind][0])
    assert sized(module.constraints(x[: module.n_q], rows="all")) <= 1e-12
    assert sized(module.velocity_constraints(x, rows="all")) <= 1e-11
    np.testing.assert_allclose(module.project(x), x, rtol=0, atol=1e-11)
    if which >= len(CLOSING) and which % 4 == 0:
        judge_alike(balance.recipe, balance.made.compile(target="cython", **IN_C))


# -- the same physics, described otherwise -----------------------------------------------------------------------------
def dressed(one: Made, x: np.ndarray, module: Any, clothes: Clothes) -> tuple[Made, Any, np.ndarray]:
    """A mechanism in other clothes, and its state with the bodies where those of the first are, as fast."""
    made = Made(one.recipe, clothes)
    other = made.compile()
    goal, n = one.motion(module, x), other.n_q
    y = other.x0()
    places = made.coordinates(dict(zip(module.q_names, x[: module.n_q].tolist(), strict=True)))
    y[:n] = [places.get(name, value) for name, value in zip(other.q_names, y[:n], strict=True)]
    for name, value in zip(module.x_names[module.n_q + module.n_v :], x[module.n_q + module.n_v :], strict=True):
        y[other.x_names.index(made.name(name))] = value
    for _ in range(6 if one.recipe.closing else 0):  # the joint that was cut may have coordinates now
        here = made.motion(other, y, moves=False)
        turn = [judges.vee((R @ Q.T)[None])[0] for R, Q in zip(goal.R, here.R, strict=True)]
        gap = np.concatenate([np.ravel(turn), np.ravel(goal.r - here.r)])
        y[:n] += basis(other, y[:n]) @ (here.v_size * np.linalg.lstsq(jacobian_of(here), gap, rcond=None)[0])
        for k in (k for k, name in enumerate(other.q_names) if name.endswith("_e0")):
            y[k : k + 4] /= np.linalg.norm(y[k : k + 4])
    here, twists = made.motion(other, y, moves=False), np.concatenate([goal.w.ravel(), goal.r_dot.ravel()])
    y[n : n + other.n_v] = here.v_size * np.linalg.lstsq(jacobian_of(here), twists, rcond=None)[0]
    return made, other, y


def jacobian_of(motion: Any) -> np.ndarray:
    return np.concatenate([J.reshape(-1, J.shape[-1]) for J in (motion.J_w, motion.J_r)])


def judge_dressed(recipe: Recipe, clothes: Clothes) -> None:
    one, module = compiled(recipe)
    x = one.state(module)
    try:
        made, other, y = dressed(one, x, module, clothes)
        if one.numbers.start and "driver" not in recipe.constraints:  # the same assembly
            for mine, theirs in zip(one.places(module), made.places(other), strict=True):
                np.testing.assert_allclose(theirs, mine, rtol=0, atol=1e-8)
    except eg.ModelError as error:  # of the joint that is cut now: a spring on its angle
        assert "only known up to full turns" in str(error)
        return
    assert other.n_dof == module.n_dof
    first, second = one.motion(module, x), made.motion(other, y)
    M = module.embedded_mass_matrix(x[: module.n_q]) if module.n_rows else module.mass_matrix(x[: module.n_q])
    cond = float(np.linalg.cond(M)) if M.size else 1.0
    for name in ("R", "r", "w", "r_dot"):
        theirs = getattr(first, name)
        np.testing.assert_allclose(
            getattr(second, name), theirs, rtol=0, atol=1e-9 * max(1.0, sized(theirs)), err_msg=name
        )
    size = max(map(sized, (first.w_dot, first.r_ddot, first.w**2)))
    for name in ("w_dot", "r_ddot"):
        worst = sized(getattr(first, name) - getattr(second, name))
        assert worst <= 1e-9 * max(1.0, cond / 1e3) * size, (name, worst, size, cond)


@pytest.mark.parametrize("batch", BATCHES)
def test_bodies_move_alike_in_other_clothes(batch: int) -> None:
    """Frames turned, units, names and order, another joint cut, both rotations, values given late; together too."""
    for_each(batch, judge_dressed, st.builds(Clothes, *[st.booleans()] * 6))
