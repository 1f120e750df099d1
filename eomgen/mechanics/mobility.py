"""Kinematics and numbers -> Mobility: assembled reference, rank, degrees of freedom, partition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..base.algebra import rank
from ..base.assembly import Assembly, ConstraintSystem, differences
from ..base.continuation import Continuation, HeldPath
from ..base.limits.constraints import BESIDE, CHOSEN, CONTRADICTION, FLAT
from ..base.texts import hint, joined
from ..elements.constraints.drivers import Driver
from ..elements.constraints.rolling import LYING, RollingDisc
from ..errors import TO_BE_FINITE, AssemblyError, ModelError, Problem
from ..expr.core import Expr, substitute, symbols_of
from ..expr.evaluate import Evaluator
from ..expr.identity import vanishes
from ..expr.records import Record
from .constraint_functions import Array, ConstraintFunctions
from .kinematics import Kinematics
from .loops import place_of
from .sparse_rows import SparseRows, choose_independent, independent_rows

# -- constraints that hold nothing -------------------------------------------------------------------------------------


NO_SLOPES = "holds nothing"  #: what is said of rows without slopes
TRIES = 12  #: directions in which a row is evaluated


def require_finite(functions: ConstraintFunctions, q: Array) -> None:
    """Refuse a position at which a constraint or its slope is not a number, or so large that its square is none."""
    if not functions.m:
        return
    C, J = functions.position(q)
    with np.errstate(over="ignore", invalid="ignore"):  # rows whose squares overflow have no length, and no rank
        finite = np.isfinite(np.column_stack([J**2, [*C, *[0.0] * (len(J) - len(C))]])).all(axis=1)
    if finite.all():
        return
    k = functions.kinematics
    bad = [k.constraints.labels[i] for i in np.flatnonzero(~finite)]
    discs = {c.name for c in k.mechanism.constraints if isinstance(c, RollingDisc)}
    place = ", ".join(f"{name} = {x:.6g}" for name, x in zip(k.names, q, strict=True))
    what = f"{', '.join(bad)}: the constraint is not finite at the initial configuration {place}"
    if all(label.partition(".")[0] in discs for label in bad):
        raise AssemblyError(f"{what}: {LYING}; tilt the disc in initial or guess", bad, code="EG-NOT-FINITE")
    raise AssemblyError(f"{what}; give another configuration in initial or guess", bad, code="EG-NOT-FINITE")


def refuse_squares(functions: ConstraintFunctions, q: Array) -> None:
    """Refuse written constraints that are least or greatest where they hold, as |r|^2 = 0 of two points is."""
    if not functions.h:
        return
    k, scales = functions.kinematics, functions.system.scales
    slopes = np.abs(functions.scaled_jacobian(q)[: functions.h]).max(axis=1, initial=0.0)
    least = np.array(k.constraints.written[: functions.h], dtype=bool) & (slopes < FLAT)
    if not least.any():
        return
    side = np.zeros(functions.h)
    for step in np.random.default_rng(5).normal(size=(TRIES, len(scales.q))) * BESIDE:
        for away in (step, -step):
            higher = np.sign(functions.position(scales.move(q, away))[0] - functions.position(q)[0])
            side = np.where(side == 0, higher, side)
            least &= (higher == side) & (side != 0)
        if not least.any():
            return
    what = (
        "is 0 only where it is least or greatest, as a sum of squares: its slopes vanish there, so it can hold nothing"
    )
    remedy = "write each component as a constraint: x1 - x2 and y1 - y2 for (x1 - x2)**2 + (y1 - y2)**2"
    labels = (k.constraints.labels[i] for i in np.flatnonzero(least))
    raise ModelError(
        [k.mechanism.problem(place_of(k.mechanism, x), f"{x} {what}", remedy, "EG-REDUNDANT") for x in labels]
    )


def refuse_rows_without_slopes(kinematics: Kinematics, numbers: Mapping[str, float]) -> None:
    """Refuse constraints of which no slope is found at any position, where they are all there is.

    Such are a relation whose factors cancel, and one that nothing proves to be an identity.  Rows of joints whose
    slopes vanish identically with the given parameters are no fault: a body may be held twice.
    """
    c, graph = kinematics.constraints, kinematics.graph
    known = {graph.symbol(name): graph.constant(numbers[name]) for name in kinematics.parameter_names}
    problems = []
    for i, (label, row, written) in enumerate(zip(c.labels, c.jacobian, c.written, strict=True)):
        slopes = [x for x in row if not x.is_zero]
        if kinematics.general_rates and i < len(c.slopes) and not all(vanishes(substitute(c.slopes[i], known))):
            continue  # it holds coordinates that no velocity leaves, as the length of Euler parameters
        if (written and slopes) or not all(vanishes(substitute(slopes, known))):
            used = sorted(symbols_of(slopes) & set(kinematics.parameter_names))
            what = f"{label} {NO_SLOPES} at all positions that were tried: its slopes are 0"
            remedy = "remove it"
            if used:
                what = f"{label} {NO_SLOPES} with the declared {', '.join(used)}: its factors are 0 or cancel"
                remedy = "declare values with which it acts (they determine the degrees of freedom), or remove it"
            problems.append(
                kinematics.mechanism.problem(place_of(kinematics.mechanism, label), what, remedy, "EG-REDUNDANT")
            )
    if problems:
        raise ModelError(problems)


# -- candidates for independent coordinates ----------------------------------------------------------------------------


LARGEST = 120  #: coordinates up to which every one is judged


def rate_candidates(rows: SparseRows, chosen: Sequence[int]) -> dict[int, float]:
    """How well each coordinate would do as independent: columns -> conditioning, the best first.

    For a chosen column it is that of the chosen set, for any other that of the best set in which it takes the place of
    a chosen one; columns that cannot are left out.  Empty where there is no choice.
    """
    m, n = rows.J.shape
    if not m or not chosen or n > LARGEST or (n - len(chosen)) * len(chosen) > LARGEST:
        return {}
    result = dict.fromkeys(chosen, rows.conditioning(chosen))
    for k in range(n):
        if k not in result:
            swaps = ([k if i == old else i for i in chosen] for old in chosen)
            result[k] = max(map(rows.conditioning, swaps))
    ordered = sorted(result.items(), key=lambda item: -round(item[1], 6))
    return {k: value for k, value in ordered if value > CHOSEN}


# -- drivers -----------------------------------------------------------------------------------------------------------

# Drivers take their degrees of freedom in the order of the model; one that finds none left over-drives the mechanism.
# It may stay where it asks for nothing that the others do not give, at all times tried.


FIRST, STEPS = 1e-3, 16  #: part of the span in the first step of a motion over it; its steps at most


class Drivers:
    """The drivers of a mechanism, by the constraint rows that they prescribe."""

    def __init__(self, functions: ConstraintFunctions) -> None:
        self.functions, self.kinematics = functions, functions.kinematics
        self.labels = self.kinematics.constraints.labels
        names = {c.name for c in self.kinematics.mechanism.constraints if isinstance(c, Driver)}
        named = {i: label.partition(".")[0] for i, label in enumerate(self.labels)}
        self.names = {i: name for i, name in named.items() if name in names}  #: row -> name
        self.others = [i for i in range(functions.m) if i not in self.names]

    def assemble(self, values: Mapping[str, float], guess: Mapping[str, float]) -> Assembly:
        """Assemble at t = 0; where that fails for the drivers, or more of them than freedoms contradict, say so."""
        try:
            result = self.functions.close_nearest(values, guess)
        except AssemblyError as error:
            if not self.names:
                raise
            raise self._explain(values, guess, error) from None
        if self.names:
            self._refuse_contradictions(result.q)
        return result

    def later(self, q: Array) -> list[Array]:
        """Closed positions at later times, as further samples; none without drivers, or where none can be followed."""
        if not self.names or "t" in symbols_of([e for row in self.kinematics.constraints.jacobian for e in row]):
            return []
        return [position for _, position in self._follow(self.functions.system, q)][1::4]

    def _follow(self, system: ConstraintSystem, q: Array) -> list[tuple[float, Array]]:
        """Closed positions at times after 0, a small motion apart."""
        end = self.kinematics.mechanism.defaults.simulation.end
        continuation = Continuation(HeldPath(system, q, {}, end), q, fewest=STEPS)
        continuation.step = FIRST
        continuation.to(1.0, steps=STEPS)
        return [(point.s * end, point.q) for point in continuation.points[1:]]

    def _needed(self, q: Array, t: float = 0.0) -> tuple[list[int], list[int]]:
        """Rows that count at a position, drivers in order as long as they add something; and the drivers left over."""
        J, kept, spare = self.functions.scaled_jacobian(q, t), [*self.others], []
        for row in self.names:
            if rank(J[[*kept, row]]).rank > rank(J[kept]).rank:
                kept.append(row)
            else:
                spare.append(row)
        return sorted(kept), spare

    def _explain(
        self, wanted: Mapping[str, float], guess: Mapping[str, float], error: AssemblyError
    ) -> AssemblyError | ModelError:
        """Why the mechanism cannot be assembled with its drivers."""
        functions, drivers = self.functions, self.names
        try:
            q = functions.close(wanted, guess, system=functions.with_rows(self.others)).q
        except AssemblyError as loops:
            return loops  # not for the drivers' sake
        with np.errstate(all="ignore"):
            values = functions.position(q)[0]
        lost = [i for i in drivers if not np.isfinite(values[i])]
        if lost:
            text = f"{', '.join(drivers[i] for i in lost)} has no finite value at t = 0: {TO_BE_FINITE}"
            return AssemblyError(text, [self.labels[i] for i in lost], code="EG-NOT-FINITE")
        kept, spare = self._needed(q)
        if spare:
            try:
                q = functions.close(wanted, guess, system=functions.with_rows(kept)).q
            except AssemblyError:
                pass
            else:
                return self._contradiction(spare, q, 0.0)
        if wanted:
            try:
                functions.close({}, {**guess, **wanted})
            except AssemblyError:
                pass
            else:
                text = f"{error}; at t = 0 the drivers prescribe {', '.join(drivers.values())} too"
                return AssemblyError(text, error.rows, code="EG-CONTRADICTION")
        C = functions.position(q)[0]
        gaps = [f"{drivers[i]} by {abs(C[i]):.3g} {self._unit(i)}" for i in drivers]
        text = str(error).partition("; check")[0]
        message = (
            f"the loops cannot reach the position that the drivers prescribe at t = 0: {text}; at the position nearest "
            f"to the guess where the loops close, the drivers are off ({', '.join(gaps)}); give the drivers values "
            "within reach, or a guess nearer to them"
        )
        return AssemblyError(message, [*(self.labels[i] for i in drivers), *error.rows], code="EG-CONTRADICTION")

    def _refuse_contradictions(self, q: Array) -> None:
        """Follow the drivers that count; those left over must agree with them."""
        kept, spare = self._needed(q)
        if not spare:
            return
        for t, here in self._follow(self.functions.with_rows(kept), q):
            if len(self._needed(here, t)[0]) > len(kept):
                break  # the first position was singular; elsewhere all of them count
            C = self.functions.scales.residual(self.functions.position(here, t)[0])
            if np.abs(C[spare]).max() > CONTRADICTION:
                raise self._contradiction(spare, here, t)

    def _contradiction(self, spare: Sequence[int], q: Array, t: float) -> ModelError:
        drivers, C, problems = self.names, self.functions.position(q, t)[0], []
        others = [name for row, name in drivers.items() if row not in spare]
        freedoms = len(others)
        for row in spare:
            place, gap = f"constraints.{drivers[row]}", f"{abs(C[row]):.3g} {self._unit(row)} at t = {t:.4g} s"
            if not self._moves(row, q):
                message = (
                    "the driver has no effect: no motion of the mechanism changes the quantity that it prescribes, "
                    f"and this is off by {gap}"
                )
                remedy = "drive a coordinate, or two markers that move relative to each other"
                problems.append(self.kinematics.mechanism.problem(place, message, remedy, "EG-REDUNDANT"))
                continue
            verb = "moves" if freedoms == 1 else "move"
            who = f"{' and '.join(others)} {verb} it already" if others else "the mechanism cannot move"
            message = (
                f"the mechanism is over-driven: it has {freedoms} degree{'s' if freedoms != 1 else ''} of freedom and "
                f"{len(drivers)} driver{'s' if len(drivers) != 1 else ''}; {who}, and {drivers[row]} is off by {gap}"
            )
            remedy = f"remove one of {', '.join(drivers.values())}, or give them values that agree"
            problems.append(self.kinematics.mechanism.problem(place, message, remedy, "EG-CONTRADICTION"))
        return ModelError(problems)

    def _moves(self, row: int, q: Array) -> bool:
        """Whether a motion that the loops allow changes what a driver prescribes: here, or beside a dead centre."""
        functions, hinted = self.functions, {name for name, _ in self.kinematics.hints}
        free, random = functions.with_rows(self.others), np.random.default_rng(1)
        for size in (0.0, 0.1, 0.3, 0.3):
            start = functions.scales.move(q, size * random.uniform(-1.0, 1.0, functions.scales.q.size))
            named = zip(self.kinematics.names, map(float, start), strict=True)
            guess = {name: x for name, x in named if name not in hinted}
            try:
                here = functions.close({}, guess, restarts=0, system=free).q if size else q
            except AssemblyError:
                continue
            J = functions.scaled_jacobian(here)
            if rank(J[[*self.others, row]]).rank > rank(J[self.others]).rank:
                return True
        return False

    def _unit(self, row: int) -> str:
        return "m" if self.kinematics.constraints.kinds[row] == "length" else "rad"


PROBES = 4  #: further assembled configurations at which the rank is judged


class Mobility(Record):
    """What the numbers say about a mechanism; velocities are called by the coordinate whose rate they are, if any."""

    q_reference: tuple[float, ...]  #: assembled at the declared initial values
    rank: int  #: largest rank of the constraint Jacobian at ``configurations`` assembled configurations
    n_dof: int  #: degrees of freedom, n_v - rank: of the velocities, nonholonomic rows included
    independent: tuple[str, ...]
    dependent: tuple[str, ...]
    independent_rows: tuple[int, ...]  #: constraint rows that carry the rank at the reference
    redundant: tuple[str, ...]  #: the others there
    conditioning: float  #: how well the independent coordinates move the mechanism there: 1 perfect, 0 not at all
    length_scale: float
    row_scales: tuple[float, ...] = ()  #: typical size of each constraint row
    configurations: int = 1
    ranks: tuple[int, ...] = ()
    assumed: bool = False  #: whether parameters had no value, so that the rank was judged with made-up ones
    residual: float = 0.0  #: largest scaled residual of the loops at the reference
    restarts: int = 0  #: further starts the assembly needed; 0 means it went straight from the initial values and guess
    guessed: tuple[tuple[str, float, float], ...] = ()  #: coordinate, its guess, its value; largest difference first
    guess_distance: float = 0.0  #: largest scaled difference of a guessed coordinate
    samples: tuple[tuple[float, ...], ...] = ()  #: the configurations, the reference first
    n_positions: int = 0  #: degrees of freedom of the configuration, n_v less the rank of the holonomic rows
    instantaneous: int = 0  #: degrees of freedom at the reference, more than n_dof at a change point
    candidates: tuple[tuple[str, float], ...] = ()  #: coordinates that can be independent there; conditioning
    driven: bool = False  #: whether a constraint depends on time
    places: tuple[str, ...] = ()  #: coordinates named as independent, where their rates are given


def initial_values(
    kinematics: Kinematics, values: Mapping[str, float | None], which: str = "initial"
) -> dict[str, float]:
    """Declared initial values (or guesses) as numbers, by name, with those of parameters."""
    wanted: Mapping[str, Expr] = getattr(kinematics.mechanism.defaults, which)
    numbers = Evaluator(list(wanted.values()), tuple(values))(list(values.values())) if wanted else []
    return {name: float(x) for name, x in zip(wanted, numbers, strict=True)}


def find_mobility(kinematics: Kinematics, independent: Sequence[str] = ()) -> Mobility:
    """Assemble the mechanism at its declared initial values and find its mobility.

    Where the coordinates named as independent, the model's own by default, are fewer than the degrees of freedom, the
    best conditioned others join them.

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
    values = mechanism.declared
    missing = [n for n, x in values.items() if x is None]
    numbers = {n: float(x) if x is not None else 1.0 + 0.1 * missing.index(n) for n, x in values.items()}
    functions = ConstraintFunctions(kinematics, numbers)
    if missing:
        return replace(_find_mobility_assumed(functions, wanted), assumed=True, places=places)
    raw = initial_values(kinematics, numbers)
    guess = initial_values(kinematics, numbers, "guess")
    known = {*kinematics.names, *kinematics.loop_coordinates.names}
    positions = {n: x for n, x in raw.items() if n in known}
    drivers = Drivers(functions)
    result = drivers.assemble(positions, guess)
    require_finite(functions, result.q)
    later = drivers.later(result.q)
    judged = _partition(functions, [result.q, *_probe(functions, result.q), *later], wanted)
    _check_places(functions, result.q, places)
    rough = {name: value for name, value in guess.items() if name in known and name not in positions}
    return replace(
        judged,
        places=places,
        residual=result.residual,
        restarts=result.restarts,
        guessed=differences(functions.system, result.q, rough),
        guess_distance=result.distance if rough else 0.0,
    )


