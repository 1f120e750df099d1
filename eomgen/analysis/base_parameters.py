"""Combinations of inertial parameters that forces can tell, and their values from measured motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.results import Result, ResultTable, same_keys
from ..errors import ProjectionError, cannot, ill_shaped, off_range
from ..runtime.argument_checks import check_names, read_names, read_number, read_numbers
from ..runtime.constrained import free_motions
from ..runtime.refusals import require_support
from .limits import EFFECT, IDENTIFIED, LINEAR, MEASURED, ROUNDED_COEFFICIENT, ROUNDS
from .regressor import (
    STANDARD,
    inertial_remainder,
    random_states,
    regressor,
    standard_names,
    standard_parameters,
)

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel

# -- linear least squares ----------------------------------------------------------------------------------------------

# tau less what is not inertial = Y_b beta, row by row of the regressor, each generalized force weighted by its own
# noise, which the residuals of a first round tell (M. Gautier, Dynamic identification of robots with power model, Proc.
# IEEE Int. Conf. Robotics and Automation, 1997, 1922-1927, sec. 3, weights each joint so).


@dataclass(frozen=True, repr=False)
class BaseFit(Result):
    """Base parameters that explain measured forces best.

    Attributes
    ----------
    names : tuple of str
        Base parameters by their leading standard parameter, then the model's parameters of ``also``.
    values, errors : dict of str to float
        Estimates and their standard errors, infinite where the motion does not tell.
    covariance : (k, k) array
        In the order of ``names``; NaN where the motion does not tell.
    sigma : dict of str to float
        Standard deviation of each generalized force's noise, by velocity, as given or found.
    residuals : (n_v, samples) array
        Measured less computed forces (N, N m).
    condition : float
        Of the weighted columns, each at length 1: how well the motion excites the parameters (1 is best).
    undetermined : tuple of str
        What the motion does not tell apart.
    """

    KEYS = same_keys("values", "errors", "covariance", "sigma", "condition", "undetermined")
    base: BaseParameters
    names: tuple[str, ...]
    values: dict[str, float]
    errors: dict[str, float]
    covariance: Array
    sigma: dict[str, float]
    residuals: Array
    condition: float
    undetermined: tuple[str, ...]

    @property
    def relative_errors(self) -> dict[str, float]:
        """Standard errors over the estimates."""
        return {n: self.errors[n] / abs(x) if x else float("inf") for n, x in self.values.items()}

    @property
    def title(self) -> str:
        return f"base parameters of {self.base.module.name} from measured forces"

    @property
    def tables(self) -> list[ResultTable]:
        """What was found, and how sure it is."""
        return [ResultTable(["", "value", "error"], [[n, x, self.errors[n]] for n, x in self.values.items()])]

    @property
    def facts(self) -> list[tuple[str, str]]:
        texts = self.base.texts
        rows = []
        for name, value in self.values.items():
            error = self.errors[name]
            determined = f"+- {error:.2g}" if np.isfinite(error) else "not determined by the motion"
            rows.append((f"{value:.6g}", f"{determined}   {texts.get(name, name)}"))
        noise = ", ".join(f"{name} {x:.3g}" for name, x in self.sigma.items())
        return [*rows, ("noise", noise), ("condition", f"{self.condition:.3g}")]


def fit_base(
    base: BaseParameters,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    tau: ArrayLike,
    *,
    also: Sequence[str] = (),
    sigma: ArrayLike | None = None,
    u: Any = None,
) -> BaseFit:
    """Find base parameters, and others in which forces are linear, from measured motions and forces.

    Parameters
    ----------
    q, v, a : (n_q, k), (n_v, k), (n_v, k) arrays
        Measured motion, k samples; accelerations come from filtered differences.
    tau : (n_v, k) array
        Measured generalized forces, in the order of ``v_names``; rows or samples that are NaN are left out.
    also : sequence of str, optional
        Parameters of the model in which the forces are linear, such as coefficients of friction or the inertia of a
        drive; others that are not inertial keep the module's values.
    sigma : (n_v,) array, optional
        Standard deviations of the noise of tau; found from the residuals by default.
    u : optional
        Inputs, as for ``bind``, if the model has any whose forces are not part of tau.

    Returns
    -------
    BaseFit
    """
    module = base.module
    if module.layout.n_c:
        raise cannot(
            f"model {module.name!r} has loops or other constraints, whose forces are in tau too; fit() of base "
            "parameters needs a tree; use mod.fit(data, parameters)"
        )
    measured = np.asarray(read_numbers("tau", tau), dtype=float)
    rows = base.regressor(q, v, a)
    if measured.ndim != 2 or rows.ndim != 3 or measured.shape != rows.shape[::2]:
        raise ill_shaped(f"tau must have shape ({module.n_v}, k) with k samples, as v has, not {measured.shape}")
    rest, further = _not_inertial(base, (q, v, a), read_names("also", also), u)
    names = (*base.names, *further)
    data = _Data(np.concatenate([rows, *(column[:, None] for column in further.values())], axis=1), measured - rest)
    if data.count <= len(names):
        raise ill_shaped(f"{data.count} finite values of tau cannot determine {len(names)} parameters")
    if sigma is not None:
        spread = np.asarray(read_numbers("sigma", sigma), dtype=float) * np.ones(module.n_v)
        if not (spread > 0.0).all():
            raise off_range("sigma must be positive, a standard deviation for each generalized force")
    else:
        spread = data.sizes()
        for _ in range(ROUNDS):
            spread = data.noise(data.solve(spread)[0], len(names))
    beta, covariance, condition, weak = data.solve(spread)
    with np.errstate(invalid="ignore"):
        deviations = np.sqrt(np.diag(covariance))
    return BaseFit(
        base,
        names,
        dict(zip(names, map(float, beta), strict=True)),
        {name: float("inf") if weak[k] else float(deviations[k]) for k, name in enumerate(names)},
        covariance,
        dict(zip(module.v_names, map(float, spread), strict=True)),
        data.residuals(beta),
        condition,
        tuple(name for name, is_weak in zip(names, weak, strict=True) if is_weak),
    )


class _Data:
    """Columns (n_v, unknowns, k) and what they have to give (n_v, k), where that is known."""

    def __init__(self, columns: Array, target: Array) -> None:
        self.columns, self.target = columns, target
        self.there = np.isfinite(target) & np.isfinite(columns).all(axis=1)
        self.count = int(self.there.sum())

    def sizes(self) -> Array:
        """What each force is like, 1 for one that vanishes."""
        squares = np.where(self.there, self.target, 0.0) ** 2
        result = np.sqrt(squares.sum(axis=1) / np.maximum(1, self.there.sum(axis=1)))
        return np.where(result > 0.0, result, 1.0)

    def residuals(self, beta: Array) -> Array:
        return np.asarray(self.target - np.tensordot(beta, self.columns, (0, 1)))

    def noise(self, beta: Array, unknowns: int) -> Array:
        """Standard deviation of each force's residuals, its share of the unknowns taken off."""
        squares = np.where(self.there, self.residuals(beta), 0.0) ** 2
        free = np.maximum(1, self.there.sum(axis=1)) * (1.0 - unknowns / self.count)
        return np.asarray(np.maximum(np.sqrt(squares.sum(axis=1) / free), MEASURED * self.sizes()))

    def solve(self, spread: Array) -> tuple[Array, Array, float, Any]:
        """Estimates, covariance, condition and which unknowns the rows do not tell, by singular values."""
        there = self.there
        rows = (np.moveaxis(self.columns, 1, -1) / spread[:, None, None])[there]
        right = (self.target / spread[:, None])[there]
        sizes = np.linalg.norm(rows, axis=0)
        scale = np.where(sizes > 0.0, sizes, 1.0)
        U, s, Vt = algebra.svd(rows / scale, full_matrices=False)
        determined = s > IDENTIFIED * s[0]
        beta = (Vt[determined].T @ ((U[:, determined].T @ right) / s[determined])) / scale
        covariance = (Vt[determined].T / s[determined] ** 2) @ Vt[determined] / np.outer(scale, scale)
        weak = (np.abs(Vt[~determined]) > np.sqrt(IDENTIFIED)).any(axis=0)
        covariance[weak], covariance[:, weak] = np.nan, np.nan
        return beta, covariance, float(s[0] / s[-1]) if s[-1] > 0.0 else float("inf"), weak


