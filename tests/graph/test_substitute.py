import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eomgen.graph import Graph, evaluate, substitute, symbols_of


def test_all_at_once_and_simplified():
    g = Graph()
    x, y, z = (g.symbol(n) for n in "xyz")
    f = x * y + g.apply("sin", x - y)
    assert substitute([f, z], {x: y, y: x}) == [x * y + g.apply("sin", y - x), z]
    assert substitute([f], {x: y}) == [y * y]
    assert substitute([f], {x: g.zero}) == [-g.apply("sin", y)]
    assert substitute([x], {x: x + 1}) == [x + 1]  # replacements are not searched again
    assert substitute([], {}) == []


def test_subexpressions_can_be_replaced():
    g = Graph()
    x, y, s = (g.symbol(n) for n in "xys")
    assert substitute([g.apply("sin", x) * y + x], {g.apply("sin", x): s}) == [s * y + x]


def test_only_what_depends_on_a_replaced_node_is_rebuilt():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    big = x
    for _ in range(100):
        big = g.apply("sin", big) * x
    f = big + y
    before = len(g.nodes)
    substitute([f], {y: x})
    assert len(g.nodes) == before + 1


def test_symbols():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    assert symbols_of([x * 2, g.apply("sin", y)]) == {"x", "y"}
    assert symbols_of([g.one]) == symbols_of([]) == set()


def test_graphs_do_not_mix():
    g = Graph()
    x = g.symbol("x")
    with pytest.raises(ValueError, match="different graphs"):
        substitute([x], {x: Graph().symbol("x")})


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_substituting_values_is_evaluating(data, twins):
    twin = data.draw(twins())
    (x, y, z) = twin.symbols
    inner = x * y + 0.25
    (f,) = substitute([twin.expr], {z: inner})
    point = {**twin.point, "z": twin.point["x"] * twin.point["y"] + 0.25}
    assert evaluate([f], twin.point)[0] == pytest.approx(evaluate([twin.expr], point)[0], rel=1e-9, abs=1e-9)
    assert "z" not in symbols_of([f])