def _wanted(kinematics: Kinematics, names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The labels of the velocities that are named, and the coordinates, where these do not move as velocities say."""
    labels = dict(zip(kinematics.velocity_names, kinematics.velocity_labels, strict=True))
    if not kinematics.general_rates:
        labels |= {f"{name}_dot": name for name in kinematics.loop_coordinates.names}
        return tuple(labels.get(name, name) for name in names), ()
    places = tuple(name for name in names if name in kinematics.names)
    speeds = tuple(labels.get(name, name) for name in names if name not in places)
    return speeds or tuple(name for name in places if name in kinematics.velocity_labels), places


def _check_places(functions: ConstraintFunctions, q: Array, places: Sequence[str]) -> None:
    """Refuse coordinates of given rates that cannot be independent of each other."""
    if not places:
        return
    kinematics, names, J = functions.kinematics, functions.kinematics.names, functions.place_jacobian(q)
    rank, units = SparseRows(J).rank, np.eye(len(names))[[names.index(name) for name in places]]
    if len(places) > (n := len(names) - rank) or len({*places}) < len(places):
        message = f"{', '.join(places)}: the positions have {n} degree{'s' * (n != 1)} of freedom"
        raise ModelError([_choice(kinematics, message, f"choose {n} different ones of {', '.join(names)}")])
    if SparseRows(np.vstack([J, units])).rank < rank + len(places):
        message = f"{', '.join(places)} cannot vary independently of each other at the initial configuration"
        raise ModelError([_choice(kinematics, message, f"choose others of {', '.join(names)}")])


def _choice(kinematics: Kinematics, message: str, remedy: str, code: str = "EG-PARTITION") -> Problem:
    """The fault of a choice of independent coordinates."""
    return kinematics.mechanism.problem("independent", message, remedy, code)


def _check_names(kinematics: Kinematics, wanted: Sequence[str]) -> None:
    problems = []
    if twice := [name for name in dict.fromkeys(wanted) if list(wanted).count(name) > 1]:
        problems.append(_choice(kinematics, f"{', '.join(twice)}: named twice", "name it once"))
    coordinates = kinematics.names if kinematics.general_rates else kinematics.loop_coordinates.names
    known = (*dict.fromkeys((*kinematics.velocity_labels, *coordinates)),)
    for name in wanted:
        if name in kinematics.velocity_labels:
            continue
        if name in kinematics.names:
            message = f"{name!r} is an Euler parameter, which cannot vary on its own"
            remedy = f"choose the angular velocity instead, of {', '.join(kinematics.velocity_labels)}"
            problems.append(_choice(kinematics, message, remedy))
        elif name in known:
            message = f"{name!r} follows from the other chosen coordinates, which belong to the same loop"
            problems.append(_choice(kinematics, message, "choose fewer coordinates of one loop"))
        else:
            what, remedy = f"no coordinate {name!r}", joined(hint(name, known), f"allowed: {', '.join(known)}", by=" ")
            problems.append(_choice(kinematics, what, remedy, "EG-NAME-UNKNOWN"))
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
    result, scales = [], functions.system.scales
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
        result.append(closed)
    return result


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
        refuse_rows_without_slopes(kinematics, functions.values)
    n_dof = n - r
    if len(wanted) > n_dof and kinematics.general_rates and set(wanted) <= set(kinematics.names):
        wanted = ()  # coordinates, of which there may be more than velocities
    if len(wanted) > n_dof:
        has = f"{n_dof} degree{'s' * (n_dof != 1)} of freedom"
        several = f"{len(wanted)} coordinates are" if len(wanted) > 1 else "1 coordinate is"
        message = f"{several} chosen ({', '.join(wanted)}), but the mechanism has {has}"
        remedy = f"choose {n_dof} of {', '.join(names)}" if n_dof else "leave independent out: it cannot move"
        raise ModelError([_choice(kinematics, message, remedy)])
    chosen = _choose(kinematics, judged, r, wanted)
    quality = judged[0].conditioning(chosen)
    at_change_point = ranks[0] < r  # where nothing can be said of a choice: the samples may lie on other branches
    others = [rows.conditioning(chosen) for rows in judged[1:]] if wanted and not at_change_point else []
    if wanted and not at_change_point and max(quality, *others, 0.0) < CHOSEN:
        means = "move the mechanism on their own" if len(wanted) == n_dof else "vary independently of each other"
        message = f"{', '.join(wanted)} cannot {means} at the initial configuration"
        better = [names[j] for j in choose_independent(judged, r)]
        raise ModelError([_choice(kinematics, message, f"{', '.join(better)} can")])
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
        candidates=tuple((names[k], value) for k, value in rate_candidates(judged[0], chosen).items()),
        driven=any(not e.is_zero for e in kinematics.constraints.time_derivative),
    )


def _position_ranks(
    functions: ConstraintFunctions, configurations: Sequence[Array], judged: Sequence[SparseRows]
) -> list[int]:
    """Ranks of the constraints of positions; those known already of the same matrices are not found again."""
    known = {rows.J.tobytes(): rows.rank for rows in judged}
    result = map(functions.place_jacobian, configurations)
    return [known[key] if (key := J.tobytes()) in known else SparseRows(J).rank for J in result]


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