def _not_inertial(
    base: BaseParameters, motion: tuple[ArrayLike, ArrayLike, ArrayLike], also: tuple[str, ...], u: Any
) -> tuple[Array, dict[str, Array]]:
    """Forces that are not inertial without those of the parameters of ``also``, and the column of each of these."""
    module = base.module
    check_names("parameter", also, module.p_names)
    values = dict(zip(module.p_names, map(float, module.p), strict=True))

    def forces(name: str, factor: float) -> Array:
        return np.asarray(inertial_remainder(module, *motion, p=values | {name: factor * size}, u=u))

    rest = np.asarray(inertial_remainder(module, *motion, u=u))
    whole = float(np.nanmax(np.abs(module.inverse_dynamics(*motion)), initial=0.0))
    columns: dict[str, Array] = {}
    for name in also:
        size = values[name] or 1.0
        first, second, third = (forces(name, factor) for factor in (1.0, 2.0, 3.0))
        columns[name] = (second - first) / size
        allowed = LINEAR * max(whole, float(np.nanmax(np.abs(third), initial=0.0)))
        if np.nanmax(np.abs(third - 2.0 * second + first), initial=0.0) > allowed:
            raise cannot(f"forces are not linear in {name}; use mod.fit(data, parameters)")
        if np.nanmax(np.abs(second - first), initial=0.0) <= allowed:
            raise cannot(
                f"{name} changes only forces of inertia and gravity, which the base parameters include already"
            )
        if np.nanmax(np.abs(regressor(module, *motion, p=values | {name: 2.0 * size}) - regressor(module, *motion))):
            raise cannot(f"{name} changes the geometry; use mod.fit(data, parameters)")
        rest = rest - values[name] * columns[name]
    doubled = {name: 2.0 * (values[name] or 1.0) for name in also}
    every = np.asarray(inertial_remainder(module, *motion, p=values | doubled, u=u))
    total = sum((doubled[name] * column for name, column in columns.items()), rest)
    largest = max(whole, float(np.nanmax(np.abs(every), initial=0.0)))
    if np.nanmax(np.abs(every - total), initial=0.0) > LINEAR * largest:
        raise cannot(f"forces are not linear in {', '.join(also)} together; fit only one factor of each product")
    return rest, columns


