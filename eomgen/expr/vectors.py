"""3-vectors and 3 x 3 matrices of expressions, as tuples; zeros and ones fold as everywhere."""

from __future__ import annotations

from collections.abc import Sequence

from .core import Expr, Graph

Vec3 = tuple[Expr, Expr, Expr]
Mat3 = tuple[Vec3, Vec3, Vec3]  # rows
Rows = tuple[tuple[Expr, ...], ...]  # of a matrix of any size


def vector(graph: Graph, values: Sequence[Expr | float]) -> Vec3:
    """A vector from three Exprs or numbers."""
    x, y, z = (graph.lift(v) for v in values)
    return (x, y, z)


def matrix(graph: Graph, rows: Sequence[Sequence[Expr | float]]) -> Mat3:
    """A matrix from rows of Exprs or numbers."""
    return tuple(vector(graph, row) for row in rows)  # type: ignore[return-value]


def zero(graph: Graph) -> Vec3:
    """The zero vector."""
    return (graph.zero, graph.zero, graph.zero)


def identity(graph: Graph) -> Mat3:
    """The unit matrix."""
    o, i = graph.zero, graph.one
    return ((i, o, o), (o, i, o), (o, o, i))


def add(a: Vec3, b: Vec3) -> Vec3:
    """a + b"""
    (x, y, z), (u, v, w) = a, b
    return (_sum(x, u), _sum(y, v), _sum(z, w))


def _sum(x: Expr, y: Expr) -> Expr:
    """x + y, one of which is zero more often than not: of planar motion, of axes of frames, of what stands still."""
    graph = x.graph
    zero = graph.zero.id
    if y.id == zero:
        return x
    return y if x.id == zero else Expr(graph, graph.add(x.id, y.id))


def sub(a: Vec3, b: Vec3) -> Vec3:
    """a - b"""
    (x, y, z), (u, v, w) = a, b
    return (_difference(x, u), _difference(y, v), _difference(z, w))


def _difference(x: Expr, y: Expr) -> Expr:
    graph = x.graph
    return x if y.id == graph.zero.id else Expr(graph, graph.sub(x.id, y.id))


def neg(a: Vec3) -> Vec3:
    """-a"""
    return (-a[0], -a[1], -a[2])


def scale(s: Expr, a: Vec3) -> Vec3:
    """s a"""
    graph = s.graph
    none, mul = graph.zero.id, graph.mul
    x, y, z = (c if c.id == none else Expr(graph, mul(s.id, c.id)) for c in a)
    return (x, y, z)


def dot(a: Vec3, b: Vec3) -> Expr:
    """a . b"""
    (x, y, z), (u, v, w) = a, b
    graph = x.graph
    zero = graph.zero
    none, total = zero.id, zero.id
    i, j = x.id, u.id
    if i != none and j != none:  # as in sums, most are zero
        total = graph.mul(i, j)
    i, j = y.id, v.id
    if i != none and j != none:
        total = graph.mul(i, j) if total == none else graph.add(total, graph.mul(i, j))
    i, j = z.id, w.id
    if i != none and j != none:
        total = graph.mul(i, j) if total == none else graph.add(total, graph.mul(i, j))
    return zero if total == none else Expr(graph, total)


def three(values: Sequence[Expr], at: int) -> Vec3:
    """Three values from a place on, as a vector."""
    return values[at], values[at + 1], values[at + 2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """a x b"""
    (x, y, z), (u, v, w) = a, b
    return (_determinant(y, z, v, w), _determinant(z, x, w, u), _determinant(x, y, u, v))


def _determinant(x: Expr, y: Expr, u: Expr, v: Expr) -> Expr:
    """x v - y u"""
    graph = x.graph
    zero = graph.zero
    none = zero.id
    i, j, k, n = x.id, v.id, y.id, u.id
    if i == none or j == none:
        return zero if k == none or n == none else Expr(graph, graph.neg(graph.mul(k, n)))
    product = graph.mul(i, j)
    return Expr(graph, product if k == none or n == none else graph.sub(product, graph.mul(k, n)))


def times(m: Mat3, a: Vec3) -> Vec3:
    """m a"""
    return (dot(m[0], a), dot(m[1], a), dot(m[2], a))


def transpose_times(m: Mat3, a: Vec3) -> Vec3:
    """m^T a"""
    c = transpose(m)
    return (dot(c[0], a), dot(c[1], a), dot(c[2], a))


def transpose(m: Mat3) -> Mat3:
    """m^T"""
    return (
        (m[0][0], m[1][0], m[2][0]),
        (m[0][1], m[1][1], m[2][1]),
        (m[0][2], m[1][2], m[2][2]),
    )


def product(a: Mat3, b: Mat3) -> Mat3:
    """a b"""
    c = transpose(b)
    return tuple(tuple(dot(row, col) for col in c) for row in a)  # type: ignore[return-value]
