"""Stage kinematics: Kinematics and numbers -> Mobility: assembled reference, rank, degrees of freedom, partition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base.limits.constraints import CHOSEN
from ..base.names import hint, joined
from ..errors import AssemblyError, ModelError
from ..graph.core import Expr
from ..graph.evaluate import compile_evaluator
from ..numeric.independent_columns import choose_independent
from ..numeric.nearest_branch import differences
from ..numeric.ranks import independent_rows
from ..numeric.row_chains import SparseRows
from ..records import dataclass
from .candidates import rate_candidates
from .constraint_functions import Array, ConstraintFunctions
from .driving import close_driven, follow_drivers
from .idle_rows import refuse_idle_rows, refuse_squares, require_finite
from .kinematics import Kinematics

PROBES = 4  #: further assembled configurations at which the rank is judged


@dataclass(frozen=True)
class Mobility:
    """What the numbers say about a mechanism.

    Attributes
    ----------
    q_reference : (n_q,) tuple
        Assembled at the declared initial values.
    rank : int
        Largest rank of the constraint Jacobian found at ``configurations`` assembled configurations.
    n_dof : int
        Degrees of freedom, n_v - rank: of the velocities, nonholonomic rows included.
    n_positions : int
        Degrees of freedom of the configuration, n_v less the rank of the holonomic rows.
    independent, dependent : tuple of str
        The partition of the velocities, each called by the coordinate whose rate it is, if there is one.
    independent_rows : tuple of int
        Constraint rows that carry the rank at the reference; the others are ``redundant`` there.
    conditioning : float
        How well the independent coordinates move the mechanism at the reference: 1 perfect, 0 not at all.
    assumed : bool
        True when parameters had no value, so that the rank was judged with made-up ones.
    """

    q_reference: tuple[float, ...]
    rank: int
    n_dof: int
    independent: tuple[str, ...]
    dependent: tuple[str, ...]
    independent_rows: tuple[int, ...]
    redundant: tuple[str, ...]
    conditioning: float
    length_scale: float
    row_scales: tuple[float, ...] = ()  #: typical size of each constraint row
    configurations: int = 1
    ranks: tuple[int, ...] = ()
    assumed: bool = False
    residual: float = 0.0  #: largest scaled residual of the loops at the reference
    restarts: int = 0  #: further starts the assembly needed; 0 means it went straight from the initial values and guess
    guessed: tuple[tuple[str, float, float], ...] = ()  #: coordinate, its guess, its value; largest difference first
    guess_distance: float = 0.0  #: largest scaled difference of a guessed coordinate
    samples: tuple[tuple[float, ...], ...] = ()  #: the configurations, the reference first
    n_positions: int = 0
    instantaneous: int = 0  #: degrees of freedom at the reference, more than n_dof at a change point
    candidates: tuple[
        tuple[str, float], ...
    ] = ()  #: coordinates that can be independent there, with their conditioning
    driven: bool = False  #: whether a constraint depends on time
    places: tuple[str, ...] = ()  #: coordinates named as independent, where their rates are given


def initial_values(
    kinematics: Kinematics, values: Mapping[str, float | None], which: str = "initial"
) -> dict[str, float]:
    """Declared initial values (or guesses) as numbers, by name, with those of parameters."""
    given: Mapping[str, Expr] = getattr(kinematics.mechanism, which)
    numbers = compile_evaluator(list(given.values()), tuple(values))(list(values.values())) if given else []
    return {name: float(x) for name, x in zip(given, numbers, strict=True)}


def find_mobility(kinematics: Kinematics, independent: Sequence[str] = ()) -> Mobility:
    """Assemble the mechanism at its declared initial values and find its mobility.

    Parameters
    ----------
    kinematics : Kinematics
    independent : names of coordinates that should be independent ones; the model's own by default.  Where they are
        fewer than the degrees of freedom, the best conditioned others join them.

    Raises
    ------
    AssemblyError
        The loops do not close.
    ModelError
        The chosen independent coordinates are too many, unknown or cannot move the mechanism.
    """
    mechanism = kinematics.mechanism
    wanted, places = _wanted(kinematics, tuple(independent) or mechanism.independent)
    _check_names(kinematics, wanted)
    values = {p.name: p.value for p in mechanism.parameters} | {u.name: u.value for u in mechanism.inputs}
    missing = [n for n, x in values.items() if x is None]
    numbers = {n: float(x) if x is not None else 1.0 + 0.1 * missing.index(n) for n, x in values.items()}
    functions = ConstraintFunctions(kinematics, numbers)
    if missing:
        return replace(_find_mobility_assumed(functions, wanted), assumed=True, places=places)
    given = initial_values(kinematics, numbers)
    guess = initial_values(kinematics, numbers, "guess")
    known = {*kinematics.names, *kinematics.loop_coordinates.names}
    positions = {n: x for n, x in given.items() if n in known}
    found = close_driven(functions, positions, guess)
    require_finite(functions, found.q)
    later = follow_drivers(functions, found.q)
    judged = _partition(functions, [found.q, *_probe(functions, found.q), *later], wanted)
    _check_places(functions, found.q, places)
    rough = {name: value for name, value in guess.items() if name in known and name not in positions}
    return replace(
        judged,
        places=places,
        residual=found.residual,
        restarts=found.restarts,
        guessed=differences(functions.system, found.q, rough),
        guess_distance=found.distance if rough else 0.0,
    )


def _wanted(kinematics: Kinematics, names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The labels of the velocities that are named, and the coordinates, where these do not move as velocities say."""
    labels = dict(zip(kinematics.velocity_names, kinematics.velocity_labels, strict=True))
    if not kinematics.given_rates:
        labels |= {f"{name}_dot": name for name in kinematics.loop_coordinates.names}
        return tuple(labels.get(name, name) for name in names), ()
    places = tuple(name for name in names if name in kinematics.names)
    speeds = tuple(labels.get(name, name) for name in names if name not in places)
    return speeds or tuple(name for name in places if name in kinematics.velocity_labels), places