# -- base parameters ---------------------------------------------------------------------------------------------------

# Columns of Y that vanish, or depend on others, at all states belong to parameters without effect of their own. Which
# do is found from a QR factorization at random states (M. Gautier, Numerical calculation of the base inertial
# parameters of robots, J. Robotic Systems 8 (1991), 485-506); it holds for joints of any kind, and loops too, by the
# directions that their constraints leave.


SEED = 1991
#: Rows of the regressor for each column, so that random states miss no direction.
ROWS = 4
SPARE = 8  #: states more, for models of few bodies
#: In which order parameters of a body become base parameters: for joints about z those of Khalil's rules remain, as
#: masses and first moments along the axis are the first that go to the parent.
ORDER = ("Izz", "Ixx", "Iyy", "Ixy", "Ixz", "Iyz", "mx", "my", "mz", "m")


@dataclass(frozen=True, repr=False)
class BaseParameters(Result):
    """The inertial parameters that the motion of a mechanism tells: combinations of the standard ones.

    Attributes
    ----------
    names : tuple of str
        The standard parameter that each base parameter contains with factor 1, and no other one contains.
    standard : tuple of str
        All standard parameters, ten of each body, in the order of the regressor's columns.
    combination : (n_base, 10 n_bodies) array
        K with beta = K pi.
    without_effect : tuple of str
        Standard parameters of which no generalized force depends.
    weakest : float
        The least effect of a base parameter of its own over that of its column, 1 where columns are at right angles.
    states : int
        Random states that were looked at.
    """

    KEYS = same_keys("names", "standard", "combination", "values", "without_effect", "weakest", "states")
    module: BoundModel
    names: tuple[str, ...]
    standard: tuple[str, ...]
    combination: Array
    without_effect: tuple[str, ...]
    weakest: float
    states: int

    def __len__(self) -> int:
        return len(self.names)

    @property
    def texts(self) -> dict[str, str]:
        """Each base parameter as text: ``{"Izz(upper)": "Izz(upper) + 0.25 m(lower)"}``."""
        return {name: self._text(row) for name, row in zip(self.names, self.combination, strict=True)}

    def _text(self, row: Array) -> str:
        order = sorted(np.flatnonzero(row), key=lambda k: self.standard[k] not in self.names)
        parts: list[str] = []
        for k in order:
            sign = "-" if row[k] < 0.0 else "+" if parts else ""
            factor = "" if abs(row[k]) == 1.0 else f"{abs(row[k]):.6g} "
            parts.append(f"{sign}{' ' if parts else ''}{factor}{self.standard[k]}")
        return " ".join(parts)

    def values_of(self, parameters: Mapping[str, float] | None = None, p: Any = None) -> dict[str, float]:
        """The base parameters of standard ones.

        Parameters
        ----------
        parameters : mapping of str to float, optional
            Standard parameters that differ from those of the model.
        p : optional
            Parameters of the model, as for ``bind``.

        Returns
        -------
        dict of str to float

        Raises
        ------
        UsageError
            An unknown name.
        """
        standard = standard_parameters(self.module, p)
        check_names("standard parameter", parameters or (), self.standard)
        standard |= {name: float(value) for name, value in (parameters or {}).items()}
        values = self.combination @ np.array([standard[name] for name in self.standard])
        return dict(zip(self.names, map(float, values), strict=True))

    @property
    def values(self) -> dict[str, float]:
        """The base parameters of the model itself."""
        return self.values_of()

    def regressor(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, t: float = 0.0) -> Array:
        """Y_b(q, v, a): Y_b beta = Y pi.

        Parameters
        ----------
        q, v, a, t
            As for :func:`~.regressor.regressor`.

        Returns
        -------
        (n_v, n_base) or (n_v, n_base, k) array
        """
        columns = [self.standard.index(name) for name in self.names]
        return np.ascontiguousarray(regressor(self.module, q, v, a, t=t)[:, columns])

    def fit(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, tau: ArrayLike, **options: Any) -> BaseFit:
        """Find the base parameters from measured motions and forces: see :func:`~.base_parameters.fit_base`."""

        return fit_base(self, q, v, a, tau, **options)

    @property
    def title(self) -> str:
        return f"{len(self)} base parameters of {self.module.name}, of {len(self.standard)} standard ones"

    @property
    def facts(self) -> list[tuple[str, str]]:
        values = self.values
        rows = [(f"{values[name]:.6g}", text) for name, text in self.texts.items()]
        if self.without_effect:
            rows.append(("no effect", ", ".join(self.without_effect)))
        return rows


