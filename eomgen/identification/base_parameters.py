"""Identification: the regressor at random states -> the combinations of inertial parameters that forces can tell.

Columns of Y that vanish, or depend on others, at all states belong to parameters without effect of their own.  Which do
is found from a QR factorization at random states (M. Gautier, Numerical calculation of the base inertial parameters of
robots, J. Robotic Systems 8 (1991), 485-506); it holds for joints of any kind, and loops too, by the directions that
their constraints leave.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import algebra
from ..base.algebra import Array
from ..base.limits.analyses import EFFECT, ROUNDED_COEFFICIENT
from ..base.texts import as_html, as_text
from ..errors import ProjectionError, off_range
from ..runtime.near_names import unknown
from ..runtime.refusals import refuse_states
from ..runtime.room import read_number
from .random_states import free_directions, random_states
from .regressor import STANDARD, regressor, standard_names, standard_parameters

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from .base_fit import BaseFit

SEED = 1991
#: Rows of the regressor for each column, so that random states miss no direction.
ROWS = 4
SPARE = 8  #: states more, for models of few bodies
#: In which order parameters of a body become base parameters: for joints about z those of Khalil's rules remain, as
#: masses and first moments along the axis are the first that go to the parent.
ORDER = ("Izz", "Ixx", "Iyy", "Ixy", "Ixz", "Iyz", "mx", "my", "mz", "m")


@dataclass(frozen=True)
class BaseParameters:
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
        own = standard_parameters(self.module, p)
        for name, value in (parameters or {}).items():
            if name not in own:
                raise unknown("standard parameter", name, self.standard)
            own[name] = float(value)
        values = self.combination @ np.array([own[name] for name in self.standard])
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
        """Find the base parameters from measured motions and forces: see :func:`~.base_fit.fit_base`."""
        from .base_fit import fit_base

        return fit_base(self, q, v, a, tau, **options)

    def _facts(self) -> list[tuple[str, str]]:
        values = self.values
        rows = [(f"{values[name]:.6g}", text) for name, text in self.texts.items()]
        if self.without_effect:
            rows.append(("no effect", ", ".join(self.without_effect)))
        return rows

    def _title(self) -> str:
        return f"{len(self)} base parameters of {self.module.name}, of {len(self.standard)} standard ones"

    def __repr__(self) -> str:
        return as_text(self._title(), self._facts())

    def _repr_html_(self) -> str:
        return as_html(self._title(), self._facts())


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
    refuse_states(module.layout, "base_parameters")
    if not 0.0 <= read_number("least", least) < 1.0:
        raise off_range(f"least must be 0 or positive and less than 1, not {least:g}")
    module = module if p is None else module.bind(p)
    standard = standard_names(module)
    count = ROWS * len(standard) // max(1, module.n_dof) + SPARE
    W = _observe(module, np.random.default_rng(seed), count)
    sizes = np.linalg.norm(W, axis=0)
    seen = sizes > least * _usual(sizes)
    chosen, weakest = _independent(W, np.where(seen, sizes, np.inf), least)
    combination = np.zeros((len(chosen), len(standard)))
    combination[range(len(chosen)), chosen] = 1.0
    others = [k for k in np.flatnonzero(seen) if k not in set(chosen)]
    if others and chosen:
        A, B = W[:, chosen] / sizes[chosen], W[:, others] / sizes[others]
        found = algebra.lstsq(A, B)
        found[np.abs(found) < ROUNDED_COEFFICIENT] = 0.0
        found *= sizes[others] / sizes[chosen][:, None]
        combination[:, others] = _settled(found)
    return BaseParameters(
        module,
        tuple(standard[k] for k in chosen),
        standard,
        combination,
        tuple(name for name, there in zip(standard, seen, strict=True) if not there),
        weakest,
        count,
    )


def _usual(sizes: Array) -> Array:
    """The largest effect of comparable parameters of all bodies: of masses, of first moments, of moments of inertia."""
    bodies = sizes.reshape(-1, len(STANDARD))
    parts = [np.full(end - start, bodies[:, start:end].max()) for start, end in ((0, 1), (1, 4), (4, len(STANDARD)))]
    return np.tile(np.concatenate(parts), len(bodies))


def _settled(found: Array) -> Array:
    """Whole numbers where only rounding parts an entry from one."""
    whole = np.round(found)
    return np.where((np.abs(found - whole) < ROUNDED_COEFFICIENT) & (whole != 0.0), whole, found)


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
        own = float(np.linalg.norm(rest))
        if own > least:
            basis = np.vstack([basis, rest / own])
            chosen.append(k)
            weakest = min(weakest, own)
    return chosen, weakest


def _observe(module: BoundModel, random: np.random.Generator, count: int) -> Array:
    """The regressor at random states, one row for each direction of motion, in units of one kind."""
    layout, s = module.layout, module.layout.scales.q
    q, v, a = random_states(module, random, count)
    Y = regressor(module, q, v, a) * s[:, None, None]
    if layout.n_c:
        C_q = np.moveaxis(np.asarray(module.constraint_jacobian(q, rows="all")), -1, 0)
        free = [free_directions(layout.scales.jacobian(C)) for C in C_q]
        rows = [f.T @ y for f, y in zip(free, np.moveaxis(Y, -1, 0), strict=True)]
    else:
        rows = list(np.moveaxis(Y, -1, 0))
    W = np.concatenate(rows)
    W = W[np.isfinite(W).all(axis=1)]
    if not len(W):
        raise ProjectionError(f"model {module.name!r} has no finite regressor at any of {count} random states")
    return np.asarray(W)