def _check_places(functions: ConstraintFunctions, q: Array, places: Sequence[str]) -> None:
    """Refuse coordinates of given rates that cannot be independent of each other."""
    if not places:
        return
    mechanism, names, J = functions.kinematics.mechanism, functions.kinematics.names, functions.place_jacobian(q)
    rank, held = SparseRows(J).rank, np.eye(len(names))[[names.index(name) for name in places]]
    if len(places) > (n := len(names) - rank) or len({*places}) < len(places):
        message = f"{', '.join(places)}: the positions have {n} degree{'s' * (n != 1)} of freedom"
        raise ModelError(
            [
                mechanism.problem(
                    "independent", message, f"choose {n} different ones of {', '.join(names)}", "EG-PARTITION"
                )
            ]
        )
    if SparseRows(np.vstack([J, held])).rank < rank + len(places):
        message = f"{', '.join(places)} cannot vary independently of each other at the initial configuration"
        raise ModelError(
            [mechanism.problem("independent", message, f"choose others of {', '.join(names)}", "EG-PARTITION")]
        )


def _check_names(kinematics: Kinematics, wanted: Sequence[str]) -> None:
    problems = []
    if twice := [name for name in dict.fromkeys(wanted) if list(wanted).count(name) > 1]:
        problems.append(
            kinematics.mechanism.problem(
                "independent", f"{', '.join(twice)}: named twice", "name it once", "EG-PARTITION"
            )
        )
    coordinates = kinematics.names if kinematics.given_rates else kinematics.loop_coordinates.names
    known = (*dict.fromkeys((*kinematics.velocity_labels, *coordinates)),)
    for name in wanted:
        if name in kinematics.velocity_labels:
            continue
        if name in kinematics.names:
            message = f"{name!r} is an Euler parameter, which cannot vary on its own"
            remedy = f"choose the angular velocity instead, of {', '.join(kinematics.velocity_labels)}"
            problems.append(kinematics.mechanism.problem("independent", message, remedy, "EG-PARTITION"))
            continue
        if name in known:
            message = f"{name!r} follows from the other chosen coordinates, which belong to the same loop"
            problems.append(
                kinematics.mechanism.problem(
                    "independent", message, "choose fewer coordinates of one loop", "EG-PARTITION"
                )
            )
        else:
            what, remedy = f"no coordinate {name!r}", joined(hint(name, known), f"allowed: {', '.join(known)}", by=" ")
            problems.append(kinematics.mechanism.problem("independent", what, remedy, "EG-NAME-UNKNOWN"))
    if problems:
        raise ModelError(problems)


def _find_mobility_assumed(functions: ConstraintFunctions, wanted: Sequence[str]) -> Mobility:
    """Without parameter values: made-up ones, assembled if that works, else judged off the manifold."""
    zero = functions.neutral
    if not functions.m:
        return _partition(functions, [zero], wanted)
    for k in range(5):  # some sizes close a loop and some do not
        trial = {n: x * (1.0 + 0.37 * k * ((7 * j) % 5)) for j, (n, x) in enumerate(functions.values.items())}
        attempt = ConstraintFunctions(functions.kinematics, trial)
        try:
            bent = functions.system.scales.move(
                functions.neutral, 0.3 + 0.1 * np.arange(float(len(functions.system.scales.q)))
            )
            q = attempt.close({}, dict(zip(functions.kinematics.names, bent, strict=True))).q
        except AssemblyError:
            continue
        return _partition(attempt, [q, *_probe(attempt, q)], wanted)
    generic = np.random.default_rng(0).uniform(-1.0, 1.0, (PROBES, len(functions.system.scales.q)))
    return _partition(functions, [functions.system.scales.move(zero, step) for step in generic.astype(float)], wanted)