def base_parameters(module: BoundModel, /, *, least: float = EFFECT, seed: int = SEED, p: Any = None) -> BaseParameters:
    """Find the base parameters of a mechanism: how many inertial parameters its forces tell, and which combinations.

    Parameters
    ----------
    least : float, optional
        Effects smaller than this part of comparable ones count as none.  A file whose angles have six digits may want
        1e-5: an axis that should be vertical leans by their rounding.
    seed : int, optional
        Of the random states.
    p : optional
        As for ``bind``; what is found holds for these lengths.

    Returns
    -------
    BaseParameters

    Raises
    ------
    UsageError
        A model without bodies, or such a value of least.
    UnavailableError
        The model has first-order states.
    ProjectionError
        No random state could be put on the constraints.
    """
    require_support(module.layout, "base_parameters")
    if not 0.0 <= read_number("least", least) < 1.0:
        raise off_range(f"least must be 0 or positive and less than 1, not {least:g}")
    module = module.bind(p)
    standard = standard_names(module)
    count = ROWS * len(standard) // max(1, module.n_dof) + SPARE
    W = _observe(module, np.random.default_rng(seed), count)
    sizes = np.linalg.norm(W, axis=0)
    seen = sizes > least * _typical(sizes)
    chosen, weakest = _independent(W, np.where(seen, sizes, np.inf), least)
    combination = np.zeros((len(chosen), len(standard)))
    combination[range(len(chosen)), chosen] = 1.0
    others = [k for k in np.flatnonzero(seen) if k not in set(chosen)]
    if others and chosen:
        A, B = W[:, chosen] / sizes[chosen], W[:, others] / sizes[others]
        result = algebra.lstsq(A, B)
        result[np.abs(result) < ROUNDED_COEFFICIENT] = 0.0
        result *= sizes[others] / sizes[chosen][:, None]
        combination[:, others] = _rounded(result)
    return BaseParameters(
        module,
        tuple(standard[k] for k in chosen),
        standard,
        combination,
        tuple(name for name, there in zip(standard, seen, strict=True) if not there),
        weakest,
        count,
    )


