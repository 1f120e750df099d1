"""Equations of mechanisms with loops -> the parts that they are made of, for display.

With the constraints C v' + gamma = 0 on the tree's M_t v' = f_t + C^T lambda, v' = B v_i' + a holds, and M = B^T M_t B,
f = B^T (f_t - M_t a) (Shabana, Computational Dynamics, sec. 5.7).  The parts are short where M and f written out are
not.  Long ones stand in names that say what they are: entries of rotations and angular velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.operations import operations_with
from ..expr.core import LEAVES, Expr, reachable, substitute, symbols_of
from ..expr.identity import dependence, with_bounds
from ..expr.schedule import count
from .quantities import Formed, Quantities, Rows

LONG = 330  #: operations of M and f from which their parts are shown instead
SURELY = 1_500  #: operations beyond which nothing that is found equal makes them short
MANY = 12  #: named parts of M and f more than which are shown in groups
POINTS = 4  #: random positions at which it is tried whether a coordinate matters
Named = list[tuple[str, Expr]]


class TreeSystem(NamedTuple):
    """M_t v' = f_t + C^T lambda, C v' + gamma = 0, SymPy matrices.

    Attributes
    ----------
    mass_matrix : sympy.Matrix
        M_t (n_v, n_v)
    force : sympy.Matrix
        f_t (n_v, 1)
    constraint_jacobian : sympy.Matrix
        C (n_c, n_v)
    gamma : sympy.Matrix
        (n_c, 1)
    zeros : tuple of str
        Coordinates for which 0 stands, because M and f do not depend on them.
    """

    mass_matrix: Any
    force: Any
    constraint_jacobian: Any
    gamma: Any
    zeros: tuple[str, ...]


def is_long(quantities: Quantities) -> bool:
    """Whether M and f of a mechanism with loops are too long to be read in one piece."""
    if quantities.mobility.n_dof in (0, len(quantities.kinematics.v)):
        return False
    if count([*_flat(quantities.mass_matrix), *quantities.force]).total > SURELY:
        return True
    whole, named = quantities.motion
    return count([*whole, *(x for _, x in named)]).total > LONG


def tree_parts(quantities: Quantities, short: bool) -> Formed:
    """All entries of M_t (n_v, n_v), f_t (n_v,), C (n_c, n_v) and gamma (n_c,).

    On request with names in them, and at 0 of the coordinates on which M and f do not depend, which makes them shorter;
    these coordinates are ``extra``.
    """
    flat = [*_flat(quantities.equations.mass_matrix), *(-h for h in quantities.equations.bias)]
    flat += [*_flat(quantities.constraint_jacobian), *quantities.gamma]
    named: Named = []
    zeros: tuple[str, ...] = ()
    if short:
        zeros = _zero_rows(quantities, flat)
        graph = quantities.graph
        put = {graph.symbol(name): graph.zero for name in zeros}
        names, values = zip(*_motion_names(quantities), strict=True)
        flat, named = _with_names(substitute(flat, put), list(zip(names, substitute(values, put), strict=True)))
    return Formed(flat, named, zeros)


def _flat(rows: Rows) -> list[Expr]:
    return [x for row in rows for x in row]


def _zero_rows(quantities: Quantities, parts: Sequence[Expr]) -> tuple[str, ...]:
    """Coordinates on which M and f do not depend, such as the heading of a vehicle on a plane, tried at random.

    Nor may what decides between pieces, such as the place of a stop far away.  The parts have to be finite with 0 in
    the place of these coordinates.
    """
    k, mobility = quantities.kinematics, quantities.mobility
    whole = [*_flat(quantities.mass_matrix), *quantities.force]
    whole += _deciding(whole)
    random = np.random.default_rng(11)
    at: dict[str, np.ndarray] = {name: np.full(POINTS, x) for name, x in quantities.numbers.items()}
    for name in sorted(symbols_of([*whole, *parts]).difference(at, k.names)):
        at[name] = random.uniform(-1.0, 1.0, POINTS)
    moved: dict[str, np.ndarray] = {}
    for name, x in zip(k.names, mobility.q_reference, strict=True):
        at[name] = x + random.uniform(-0.3, 0.3, POINTS)
        moved[name] = at[name] + random.uniform(0.1, 0.5, POINTS)
    same: np.ndarray = np.all(dependence(whole, at, moved)[2], axis=0)
    constant = tuple(name for name, alike in zip(k.names, same, strict=True) if alike)
    if not constant:
        return ()
    at |= dict.fromkeys(constant, np.zeros(POINTS))
    return constant if np.isfinite(with_bounds(list(parts), at)[0]).all() else ()


def _deciding(expressions: Sequence[Expr]) -> list[Expr]:
    """The operands of operations that may be alike in a part of their domain: comparisons, max, contact, tables."""
    graph = expressions[0].graph
    analytic = operations_with(lambda row: row.analytic)
    result: dict[int, None] = {}
    for i in reachable(graph, (x.id for x in expressions)):
        operation, *operands = graph.nodes[i]
        if operation not in LEAVES and operation not in analytic:
            result |= dict.fromkeys(operands)
    return [Expr(graph, i) for i in result if graph.nodes[i][0] not in graph.calls]


def _motion_names(quantities: Quantities) -> Named:
    """R_<body>_ij and omega_<body>_x, of the axes in which the joint of the tree holds the body."""
    k = quantities.kinematics
    result: Named = []
    for i, link in enumerate(k.links):
        rotation = k.poses.link(i).rotation
        result += [(f"R_{link.name}_{r + 1}{c + 1}", rotation[r][c]) for r in range(3) for c in range(3)]
        result += [(f"omega_{link.name}_{axis}", x) for axis, x in zip("xyz", k.twists[i][0], strict=True)]
    return result


def _with_names(flat: Sequence[Expr], motion: Named) -> tuple[list[Expr], Named]:
    """Names for what is more than a symbol, where it stands in the expressions."""
    graph = flat[0].graph
    taken = symbols_of(flat)
    named: dict[Expr, str] = {}
    for name, x in motion:
        if x not in named and not _is_plain(x) and name not in taken:
            named[x] = name
    symbols = {x: graph.symbol(name) for x, name in named.items()}
    result = substitute(flat, symbols)
    used = symbols_of(result)
    parts: Named = []
    for value, name in reversed(named.items()):
        if name in used:
            inner = substitute([value], {x: symbol for x, symbol in symbols.items() if x != value})
            used |= symbols_of(inner)
            parts.append((name, inner[0]))
    return result, parts[::-1]


def _is_plain(x: Expr) -> bool:
    """A number, a symbol, or a sine or cosine of one, perhaps negative."""
    kind, *parts = x.node
    if kind == "neg":
        kind, *parts = x.graph.nodes[parts[0]]
    return kind in ("sym", "const", "sin", "cos")
