"""Stage graph: 3-vectors and 3 x 3 matrices of expressions, as tuples; zeros and ones fold as everywhere."""

from __future__ import annotations

from collections.abc import Sequence

from .core import Expr, Graph

Vec3 = tuple[Expr, Expr, Expr]
Mat3 = tuple[Vec3, Vec3, Vec3]  # rows


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
    graph = a[0].graph
    x, y, z = (Expr(graph, graph.add(i.id, k.id)) for i, k in zip(a, b, strict=True))
    return (x, y, z)


def sub(a: Vec3, b: Vec3) -> Vec3:
    """a - b"""
    graph = a[0].graph
    x, y, z = (Expr(graph, graph.sub(i.id, k.id)) for i, k in zip(a, b, strict=True))
    return (x, y, z)


def neg(a: Vec3) -> Vec3:
    """-a"""
    return (-a[0], -a[1], -a[2])


def scale(s: Expr, a: Vec3) -> Vec3:
    """s a"""
    return (s * a[0], s * a[1], s * a[2])


def dot(a: Vec3, b: Vec3) -> Expr:
    """a . b"""
    graph = a[0].graph
    mul, zero = graph.mul, graph.zero.id
    total = zero
    for x, y in zip(a, b, strict=True):
        i, j = x.id, y.id
        if i != zero and j != zero:  # most products vanish: of axes of frames, of what stands still
            total = mul(i, j) if total == zero else graph.add(total, mul(i, j))
    return Expr(graph, total)


def cross(a: Vec3, b: Vec3) -> Vec3:
    """a x b"""
    graph = a[0].graph
    mul, sub = graph.mul, graph.sub
    (i, j, k), (u, v, w) = (x.id for x in a), (x.id for x in b)
    return (
        Expr(graph, sub(mul(j, w), mul(k, v))),
        Expr(graph, sub(mul(k, u), mul(i, w))),
        Expr(graph, sub(mul(i, v), mul(j, u))),
    )


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
