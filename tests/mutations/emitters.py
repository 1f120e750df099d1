"""Faults in the program stage and the emitters: factors, straight-line loops, series, C and NumPy text."""

from __future__ import annotations

from mutations.fault import Fault

LOOPS, STRAIGHT = "tests/emit/test_c_loops.py", "tests/emit/test_c_straight.py"
SERIES, PROGRAM_LOOPS = "eomgen/emit/c_series.py", "eomgen/program/loops.py"
RECURRENCE = "tests/emit/test_c_series.py"
MODELS = "tests/emit/test_c_models.py"
STRAIGHT_SOLVE = f"{MODELS}::test_accelerations_are_those_of_a_solve_with_multipliers[straight]"
NEAREST = f"{MODELS}::test_rates_are_those_of_the_nearest_state_on_the_constraints[straight]"
SOLVE = f"{LOOPS}::test_rhs_equals_a_multiplier_solve_on_the_projected_state[plain]"

FAULTS = (
    Fault(
        "factor-order", "eomgen/program/factor.py",
        "x[j] = x[j] - ratio * x[i]", "x[i] = x[i] - ratio * x[j]",
        "L^T D L: the first substitution goes the wrong way", ("tests/program/test_factor.py",),
    ),
    Fault(
        "factor-pivots", "eomgen/program/factor.py",
        "if j <= i:\n                    H[i, j]", "if j < i:\n                    H[i, j]",
        "L^T D L: the diagonal is not reduced", ("tests/program/test_factor.py",),
    ),
    Fault(
        "factor-positivity", "eomgen/program/factor.py",
        'conditions.append(graph.apply("lt", size * SINGULAR, d))', 'conditions.append(graph.apply("lt", -size, d))',
        "a motion without inertia is not noticed", ("tests/program/test_factor.py",),
    ),
    Fault(
        "sparse-factor", "eomgen/program/sparse.py",
        "for j in below[: a + 1]:", "for j in below[:a]:",
        "factor of a sparse Gram matrix: the diagonal is not reduced", ("tests/program/test_sparse.py",),
    ),
    Fault(
        "straight-particular", PROGRAM_LOOPS,
        "force = [x + y for x, y in zip(here[: terms.n_v], times(M, a), strict=True)]", "force = list(here[: terms.n_v])",
        "straight-line loops: the embedded force lacks M a_p", (SOLVE,),
    ),
    Fault(
        "straight-velocities", PROGRAM_LOOPS,
        "here = substitute([*terms.bias, *terms.gamma], dict(zip(v, moved, strict=True)))", "here = [*terms.bias, *terms.gamma]",
        "straight-line loops: forces of the velocities before their projection", (NEAREST,),
    ),
    Fault(
        "straight-determinant", PROGRAM_LOOPS,
        "x[l] = (p * b[1] - r * b[0]) * inverse", "x[l] = (p * b[1] + r * b[0]) * inverse",
        "straight-line loops: Cramer's rule with a wrong sign", (STRAIGHT_SOLVE,),
    ),
    Fault(
        "straight-sound", PROGRAM_LOOPS,
        "sound = condition if sound == graph.one else graph.apply(\"and\", sound, condition)", "sound = graph.one",
        "straight-line loops: a bad partition is not told", (f"{LOOPS}::test_a_bad_preference_is_left_alone_by_rhs_and_reported_where_the_set_is_fixed",),
    ),
    Fault(
        "residual-slopes-multipliers", "eomgen/program/slopes.py",
        "constraint_forces = [r + c * l for r, c in zip(constraint_forces, row, strict=True)]", "constraint_forces = [r - c * l for r, c in zip(constraint_forces, row, strict=True)]",
        "derivatives of C_q^T l have the wrong sign", (f"{LOOPS}::test_jacobian_equals_central_differences_of_rhs_in_every_direction[plain]",),
    ),
    Fault(
        "residual-slopes-gamma", "eomgen/program/slopes.py",
        "                r = r + c * x\n", "                r = r\n",
        "derivatives of C_q a + gamma lack C_qq a", (f"{LOOPS}::test_jacobian_equals_central_differences_of_rhs_in_every_direction[plain]",),
    ),
    Fault(
        "hoisting", "eomgen/program/hoist.py",
        'if node[0] == "const" or node[1] in names:', 'if node[0] == "const" or node[1] in names or node[1] == "t":',
        "what depends on time is computed once", (f"{LOOPS}::test_rhs_equals_a_multiplier_solve_on_the_projected_state[driven]",),
    ),
    Fault(
        "series-square", SERIES,
        'return f"{self._sum(p, p)} + 2.0*{self._zero(p)}*b{p}"', 'return f"{self._sum(p, p)} + {self._zero(p)}*b{p}"',
        "Taylor coefficients of a square: a factor 2", (RECURRENCE,),
    ),
    Fault(
        "series-quotient", SERIES,
        'return f"-({rest} + {last})*{inverse}"', 'return f"-({last})*{inverse}"',
        "Taylor coefficients of a reciprocal: a sum is left out", (RECURRENCE,),
    ),
    Fault(
        "series-cosine", SERIES,
        'return f"-({text})" if term.kind == "cos" else text', 'return text',
        "Taylor coefficients of the cosine have the wrong sign", (RECURRENCE,),
    ),
    Fault(
        "series-root", SERIES,
        "*(0.5*{self._reciprocal(i)})", "*({self._reciprocal(i)})",
        "Taylor coefficients of a root: a factor 1/2", (RECURRENCE,),
    ),
    Fault(
        "series-power", SERIES,
        "(({e} + 1.0)*inverse*{weighted} - {plain}", "(({e} + 1.0)*inverse*{weighted} + {plain}",
        "Taylor coefficients of a power: a sign", (RECURRENCE,),
    ),
    Fault(
        "series-atan2", SERIES,
        'sums, ends = f"{sums} - {self._sum(x, y, True)}", f"{ends} - b{x}*{self._zero(y)}"', 'sums, ends = f"{sums} - {self._sum(x, y, True)}", f"{ends} + b{x}*{self._zero(y)}"',
        "Taylor coefficients of atan2: a sign", (RECURRENCE,),
    ),
    Fault(
        "series-partner", "eomgen/program/series.py",
        'first, second = (self._apply("mul", k, k) for k in (operands[0], operands[-1]))', 'first, second = (self._apply("mul", k, k) for k in (operands[0], operands[0]))',
        "Taylor coefficients of atan2 are divided by 2 y^2", (RECURRENCE,),
    ),
    Fault(
        "c-smaller", "eomgen/emit/c_text.py",
        "return choose((a <= b) | (a != a), a, b);\\n}\\n\",\n    \"max\"", "return choose((a >= b) | (a != a), a, b);\\n}\\n\",\n    \"max\"",
        "min becomes max in C", (f"{STRAIGHT}::test_every_operation_means_what_the_evaluator_says",),
    ),
    Fault(
        "c-select", "eomgen/emit/c_text.py",
        'return f"choose({self.condition(node[1], piece)}, {self.real(node[2])}, {self.real(node[3])})"', 'return f"choose({self.condition(node[1], piece)}, {self.real(node[3])}, {self.real(node[2])})"',
        "the branches of a condition are exchanged in C", (f"{STRAIGHT}::test_every_operation_means_what_the_evaluator_says",),
    ),
    Fault(
        "c-angles", "eomgen/emit/angles.py",
        "sines + {start}, cosines + {start});", "sines + {start}, cosines + 0);",
        "cosines of several angles are stored in the wrong places", (f"{MODELS}::test_accelerations_are_those_of_a_solve_with_multipliers[columns]",),
    ),
    Fault(
        "numpy-atan2", "eomgen/emit/numpy_text.py",
        '"atan2": "np.arctan2({}, {})"', '"atan2": "np.arctan2({1}, {0})"',
        "arguments of atan2 are swapped in NumPy", ("tests/emit/test_numpy_operations.py",),
    ),
    Fault(
        "numpy-where", "eomgen/emit/numpy_text.py",
        "{self.operand(node[2])}, {self.operand(node[3])})", "{self.operand(node[3])}, {self.operand(node[2])})",
        "the branches of a condition are exchanged in NumPy", ("tests/emit/test_numpy_operations.py",),
    ),
    Fault(
        "numpy-time", "eomgen/runtime/numpy_drivers.py",
        'return np.asarray(self.blocks["rate"](t, q, u, c), dtype=float)', 'return np.asarray(self.blocks["rate"](0.0, q, u, c), dtype=float)',
        "C_t of driven constraints is that of t = 0 in NumPy", ("tests/constraints/test_drivers.py",),
    ),
)  # fmt: skip
