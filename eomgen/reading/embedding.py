"""Stage reading: tree equations, constraints -> the embedded system, with names for what the loops give.

M_e = B^T M B and f_e = -B^T (h + M b) with v = B v_i and v' = B v_i' + b (Shabana, sec. 5.7).  The dependent velocities
are found block by block: a block of the constraint equations holds as many rows as it has unknowns that no smaller part
of it can give, such as the two angles of a four-bar.  Up to two unknowns are solved by Cramer's rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain, count

from ..graph.core import Expr
from ..graph.evaluate import evaluate
from ..kinematics import Kinematics
from ..kinematics.mobility import Mobility
from ..equations.tree_equations import TreeEquations

FAIR = 0.05  #: of the largest entry: what a pivot has at least at the reference


class Embedding:
    """The embedded system of a mechanism.

    Attributes
    ----------
    named : list of (str, Expr)
        Names that stand as symbols in what follows, and their values, in order.
    transformation : list of list of Expr
        B (n_v, n_dof).
    particular : list of Expr
        b (n_v,)
    """

    def __init__(self, kinematics: Kinematics, mobility: Mobility, values: Mapping[str, float]) -> None:
        self.graph = kinematics.graph
        self.labels = kinematics.velocity_labels
        self.named: list[tuple[str, Expr]] = []
        self._taken = {node[1] for node in self.graph.nodes if node[0] == "sym"}
        self.free = [self.labels.index(name) for name in mobility.independent]
        c = kinematics.constraints
        self._rows = [[*c.jacobian[i], c.gamma[i]] for i in mobility.independent_rows]
        self._at = dict(values) | dict(zip(kinematics.names, mobility.q_reference, strict=True))
        self._at |= dict.fromkeys(kinematics.velocity_names, 0.0)
        zero, one, n = self.graph.zero, self.graph.one, len(kinematics.v)
        self._columns = [*self.free, n]
        self._solved = {j: [one if j == k else zero for k in self._columns] for j in self.free}
        for rows, unknowns in self._blocks([j for j in range(n) if j not in self.free]):
            self._solve(rows, unknowns)
        self.transformation = [self._solved[j][:-1] for j in range(n)]
        self.particular = [self._solved[j][-1] for j in range(n)]

    def system(self, tree: TreeEquations) -> tuple[list[list[Expr]], list[Expr]]:
        """M_e (n_dof, n_dof) and f_e (n_dof,)."""
        mass, b, n = tree.mass_matrix, self.particular, len(self.particular)
        columns = [[row[k] for row in self.transformation] for k in range(len(self.free))]
        weighted = [[self._dot(mass[i], column) for i in range(n)] for column in columns]
        rest = [tree.bias[i] + self._dot(mass[i], b) for i in range(n)]
        matrix = [[self._dot(a, w) if k <= i else None for k, w in enumerate(weighted)] for i, a in enumerate(columns)]
        full = [[x if x is not None else matrix[k][i] for k, x in enumerate(row)] for i, row in enumerate(matrix)]
        return full, [-self._dot(column, rest) for column in columns]  # type: ignore[return-value]

    def _dot(self, a: Sequence[Expr], b: Sequence[Expr]) -> Expr:
        total = self.graph.zero
        for x, y in zip(a, b, strict=True):
            total = total + x * y
        return total

    # -- the dependent velocities
    def _blocks(self, bound: Sequence[int]) -> list[tuple[list[int], list[int]]]:
        """Rows and unknowns of each block, in an order in which each needs only those before it."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

        if not bound:
            return []
        filled = [[int(not row[j].is_zero) for j in bound] for row in self._rows]
        match = maximum_bipartite_matching(csr_array(filled), perm_type="column")  # row -> unknown
        n = len(bound)
        owner = {int(j): i for i, j in enumerate(match)}
        needs = [[int(filled[owner[a]][b]) for b in range(n)] for a in range(n)]  # unknown a is given by what row
        _, label = connected_components(csr_array(needs), directed=True, connection="strong")
        groups = [[k for k in range(n) if label[k] == g] for g in sorted(set(label.tolist()))]
        ordered: list[list[int]] = []
        done: set[int] = set()
        while len(ordered) < len(groups):
            for group in groups:
                if group not in ordered and all(
                    b in done or b in group for a in group for b in range(n) if needs[a][b]
                ):
                    ordered.append(group)
                    done.update(group)
        return [([owner[k] for k in group], [bound[k] for k in group]) for group in ordered]

    def _solve(self, rows: list[int], unknowns: list[int]) -> None:
        left = [[self._rows[i][j] for j in unknowns] for i in rows]
        right = [[-self._known(self._rows[i], k, unknowns) for k in range(len(self._columns))] for i in rows]
        if len(rows) == 1:
            found = [[x / left[0][0] for x in right[0]]]
        elif len(rows) == 2:
            (a, b), (c, d) = left
            below = self._name("D", a * d - b * c)
            found = [
                [(x * d - b * y) / below for x, y in zip(*right, strict=True)],
                [(a * y - x * c) / below for x, y in zip(*right, strict=True)],
            ]
        else:
            found = self._eliminated(left, right)
        for j, row in zip(unknowns, found, strict=True):
            label = self.labels[j]
            names = [f"B_{label}" if len(self.free) == 1 else f"B_{label}_{self.labels[k]}" for k in self.free]
            names.append(f"b_{label}")
            self._solved[j] = [self._name(name, x) for name, x in zip(names, row, strict=True)]

    def _known(self, row: Sequence[Expr], k: int, unknowns: Sequence[int]) -> Expr:
        """What stands in column k of a row of [C_q | gamma] when the velocities found so far are put in."""
        total = row[-1] if k == len(self._columns) - 1 else self.graph.zero
        for j, found in self._solved.items():
            if j not in unknowns:
                total = total + row[j] * found[k]
        return total

    def _eliminated(self, left: list[list[Expr]], right: list[list[Expr]]) -> list[list[Expr]]:
        """Gauss-Jordan elimination; what it forms gets names."""
        n = len(left)
        rows = [[*a, *b] for a, b in zip(left, right, strict=True)]
        at = dict(self._at)
        for name, x in self.named:
            at[name] = float(evaluate([x], at)[0])
        numbers = [[float(x) for x in evaluate(row, at)] for row in rows]
        waiting, pivots = list(range(n)), dict[int, int]()
        while waiting:
            columns = [j for j in range(n) if j not in pivots]
            largest = max(abs(numbers[i][j]) for i in waiting for j in columns)
            fair = [(i, j) for i in waiting for j in columns if abs(numbers[i][j]) >= FAIR * largest]
            i, j = min(fair, key=lambda p: (sum(not x.is_zero for x in rows[p[0]]), p))
            waiting.remove(i)
            pivots[j] = i
            pivot, size = rows[i][j], numbers[i][j]
            rows[i] = [self._name("w", x / pivot) for x in rows[i]]
            numbers[i] = [x / size for x in numbers[i]]
            for k in range(n):
                factor, amount = rows[k][j], numbers[k][j]
                if k != i and not factor.is_zero:
                    rows[k] = [
                        self._name("w", x - factor * y) if not y.is_zero else x
                        for x, y in zip(rows[k], rows[i], strict=True)
                    ]
                    numbers[k] = [x - amount * y for x, y in zip(numbers[k], numbers[i], strict=True)]
        return [rows[pivots[j]][n:] for j in range(n)]

    def _name(self, name: str, value: Expr) -> Expr:
        """A name for a value that is more than a symbol or a number."""
        kind, *args = value.node
        if kind == "neg":
            kind = value.graph.nodes[args[0]][0]
        if kind in ("sym", "const"):
            return value
        text = next(x for x in chain([name], (f"{name}_{k}" for k in count(1))) if x not in self._taken)
        self._taken.add(text)
        self.named.append((text, value))
        return self.graph.symbol(text)
