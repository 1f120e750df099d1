"""Faults in row scaling, rank, tolerances and the linear algebra of loops (NumPy)."""

from __future__ import annotations

from mutations.fault import Fault

LOOPS, GRAM, ASSEMBLY = "tests/numeric/test_loops.py", "tests/numeric/test_gram.py", "tests/numeric/test_assembly.py"
SIZES, ROUNDING = "tests/constraints/test_row_sizes.py", "tests/graph/test_rounding.py"
EMBEDDED, SCALES = "eomgen/numeric/embedded.py", "eomgen/kinematics/row_scales.py"

FAULTS = (
    Fault(
        "row-scale-from-rounding", SCALES,
        "nothing = not np.isfinite(values).all() or bool(is_rounding(values, bounds).all())", "nothing = not np.isfinite(values).all()",
        "a gradient that is nothing but rounding gives its row a scale", (f"{SIZES}::test_a_relation_that_parameters_leave_idle_holds_nothing[numpy]",),
    ),
    Fault(
        "row-scale-of-written-rows", SCALES,
        "if written and _is_plain([x / found[i] for x in gradient]):", "if written:",
        "a relation that a user multiplied by anything keeps the scale of its kind", (SIZES,),
    ),
    Fault(
        "row-scale-small-loops", "eomgen/limits/descriptions.py",
        "SMALL_LOOP = 1e-3", "SMALL_LOOP = 1e-9",
        "rows of a loop far smaller than the mechanism are lost beside the others", ("tests/acceptance/test_small_loops.py", SIZES),
    ),
    Fault(
        "rounding-tolerance", "eomgen/limits/rounding.py",
        "ROUNDED = 64.0 * EPS", "ROUNDED = 6400.0 * EPS * 1e6",
        "what counts as rounding, times 1e8", (ROUNDING, SIZES),
    ),
    Fault(
        "rounding-of-products", "eomgen/graph/rounding.py",
        "abs(x[1]) * e[0] + abs(x[0]) * e[1],\n    \"div\"", "abs(x[1]) * e[0],\n    \"div\"",
        "bounds of rounding lose that of a product's second factor", (ROUNDING,),
    ),
    Fault(
        "rounding-terms", "eomgen/graph/rounding.py",
        "found[i] = found[operands[0]] + found[operands[1]]", "found[i] = graph.apply(\"abs\", Expr(graph, i))",
        "the size of a sum's terms is taken from the sum", (SIZES, ROUNDING),
    ),
    Fault(
        "settled-rotation-sign", "eomgen/graph/rounding.py",
        "graph.constant(math.copysign(1.0, value))", "graph.one",
        "a turn of half a turn becomes none", (ROUNDING,),
    ),
    Fault(
        "closed-row-tolerance", "eomgen/kinematics/loops.py",
        "not row.written and abs(value) <= ROUNDED * size", "not row.written and abs(value) <= 1e-2 * size",
        "a row that is a constant gap of 1 % counts as fulfilled", ("tests/kinematics/test_gaps_across_the_plane.py",),
    ),
    Fault(
        "tikhonov", "eomgen/limits/constraints.py",
        "\nTIKHONOV = 1e-12", "\nTIKHONOV = 1e-10",
        "the least regularisation of J J^T, times 100", (GRAM,),
    ),
    Fault(
        "term-below", "eomgen/limits/constraints.py",
        "\nBELOW = 1e-4", "\nBELOW = 1.0",
        "the regularisation of J J^T is not lowered below weak rows", (GRAM,),
    ),
    Fault(
        "gram-noise", "eomgen/numeric/gram.py",
        "weak ** (0.5 * order) > EXACT * size * noise", "weak ** (0.5 * order) > 0.0 * size * noise",
        "rounding along lost rows is taken for true", (GRAM,),
    ),
    Fault(
        "gram-passes", "eomgen/numeric/gram.py",
        "PASSES = 50 ", "PASSES = 1 ",
        "what the regularisation of J J^T leaves along weak rows is not taken away", (GRAM,),
    ),
    Fault(
        "closure-tolerance", "eomgen/limits/constraints.py",
        "\nACCEPTED = 100.0 * SETTLED", "\nACCEPTED = 10000.0 * SETTLED",
        "loops count as closed at a hundred times the gap", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "exact-tolerance", "eomgen/limits/constraints.py",
        "\nEXACT = 1e-15", "\nEXACT = 1e-13",
        "rounding of constraints, and what follows from it, times 100", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "projection-velocity-drift", "eomgen/numeric/projection.py",
        "x, y = v / scales.q, -scales.residual(C_t)", "x, y = v / scales.q, scales.residual(C_t)",
        "velocities are brought onto C_q v - C_t = 0", ("tests/constraints/test_drivers.py",),
    ),
    Fault(
        "tangent-projector", "eomgen/numeric/projection.py",
        "np.eye(len(scales.q)) - minimum_norm(C_q, C_q, scales)", "np.eye(len(scales.q)) - 0.5 * minimum_norm(C_q, C_q, scales)",
        "derivative of the projection: half of it", (LOOPS,),
    ),
    Fault(
        "acceleration-particular", EMBEDDED,
        "s * (a_p - system.solve(s * terms.h + system.M @ a_p))", "s * (a_p - system.solve(s * terms.h))",
        "the embedded force lacks M a_p", (LOOPS,),
    ),
    Fault(
        "jacobian-without-projection", EMBEDDED,
        "turn = _project_directions(q, position(q), scales)", "turn = np.eye(n_q)",
        "the Jacobian lacks the derivative of the projection of q", (LOOPS,),
    ),
    Fault(
        "jacobian-velocity-turn", EMBEDDED,
        "dv = np.hstack([-minimum_norm(here.C_q, r.r3_q @ turn, scales),", "dv = np.hstack([0.0 * minimum_norm(here.C_q, r.r3_q @ turn, scales),",
        "the Jacobian forgets that projected velocities turn with q", (LOOPS,),
    ),
    Fault(
        "jacobian-multipliers", EMBEDDED,
        "split.multipliers(-s * (here.M @ a + here.h)) / scales.c[split.rows]\n    r = residuals", "split.multipliers(s * (here.M @ a + here.h)) / scales.c[split.rows]\n    r = residuals",
        "multipliers in the Jacobian have the wrong sign", (LOOPS,),
    ),
    Fault(
        "partition-sign", "eomgen/numeric/partitions.py",
        "B[dependent] = -inverse @ J[np.ix_(rows, kept)]", "B[dependent] = inverse @ J[np.ix_(rows, kept)]",
        "dependent velocities have the wrong sign", (LOOPS,),
    ),
    Fault(
        "partition-transposed", "eomgen/numeric/partitions.py",
        "self.inverse.T @ f[self.dependent]", "self.inverse @ f[self.dependent]",
        "multipliers: a transpose is lost", (LOOPS,),
    ),
    Fault(
        "rank-structure", "eomgen/limits/constraints.py",
        "STRUCTURE = 100.0 * ACCEPTED", "STRUCTURE = 10000.0 * ACCEPTED",
        "the tolerance of rank, times 100", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "rank-chosen", "eomgen/limits/constraints.py",
        "\nCHOSEN = 1e-8", "\nCHOSEN = 1e-6",
        "the tolerance of chosen coordinates, times 100", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "rank-state", "eomgen/limits/constraints.py",
        "\nSTATE = 1e-10", "\nSTATE = 1e-8",
        "the tolerance of rank at a state, times 100", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "independent-rows", "eomgen/numeric/ranks.py",
        "work -= np.outer(work @ direction, direction)", "work -= 0.5 * np.outer(work @ direction, direction)",
        "redundant rows are told by half an orthogonalisation", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "ball-step", "eomgen/numeric/space.py",
        "half = 0.5 * float(np.sqrt(d[j : j + 3] @ d[j : j + 3]))", "half = float(np.sqrt(d[j : j + 3] @ d[j : j + 3]))",
        "steps of Euler parameters turn twice as far", ("tests/numeric/test_rotations_in_space.py",),
    ),
    Fault(
        "ball-velocities", "eomgen/numeric/space.py",
        "e[0] * d[2] - e[2] * d[0] + e[1] * d[3] - e[3] * d[1]", "e[0] * d[2] - e[2] * d[0] - e[1] * d[3] + e[3] * d[1]",
        "angular velocity of a change of Euler parameters: wrong axes", ("tests/numeric/test_rotations_in_space.py",),
    ),
    Fault(
        "shift-velocity", "eomgen/numeric/shifts.py",
        "dv = -minimum_norm(here.C_q, r.r3_q @ dq + shift.r3, scales)", "dv = -minimum_norm(here.C_q, r.r3_q @ dq, scales)",
        "derivative by parameters: the constraints' own rates stay", ("tests/analysis/test_kernels.py",),
    ),
    Fault(
        "shift-position", "eomgen/numeric/shifts.py",
        "dz = -minimum_norm(here.C_q[:held], shift.C, scales)", "dz = 0.0 * minimum_norm(here.C_q[:held], shift.C, scales)",
        "derivative by parameters: the closed position does not follow", ("tests/analysis/test_kernels.py",),
    ),
    Fault(
        "dependent-rates", "eomgen/numeric/dependent.py",
        "split.particular(-scales.residual(rate(q)))", "split.particular(0.0 * scales.residual(rate(q)))",
        "velocities that follow from drivers are left out", (ASSEMBLY,),
    ),
    Fault(
        "singular-tolerance", "eomgen/limits/inertia.py",
        "SINGULAR = 1e-13", "SINGULAR = 1e-11",
        "inertia that counts as none, times 100", ("tests/numeric/test_thresholds.py",),
    ),
    Fault(
        "nothing-tolerance", "eomgen/limits/inertia.py",
        "NOTHING = 1e-22", "NOTHING = 1e-16",
        "a small wheel beside a large one counts as without inertia", ("tests/numeric/test_definite.py",),
    ),
    Fault(
        "velocity-assembly", "eomgen/numeric/assembly_velocity.py",
        "offset = np.concatenate([C_t, equations.y_t - equations.values])", "offset = np.concatenate([C_t, -equations.values])",
        "wanted rates of functions that depend on time: their own rate is left out", (ASSEMBLY,),
    ),
    Fault(
        "spline-ends", "eomgen/numeric/splines.py",
        "(h[0] + 2.0 * d) * h[1] * rise[0]", "(h[0] + 1.0 * d) * h[1] * rise[0]",
        "not-a-knot end of a spline: 2 becomes 1", ("tests/functions/test_tables.py",),
    ),
    Fault(
        "spline-curve", "eomgen/numeric/splines.py",
        "(rise - s[:-1]) / h - t, s[:-1], y[:-1]", "(rise - s[:-1]) / h + t, s[:-1], y[:-1]",
        "a table's quadratic coefficient has a wrong sign in it", ("tests/functions/test_tables.py",),
    ),
    Fault(
        "system-refinement", "eomgen/numeric/system.py",
        "STEPS = 30", "STEPS = 1",
        "reactions of redundant constraints are not refined", ("tests/forms/test_systems.py",),
    ),
    Fault(
        "system-scale", "eomgen/numeric/system.py",
        "(self.column * z.T).T.reshape(r.shape)", "(self.row * z.T).T.reshape(r.shape)",
        "unknowns are scaled back by the rows", ("tests/forms/test_systems.py",),
    ),
    Fault(
        "wrapped-angles", "eomgen/numeric/closure.py",
        "np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi, gap)", "gap, gap)",
        "angles to be reached do not count modulo full turns", (ASSEMBLY,),
    ),
)  # fmt: skip