def _typical(sizes: Array) -> Array:
    """The largest effect of comparable parameters of all bodies: of masses, of first moments, of moments of inertia."""
    bodies = sizes.reshape(-1, len(STANDARD))
    parts = [np.full(end - start, bodies[:, start:end].max()) for start, end in ((0, 1), (1, 4), (4, len(STANDARD)))]
    return np.tile(np.concatenate(parts), len(bodies))


def _rounded(result: Array) -> Array:
    """Whole numbers where only rounding parts an entry from one."""
    whole = np.round(result)
    return np.where((np.abs(result - whole) < ROUNDED_COEFFICIENT) & (whole != 0.0), whole, result)


def _independent(W: Array, sizes: Array, least: float) -> tuple[list[int], float]:
    """Columns that do not depend on those before them, bodies from ground outwards, and the least that is its own."""
    places = [STANDARD.index(name) for name in ORDER]
    order = [body + k for body in range(0, W.shape[1], len(STANDARD)) for k in places]
    basis = np.empty((0, len(W)))
    chosen, weakest = [], 1.0
    for k in order:
        if not np.isfinite(sizes[k]):
            continue
        rest = W[:, k] / sizes[k]
        for _ in range(2):  # twice is enough (W. Kahan; Parlett, The Symmetric Eigenvalue Problem, 1980, sec. 6-9)
            rest = rest - basis.T @ (basis @ rest)
        remainder = float(np.linalg.norm(rest))
        if remainder > least:
            basis = np.vstack([basis, rest / remainder])
            chosen.append(k)
            weakest = min(weakest, remainder)
    return chosen, weakest


def _observe(module: BoundModel, random: np.random.Generator, count: int) -> Array:
    """The regressor at random states, one row for each direction of motion, in units of one kind."""
    scales = module.layout.scales
    q, v, a = random_states(module, random, count)
    W = np.moveaxis(regressor(module, q, v, a), -1, 0)
    if module.layout.n_c:
        C_q = np.moveaxis(np.asarray(module.constraint_jacobian(q, rows="all")), -1, 0)
        W = np.concatenate([free_motions(C, scales).T @ y for C, y in zip(C_q, W, strict=True)])
    else:
        W = (scales.q[:, None] * W).reshape(-1, W.shape[-1])
    W = W[np.isfinite(W).all(axis=1)]
    if not len(W):
        raise ProjectionError(f"model {module.name!r} has no finite regressor at any of {count} random states")
    return np.asarray(W)
