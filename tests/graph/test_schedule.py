import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eomgen.graph import Graph, chunk, jacobian, order
from eomgen.graph import vectors as vec
from eomgen.graph.schedule import crossings


def arm(n):
    """Torques of a spatial arm of n links by the recursive Newton-Euler algorithm: a graph as derivations make it."""
    g = Graph()
    q, v, a = ([g.symbol(f"{s}{k}") for k in range(n)] for s in "qva")
    w, dw, acc = vec.zero(g), vec.zero(g), vec.vector(g, [0, 0, 9.81])
    links = []
    for k in range(n):
        s, c, o, i = g.apply("sin", q[k]), g.apply("cos", q[k]), g.zero, g.one
        axis, turn = (
            ((i, o, o), ((i, o, o), (o, c, -s), (o, s, c)))
            if k % 2
            else ((o, o, i), ((c, -s, o), (s, c, o), (o, o, i)))
        )
        arm_, mass = vec.vector(g, [g.symbol(f"L{k}"), 0.1, 0]), g.symbol(f"m{k}")
        w, rate = vec.transpose_times(turn, w), vec.scale(v[k], axis)
        dw = vec.add(vec.transpose_times(turn, dw), vec.add(vec.cross(w, rate), vec.scale(a[k], axis)))
        w = vec.add(w, rate)
        acc = vec.add(vec.transpose_times(turn, acc), vec.add(vec.cross(dw, arm_), vec.cross(w, vec.cross(w, arm_))))
        links.append((axis, turn, arm_, vec.scale(mass, acc), vec.add(dw, vec.cross(w, vec.scale(mass, w)))))
    force, moment, torques = vec.zero(g), vec.zero(g), []
    for axis, turn, arm_, own_force, own_moment in reversed(links):
        moment = vec.add(vec.add(own_moment, moment), vec.cross(arm_, vec.add(own_force, force)))
        force = vec.add(own_force, force)
        torques.append(vec.dot(axis, moment))
        force, moment = vec.times(turn, force), vec.times(turn, moment)
    return g, q, v, a, torques[::-1]


def check_order(g, statements, outputs):
    wanted, stack = set(), [y.id for y in outputs]
    while stack:
        i = stack.pop()
        if i not in wanted and g.nodes[i][0] not in ("const", "sym"):
            wanted.add(i)
            stack.extend(g.nodes[i][1:])
    assert len(statements) == len(set(statements))
    assert set(statements) == wanted
    place = {i: k for k, i in enumerate(statements)}
    assert all(place.get(j, -1) < place[i] for i in statements for j in g.nodes[i][1:])


def check_chunks(g, chunks, statements, outputs, size):
    assert [i for c in chunks for i in c.statements] == list(statements)
    published = set()
    for k, c in enumerate(chunks):
        assert 1 <= len(c.statements) <= size
        known = set(c.imports)
        assert known <= published
        later = {j for d in chunks[k + 1 :] for i in d.statements for j in g.nodes[i][1:]}
        used = set()
        for i in c.statements:
            args = {j for j in g.nodes[i][1:] if g.nodes[j][0] not in ("const", "sym")}
            assert args <= known
            used |= args
            known.add(i)
        assert set(c.imports) <= used
        assert set(c.exports) == later & set(c.statements)
        assert set(c.results) == {y.id for y in outputs} & set(c.statements)
        published |= set(c.exports)


def test_the_heavier_operand_comes_first():
    """(a + b) (c d + e f): left to right needs 3 values at a time, the heavier side first 2."""
    g = Graph()
    a, b, c, d, e, f = (g.symbol(n) for n in "abcdef")
    y = (a + b) * (c * d + e * f)
    statements = order([y])
    check_order(g, statements, [y])
    assert [g.nodes[i][0] for i in statements] == ["mul", "mul", "add", "add", "mul"]
    assert max(crossings(g, statements)) == 2


def test_crossings_by_hand():
    g = Graph()
    x = g.symbol("x")
    s = g.apply("sin", x)
    c = g.apply("cos", x)
    p = s * c
    y = p + s
    assert crossings(g, [s.id, c.id, p.id, y.id]) == [0, 1, 2, 2, 0]


def test_leaves_and_repeated_outputs():
    g = Graph()
    x = g.symbol("x")
    s = g.apply("sin", x)
    assert order([x, s, g.one, s]) == [s.id]
    assert order([]) == order([x]) == []
    assert chunk([], [x]) == chunk([], []) == []
    (only,) = chunk([s.id], [x, s, s])
    assert only.results == (s.id,)
    with pytest.raises(ValueError, match="at least 1"):
        chunk([s.id], [s], 0)


def test_a_real_derivation_has_few_live_values_and_narrow_cuts():
    g, q, v, a, torques = arm(8)
    outputs = [*torques, *jacobian(torques, q + v + a).values()]
    statements = order(outputs)
    check_order(g, statements, outputs)
    live = crossings(g, statements)
    assert max(live) <= max(crossings(g, sorted(statements)))
    assert max(live) < len(statements) / 20
    chunks = chunk(statements, outputs, 500)
    check_chunks(g, chunks, statements, outputs, 500)
    assert min(len(c.statements) for c in chunks[:-1]) >= 250
    # cuts sit where fewer values cross than on average
    assert np.mean([len(c.imports) for c in chunks[1:]]) <= 0.8 * np.mean(live)


def test_a_waist_is_found():
    """Two wide parts joined by one value: the cut falls between them."""
    g = Graph()
    x = g.symbol("x")

    def wide(s):
        parts = [g.apply("sin", s * (k + 2)) for k in range(20)]
        while len(parts) > 1:
            parts = [u * w for u, w in zip(parts[::2], parts[1::2], strict=False)] + parts[len(parts) // 2 * 2 :]
        return parts[0]

    first = wide(x)
    y = wide(first)
    statements = order([y])
    half, second = chunk(statements, [y], 70)
    assert half.exports == second.imports == (first.id,)
    assert second.results == (y.id,)


def test_order_and_chunk_take_linear_time_and_no_recursion():
    g = Graph()
    x = y = g.symbol("x")
    for _ in range(50_000):
        y = g.apply("sin", y) + x
    started = time.perf_counter()
    statements = order([y])
    chunks = chunk(statements, [y], 2000)
    assert (time.perf_counter() - started) / len(statements) < 40e-6  # about 4e-6 on a quiet machine
    assert len(statements) == 100_000
    assert all(len(c.imports) == 1 for c in chunks[1:])
    assert max(crossings(g, statements)) == 1


@given(data=st.data())
@settings(max_examples=80, deadline=None, derandomize=True)
def test_random_orders_and_chunks_are_valid(data, twins):
    twin = data.draw(twins(size=20))
    outputs = [twin.expr, twin.expr * twin.symbols[0], twin.graph.apply("cos", twin.symbols[1]), twin.symbols[0]]
    statements = order(outputs)
    check_order(twin.graph, statements, outputs)
    size = data.draw(st.integers(1, 12))
    check_chunks(twin.graph, chunk(statements, outputs, size), statements, outputs, size)
