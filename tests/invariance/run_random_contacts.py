"""Random scenes of contacts: no contact gives energy, and forces and moments between bodies add up to none.

``python -m invariance.run_random_contacts 1000`` from the folder ``tests`` prints a table and exits 1 on a breach.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import defaultdict
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from invariance.random_contacts import PLANE, Scene, random_contacts

import eomgen as eg

STATES = 25  #: random states of a scene
BALANCED = 1e-9  #: sums of forces and moments, by the largest of them
POWER = 1e-5  #: of the power of all forces: the slope of the potential is a difference of steps of about 1e-7
KINK = 1e-3  #: where differences ahead and behind are farther apart, the potential has a corner
GAINED = 1e-5  #: energy in a run at rtol 1e-8, by the energy at its start
RUN, INSIDE = 0.8, 0.1  #: of runs that begin apart, and with shapes in each other (s)
STOREY = 0.95  #: (m) between the places of two bodies at the start of a run, more than their shapes reach


@dataclass
class Result:
    """What one scene showed."""

    family: str
    told: str
    faults: list[str] = field(default_factory=list)
    balance: float = 0.0  #: largest sum of forces or moments
    power: float = -np.inf  #: largest rate of the whole energy
    gained: float = -np.inf  #: largest gain in a run
    lost: float = 0.0  #: what the run lost
    touched: int = 0


def _turn(e: np.ndarray) -> np.ndarray:
    """The rotation of Euler parameters."""
    w, v = e[0], e[1:]
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def exerted(scene: Scene, x: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By Newton's and Euler's equations: force on each body, moment on each about the origin, and their powers."""
    n = len(scene.masses)
    if scene.family[0] == PLANE:
        place, v, a = x[: 3 * n].reshape(n, 3), x[3 * n : 6 * n].reshape(n, 3), rates[3 * n : 6 * n].reshape(n, 3)
        force = np.column_stack([scene.masses[:, None] * a[:, :2], np.zeros(n)])
        own = np.column_stack([np.zeros((n, 2)), scene.inertias[:, 2] * a[:, 2]])
        at = np.column_stack([place[:, :2], np.zeros(n)])
        power = (force[:, :2] * v[:, :2]).sum() + (own[:, 2] * v[:, 2]).sum()
        sizes = np.abs(force[:, :2] * v[:, :2]).sum() + np.abs(own[:, 2] * v[:, 2]).sum()
    else:
        q, v, a = x[: 7 * n].reshape(n, 7), x[7 * n : 13 * n].reshape(n, 6), rates[7 * n : 13 * n].reshape(n, 6)
        force, at = scene.masses[:, None] * a[:, :3], q[:, :3]
        w = v[:, 3:]
        body = scene.inertias * a[:, 3:] + np.cross(w, scene.inertias * w)
        own = np.array([_turn(e) @ m for e, m in zip(q[:, 3:], body, strict=True)])
        power = (force * v[:, :3]).sum() + (body * w).sum()
        sizes = np.abs(force * v[:, :3]).sum() + np.abs(body * w).sum()
    return force, np.cross(at, force) + own, np.array([power, sizes])


def random_state(scene: Scene, mod: eg.Module, random: np.random.Generator) -> np.ndarray:
    """Bodies close to each other, with small or large velocities; states at 0."""
    n, x = len(scene.masses), np.zeros(mod.n_x)
    spread, speed = random.uniform(0.05, 0.3), 10 ** random.uniform(-3, 0.5)
    flat = scene.family[0] == PLANE
    each = 3 if flat else 7
    for k in range(n):
        x[each * k : each * k + (2 if flat else 3)] = random.uniform(-spread, spread, 2 if flat else 3)
        if flat:
            x[3 * k + 2] = random.uniform(-np.pi, np.pi) if k else 0.2 * random.standard_normal()
            x[3 * k + 1] += 0.25 * (k > 0)
        else:
            turn = random.standard_normal(4)
            x[7 * k + 3 : 7 * k + 7] = turn / np.linalg.norm(turn) if k else [1, 0, 0, 0]
            x[7 * k + 2] += 0.2 * (k > 0)
    start, end = (3 * n, 6 * n) if flat else (7 * n, 13 * n)
    x[start:end] = speed * random.standard_normal(end - start)
    return x


def _slope(mod: eg.Module, x: np.ndarray, rates: np.ndarray) -> tuple[float, float]:
    """The rate of the potential along the motion, and how far the differences ahead and behind are apart."""
    h = 1e-7 / max(1.0, float(np.abs(rates[: mod.n_q]).max()))
    step = np.zeros_like(x)
    step[: mod.n_q] = h * rates[: mod.n_q]
    behind, here, ahead = (mod.energy(x + s * step)[1] for s in (-1, 0, 1))
    return (ahead - behind) / (2 * h), abs(ahead - 2 * here + behind) / h