def _probe(functions: ConstraintFunctions, q: Array) -> list[Array]:
    """More assembled configurations, reached along the null space from q."""
    found, scales = [], functions.system.scales
    random = np.random.default_rng(1)
    if not functions.h:
        return [scales.move(q, random.uniform(0.2, 0.9, len(scales.q))) for _ in range(PROBES)]
    rows = SparseRows(functions.place_jacobian(q))
    basis = rows.motions(rows.rank)
    for k in range(PROBES):
        step = random.normal(size=len(basis)) @ basis
        length = float(np.linalg.norm(step))
        if length == 0.0:
            break
        start = scales.move(q, (0.1 + 0.1 * k) / length * step)
        try:
            closed = functions.close({}, dict(zip(functions.kinematics.names, start, strict=True))).q
        except AssemblyError:
            continue
        found.append(closed)
    return found


def _partition(functions: ConstraintFunctions, configurations: Sequence[Array], wanted: Sequence[str]) -> Mobility:
    kinematics = functions.kinematics
    names, labels = kinematics.velocity_labels, kinematics.constraints.labels
    n = len(names)
    q = configurations[0]
    jacobians = [functions.scaled_jacobian(x) if functions.m else np.empty((0, n)) for x in configurations]
    require_finite(functions, q)
    judged = [SparseRows(J) for J in jacobians if np.isfinite(J).all()]
    ranks = tuple(rows.rank for rows in judged)
    r = max(ranks)
    refuse_squares(functions, q)
    if functions.m and not r:
        refuse_idle_rows(kinematics, functions.values)
    n_dof = n - r
    if len(wanted) > n_dof and kinematics.given_rates and set(wanted) <= set(kinematics.names):
        wanted = ()  # coordinates, of which there may be more than velocities
    if len(wanted) > n_dof:
        has = f"{n_dof} degree{'s' * (n_dof != 1)} of freedom"
        message = f"{len(wanted)} coordinates are chosen ({', '.join(wanted)}), but the mechanism has {has}"
        raise ModelError(
            [
                kinematics.mechanism.problem(
                    "independent", message, f"choose {n_dof} of {', '.join(names)}", "EG-PARTITION"
                )
            ]
        )
    chosen = _choose(kinematics, judged, r, wanted)
    quality = judged[0].conditioning(chosen)
    at_change_point = ranks[0] < r  # where nothing can be said of a choice: the samples may lie on other branches
    others = [rows.conditioning(chosen) for rows in judged[1:]] if wanted and not at_change_point else []
    if wanted and not at_change_point and max(quality, *others, 0.0) < CHOSEN:
        means = "move the mechanism on their own" if len(wanted) == n_dof else "vary independently of each other"
        message = f"{', '.join(wanted)} cannot {means} at the initial configuration"
        better = [names[j] for j in choose_independent(judged, r)]
        raise ModelError(
            [kinematics.mechanism.problem("independent", message, f"{', '.join(better)} can", "EG-PARTITION")]
        )
    rows = independent_rows(judged[int(np.argmax(ranks))].J, r) if r else np.empty(0, dtype=int)
    kept = tuple(int(i) for i in rows)
    return Mobility(
        q_reference=tuple(float(x) for x in q),
        rank=r,
        n_dof=n_dof,
        independent=tuple(names[j] for j in chosen),
        dependent=tuple(name for j, name in enumerate(names) if j not in chosen),
        independent_rows=kept,
        redundant=tuple(label for i, label in enumerate(labels) if i not in kept),
        conditioning=quality,
        length_scale=functions.length_scale,
        row_scales=tuple(float(x) for x in functions.scales.c),
        configurations=len(configurations),
        ranks=ranks,
        samples=tuple(tuple(float(x) for x in sample) for sample in configurations),
        n_positions=len(functions.system.scales.q) - max(_position_ranks(functions, configurations, judged)),
        instantaneous=n - ranks[0],
        candidates=tuple((names[k], value) for k, value in rate_candidates(judged[0].J, chosen).items()),
        driven=any(not e.is_zero for e in kinematics.constraints.time_derivative),
    )


def _position_ranks(
    functions: ConstraintFunctions, configurations: Sequence[Array], judged: Sequence[SparseRows]
) -> list[int]:
    """Ranks of the constraints of positions; those known already of the same matrices are not found again."""
    known = {rows.J.tobytes(): rows.rank for rows in judged}
    found = map(functions.place_jacobian, configurations)
    return [known[key] if (key := J.tobytes()) in known else SparseRows(J).rank for J in found]


def _choose(kinematics: Kinematics, judged: Sequence[SparseRows], r: int, wanted: Sequence[str]) -> tuple[int, ...]:
    names = kinematics.velocity_labels
    n_dof = len(names) - r
    picked = [names.index(name) for name in wanted]
    if len(picked) == n_dof:
        return tuple(picked)
    if r == 0:
        return tuple(range(n_dof))
    named = {c for spec in kinematics.mechanism.joints if spec.named for c in spec.coordinates}
    if kinematics.hints and not named:  # the angle of a contact point is nobody's choice
        named = set(names) - {name for name, _ in kinematics.hints}
    prefer = [j for j, name in enumerate(names) if name in named and j not in picked]
    if picked:  # they stay, and the others are chosen where these stand still
        judged = [SparseRows(np.vstack([rows.J, np.eye(len(names))[picked]])) for rows in judged]
    return tuple(sorted([*picked, *map(int, choose_independent(judged, r + len(picked), prefer))]))
