from eomgen.graph import Graph, Operations, count, critical_path


def test_counts_by_hand():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    s = g.apply("sin", x + y)  # 1 addition, 1 sin
    a = s * s - 3 * x  # 2 multiplications, 1 subtraction
    b = -(a / y)  # 1 division, 1 negation
    c = g.apply("select", g.apply("lt", x, y), s, g.apply("abs", x))  # select, lt, abs
    d = (x + y) ** 3 + x**0.3  # (x+y)^2 (x+y): 2 multiplications; pow; 1 addition
    operations = count([b, c, d, b])
    assert operations == Operations(4, 3, 1, 1, {"pow": 1, "sin": 1}, {"abs": 1, "lt": 1, "select": 1})
    assert operations.total == 8
    assert count([]) == Operations()
    assert count([x, g.one]).total == 0


def test_counts_add_up():
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    a, b = count([g.apply("sin", x) * y]), count([g.apply("sin", x) + g.apply("cos", y), g.apply("abs", x)])
    assert a + b == Operations(1, 1, 0, 0, {"cos": 1, "sin": 2}, {"abs": 1})
    assert (a + b).as_dict()["functions"] == {"cos": 1, "sin": 2}
    assert sum([a, b], Operations()) == a + b


def test_shared_operations_count_once():
    g = Graph()
    y = g.symbol("x")
    for _ in range(1000):
        y = y * y + y  # 2^1000 operations written out
    assert count([y, y * 2]).total == 2001


def test_critical_path():
    g = Graph()
    w, x, y, z = (g.symbol(n) for n in "wxyz")
    assert critical_path([((w + x) + y) + z]) == 3
    assert critical_path([(w + x) + (y + z)]) == 2
    assert critical_path([x, -g.apply("sin", x * y)]) == 2  # a sign is free
    assert critical_path([]) == 0
    assert critical_path([x]) == 0