def judge_states(scene: Scene, mod: eg.Module, random: np.random.Generator, result: Result) -> list[np.ndarray]:
    """Momentum and power at random states; those that touch."""
    touched = []
    for _ in range(STATES):
        x = random_state(scene, mod, random)
        rates, stored = mod.rhs(0.0, x), 0.0
        if scene.bristles:
            first = mod.n_q + mod.n_v
            met = rates[first:] != 0.0  # of surfaces that are apart bristles lose their energy, which would hide a gain
            x[first:] = np.where(met, 10 ** random.uniform(-3, 0.5) * random.standard_normal(len(met)), 0.0)
            rates = mod.rhs(0.0, x)
            stored = float(x[first:] @ rates[first:])
        force, moment, (power, sizes) = exerted(scene, x, rates)
        largest = float(np.abs(force).max())
        if largest < 1e-6:
            continue
        touched.append(x)
        lever = max(1.0, float(np.abs(moment).max()) / largest)
        balance = max(np.abs(force.sum(axis=0)).max(), np.abs(moment.sum(axis=0)).max() / lever) / largest
        result.balance = max(result.balance, float(balance))
        if scene.remembers:
            continue
        slope, bend = _slope(mod, x, rates)
        if bend > KINK * max(abs(slope), sizes):
            continue
        result.power = max(result.power, float((power + slope + stored) / max(sizes, abs(slope), abs(stored))))
    return touched


def approaching(scene: Scene, mod: eg.Module, random: np.random.Generator) -> np.ndarray:
    """A state in which nothing touches and all come down on the first body, one behind the other.

    Soil has taken no energy yet.
    """
    n, flat = len(scene.masses), scene.family[0] == PLANE
    x = random_state(scene, mod, random)
    if "soil" in scene.family[1]:
        for k in range(1, n):
            x[3 * k : 3 * k + 2] = 0.7 * k - 0.8, x[1] + 0.35
        x[2] = 0.0
        x[3 * n :] = 0.0
        x[3 * n :: 3][1:n] = random.standard_normal(n - 1)
        x[3 * n + 1 : 6 * n : 3][1:] = -random.uniform(1.0, 2.0, n - 1)
        x[3 * n + 2 : 6 * n : 3][1:] = 5.0 * random.standard_normal(n - 1)
        return x
    q, v, first = (3, 3, 3 * n) if flat else (7, 6, 7 * n)
    up = 1 if flat else 2
    x[first:] = 0.0
    for k in range(n):
        x[q * k : q * k + up + 1] = random.uniform(-0.1, 0.1, up + 1)
        x[q * k + up] = STOREY * k
        if k:
            x[first + v * k + up] = -random.uniform(1.0, 2.0) - k
            x[first + v * k + v - 1] = 5.0 * random.standard_normal()
    return x


def judge_run(scene: Scene, mod: eg.Module, x: np.ndarray, end: float, result: Result) -> None:
    """The energy of a run from a state never exceeds that of its start, and momentum stays."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = dict(zip(mod.x_names, x, strict=True))
        traj = mod.simulate(end, initial=start, rtol=1e-8, atol=1e-10)
    bent = 0.5 * (traj.x[mod.n_q + mod.n_v :] ** 2).sum(axis=0) if scene.bristles else 0.0
    energy = np.array([sum(mod.energy(column)) for column in traj.x.T]) + bent
    result.gained = max(result.gained, float((energy.max() - energy[0]) / energy[0]))
    result.lost = max(result.lost, float(1.0 - energy[-1] / energy[0]))
    momenta = np.array([mod.momentum(column)[:3] for column in traj.x.T])
    fastest = max(1.0, float(np.abs(traj.x).max()))
    change = np.abs(momenta - momenta[0]).max() / (float(scene.masses.sum()) * fastest)
    result.balance = max(result.balance, float(change))


def try_one(number: int, runs: bool = True) -> Result:
    """Make one scene and judge it."""
    scene = random_contacts(number)
    result = Result(", ".join(scene.family), scene.told)
    random = np.random.default_rng([number, 5])
    try:
        kernels = None if runs else ["rhs", "energy"]
        mod = scene.model.compile(target="cython" if runs else "numpy", kernels=kernels)
        touched = judge_states(scene, mod, random, result)
        result.touched = len(touched)
        if runs:
            judge_run(scene, mod, approaching(scene, mod, random), RUN, result)
            if touched and "soil" not in scene.family[1]:
                judge_run(scene, mod, touched[0], INSIDE, result)
    except eg.EomgenError as error:
        result.faults.append(f"{type(error).__name__}: {str(error)[:200]}")
    for what, value, most in (
        ("forces and moments add up to", result.balance, BALANCED),
        ("contacts give the power", result.power, POWER),
        ("a run gains", result.gained, GAINED),
    ):
        if not value <= most:
            result.faults.append(f"{what} {value:.2g}")
    return result


def main() -> int:
    """Run as many as asked for; print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--runs", type=int, default=1, help="of how many scenes one is run, too")
    given = parser.parse_args()
    start, families = perf_counter(), defaultdict[str, list[Result]](list)
    for number in range(given.first, given.first + given.count):
        result = try_one(number, number % given.runs == 0)
        families[result.family].append(result)
        for fault in result.faults:
            print(f"{number} {result.family} ({result.told}): {fault}", flush=True)
        if number % 100 == 99:
            print(f"# {number + 1 - given.first} done, {perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
    print(f"\n{'family':24}{'tried':>7}{'touched':>9}{'faults':>8}{'balance':>10}{'power':>10}{'gained':>10}")
    for family, own in families.items():
        worst = [max(getattr(r, key) for r in own) for key in ("balance", "power", "gained")]
        bad, touched = sum(bool(r.faults) for r in own), sum(r.touched for r in own)
        print(f"{family:24}{len(own):7}{touched:9}{bad:8}" + "".join(f"{x:10.1e}" for x in worst))
    bad = sum(bool(r.faults) for own in families.values() for r in own)
    print(f"{given.count} scenes in {perf_counter() - start:.0f} s, {bad} with faults")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
