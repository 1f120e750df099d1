"""Faults in the C templates: drivers of loops and trees, steppers, lanes, events, sines and cosines."""

from __future__ import annotations

from mutations.fault import Fault

LOOPS, TREES = "tests/emit/test_c_loops.py", "tests/emit/test_c_trees.py"
DERIVATIVES, STEPS = "tests/emit/test_c_derivatives.py", "tests/emit/test_steps_of_scipy_in_c.py"
BALL, EVENTS = "tests/emit/test_steppers_in_c.py", "tests/emit/test_events_in_c.py"
MODELS = "tests/emit/test_c_models.py"
SOLVE, SLOPES = f"{MODELS}::test_accelerations_are_those_of_a_solve_with_multipliers", f"{MODELS}::test_derivatives_are_differences"
PROJECTION = f"{LOOPS}::test_the_projection_closes_the_loops_with_the_smallest_change"
LANES = "tests/emit/test_ensembles_in_c.py"
DRIVERS, STEPPERS = "templates/c/drivers", "templates/c/steppers"

FAULTS = (
    Fault(
        "c-acceleration-particular", f"{DRIVERS}/accelerate.c",
        "force += mass[i * N + j] * a[j];", "force += 0.0 * mass[i * N + j] * a[j];",
        "the embedded force lacks M a_p", (f"{SOLVE}[freedoms]",),
    ),
    Fault(
        "c-gamma-scale", f"{DRIVERS}/accelerate.c",
        "r[i] = gamma[i] / s[N + i];", "r[i] = gamma[i];",
        "gamma is not scaled", (f"{SOLVE}[freedoms]",),
    ),
    Fault(
        "c-cholesky", f"{DRIVERS}/cholesky.c",
        "s -= g[k * M + i] * b[k];", "s -= g[i * M + k] * b[k];",
        "backward substitution: a transpose is lost", (f"{PROJECTION}[plain]",),
    ),
    Fault(
        "c-velocity-drift", f"{DRIVERS}/close.c",
        "r[i] /= s[N + i];", "r[i] /= -s[N + i];",
        "C_t of driven constraints has the wrong sign", (f"{PROJECTION}[driven]",),
    ),
    Fault(
        "c-residual-tolerance", f"{DRIVERS}/project.c",
        "is_within(CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, C, J, q, s) ? 0", "is_within(100.0 * CONSTRAINTS_ACCEPTED, ROUNDING_ROUNDED, C, J, q, s) ? 0",
        "loops count as closed at a hundred times the gap", (f"{MODELS}::test_a_gap_that_is_left_is_reported",),
    ),
    Fault(
        "c-damping", f"{DRIVERS}/project.c",
        "dz[k] *= -s[k] * part;", "dz[k] *= -s[k];",
        "Newton steps onto the constraints are not limited", (f"{PROJECTION}[plain]",),
    ),
    Fault(
        "c-jacobian-velocities", f"{DRIVERS}/jacobian_projection.c",
        "r[i] = r3[i] / s[N + i];", "r[i] = 0.0 * r3[i];",
        "the Jacobian forgets that projected velocities turn with q", (f"{SLOPES}[freedoms]",),
    ),
    Fault(
        "c-jacobian-projection", f"{DRIVERS}/jacobian_projection.c",
        "spread(q, dv, dq);", "(void)spread;",
        "the Jacobian lacks the derivative of the projection of q", (f"{SLOPES}[freedoms]",),
    ),
    Fault(
        "c-multipliers", f"{DRIVERS}/multipliers.c",
        "l[i] -= rows", "l[i] += rows",
        "multipliers in the Jacobian have the wrong sign", (f"{SLOPES}[freedoms]",),
    ),
    Fault(
        "c-kinematics-rates", f"{DRIVERS}/kinematics.c",
        "x[k] += B[k * F + j] * given[j] / s[parts->independent[j]];", "x[k] += B[k * F + j] * given[j];",
        "independent rates are not scaled", (f"{LOOPS}::test_kinematics_satisfies_all_three_levels_and_holds_what_is_given[slider preferred]",),
    ),
    Fault(
        "c-embedded-mass-unit", f"{DRIVERS}/mass.c",
        "s[parts.independent[i]] * s[parts.independent[k]];", "s[parts.independent[i]] * s[parts.independent[i]];",
        "the embedded mass matrix is scaled back by the wrong unit", (f"{MODELS}::test_the_embedded_mass_matrix_is_that_of_the_motions_left[lengths]",),
    ),
    Fault(
        "c-strict-partition", f"{DRIVERS}/partition.c",
        "(strict ? CONSTRAINTS_CHOSEN : CONSTRAINTS_STATE) * size", "(strict ? 1e-30 : CONSTRAINTS_STATE) * size",
        "a dead centre of the chosen coordinates passes", (f"{LOOPS}::test_a_bad_preference_is_left_alone_by_rhs_and_reported_where_the_set_is_fixed",),
    ),
    Fault(
        "c-ldl", f"{DRIVERS}/ldl.c",
        "b[i] -= a[k * F + i] * b[k];", "b[i] -= a[i * F + k] * b[k];",
        "backward substitution: a transpose is lost", (f"{SOLVE}[freedoms]",),
    ),
    Fault(
        "c-ldl-singular", f"{DRIVERS}/ldl.c",
        "largest = fmax(largest, INERTIA_STILL / INERTIA_NOTHING * reach);", "(void)reach;",
        "a freedom that moves no inertia passes", (f"{MODELS}::test_a_dead_centre_without_inertia_is_reported",),
    ),
    Fault(
        "c-tree-factor", f"{DRIVERS}/tree.c",
        "above[j] -= ratio * row[j];", "above[j] -= ratio * row[i];",
        "factor of M: wrong index", (f"{SOLVE}[tree]",),
    ),
    Fault(
        "c-tree-singular", f"{DRIVERS}/tree.c",
        "row[k] <= INERTIA_SINGULAR * own[k] || row[k] * s[k] * s[k] <= INERTIA_NOTHING * largest", "row[k] <= -largest",
        "a motion without inertia passes", (f"{TREES}::test_a_motion_without_inertia_is_reported",),
    ),
    Fault(
        "c-tree-jacobian", f"{DRIVERS}/tree_jacobian_along.c",
        "out[(NQ + k) * (NQ + N) + column] = -r1[k];", "out[(NQ + k) * (NQ + N) + column] = r1[k];",
        "the Jacobian of a tree has the wrong sign", (f"{TREES}::test_jacobian_equals_central_differences",),
    ),
    Fault(
        "c-tree-jacobian-rows", f"{DRIVERS}/tree_jacobian.c",
        "row[k] -= ratio * above[k];", "row[k] += ratio * above[k];",
        "M^-1 of many columns: a sign", (f"{SLOPES}[tree]",),
    ),
    Fault(
        "c-shift-rates", f"{DRIVERS}/shift_projection.c",
        "r[i] = (along[i] + r3[i]) / s[N + i];", "r[i] = along[i] / s[N + i];",
        "derivative by parameters: the constraints' own rates stay", (f"{SLOPES}[balls]",),
    ),
    Fault(
        "c-shift-accelerations", f"{DRIVERS}/shift_loops.c",
        "(r[N + i] + shift[N + i]) / s[N + i]", "r[N + i] / s[N + i]",
        "derivative by parameters: gamma stays", (f"{SLOPES}[freedoms]",),
    ),
    Fault(
        "c-ball-rates", f"{DRIVERS}/space_balls.c",
        "rates[2] += e[3] * x + e[0] * y - e[1] * z;", "rates[2] += e[3] * x + e[0] * y + e[1] * z;",
        "rates of Euler parameters: a sign", (f"{SOLVE}[balls]",),
    ),
    Fault(
        "c-ball-factor", f"{DRIVERS}/space_balls.c",
        "const double x = 0.5 * factor * w[0]", "const double x = 1.0 * factor * w[0]",
        "rates of Euler parameters: a factor 1/2", (f"{SOLVE}[balls]",),
    ),
    Fault(
        "c-ball-velocities", f"{DRIVERS}/space_balls_more.c",
        "w[1] = scale * (e[0] * de[2] - e[2] * de[0] + e[1] * de[3] - e[3] * de[1]);", "w[1] = scale * (e[0] * de[2] - e[2] * de[0] + e[1] * de[3]);",
        "angular velocity of a change of Euler parameters: a term is left out", (f"{SLOPES}[balls]",),
    ),
    Fault(
        "c-system-solve", f"{DRIVERS}/system_substitute.c",
        "d[i] -= lu[i * NZ + k] * entry;", "d[i] -= lu[k * NZ + i] * entry;",
        "forward substitution: a transpose is lost", (f"{SOLVE}[forces]",),
    ),
    Fault(
        "c-columns-jacobian", f"{DRIVERS}/columns_jacobian.c",
        "out[(NQ + k) * NX + column] = da[k];", "out[(NQ + k) * NX + column] = da[N - 1 - k];",
        "the Jacobian of a long chain: rows in the wrong order", (f"{SLOPES}[columns]",),
    ),
    Fault(
        "rk45-stage", f"{STEPPERS}/rk45.c",
        "9.822892851699436 * ROW(2)", "9.822829851699436 * ROW(2)",
        "a coefficient of a stage: two digits swapped", (STEPS,),
    ),
    Fault(
        "rk45-error", f"{STEPPERS}/rk45.c",
        "0.05086379716981132 * ROW(4)", "0.05068379716981132 * ROW(4)",
        "a coefficient of the error: two digits swapped", (STEPS,),
    ),
    Fault(
        "rk45-dense", f"{STEPPERS}/rk45.c",
        "10.068970589843675 * ROW(3)", "10.068790589843675 * ROW(3)",
        "a coefficient of the dense output: two digits swapped", (STEPS,),
    ),
    Fault(
        "rk45-node", f"{STEPPERS}/rk45.c",
        "t + 0.3 * h", "t + 0.2 * h",
        "a stage is evaluated at the wrong time", (STEPS,),
    ),
    Fault(
        "rk23-dense", f"{STEPPERS}/rk23.c",
        "0.5555555555555556 * ROW(0)", "0.4444444444444444 * ROW(0)",
        "a coefficient of the dense output", (STEPS,),
    ),
    Fault(
        "dop853-stage", f"{STEPPERS}/dop853.c",
        "20.154067550477894 * ROW(6)", "20.154076550477894 * ROW(6)",
        "a coefficient of a stage: two digits swapped", (STEPS,),
    ),
    Fault(
        "dop853-dense", f"{STEPPERS}/dop853.c",
        "242.28349177525817 * ROW(5)", "242.28394177525817 * ROW(5)",
        "a coefficient of the dense output: two digits swapped", (STEPS,),
    ),
    Fault(
        "dop853-error", f"{STEPPERS}/dop853.c",
        "e5 + 0.01 * e3", "e5 + 0.1 * e3",
        "the two error estimates are weighted wrongly", (STEPS,),
    ),
    Fault(
        "radau-node", f"{STEPPERS}/radau.c",
        "RADAU_C[3] = {0.15505102572168217,", "RADAU_C[3] = {0.15505120572168217,",
        "a node: two digits swapped", (STEPS,),
    ),
    Fault(
        "radau-transformation", f"{STEPPERS}/radau.c",
        "{0.50287263494578682, -2.57192694985560522, 0.59603920482822492}", "{0.50287263494578682, -2.57192694985560522, 0.56903920482822492}",
        "the inverse of the transformation of stages: two digits swapped", (STEPS,),
    ),
    Fault(
        "radau-error", f"{STEPPERS}/radau_step.c",
        "e1 = (-13.0 + 7.0 * S6) / 3.0", "e1 = (-13.0 + 7.0 * S6) / 2.0",
        "a coefficient of the error estimate", (STEPS,),
    ),
    Fault(
        "radau-halved", f"{STEPPERS}/newton.c",
        "real[k] = -D - K / g;", "real[k] = -D + K / g;",
        "systems of second order: stiffness has the wrong sign", ("tests/emit/test_radau_in_c.py",),
    ),
    Fault(
        "radau-dense", f"{STEPPERS}/radau_step.c",
        "- r * (8.0 / 3.0);", "- r * (7.0 / 3.0);",
        "a coefficient of the dense output", (STEPS,),
    ),
    Fault(
        "taylor-term", f"{STEPPERS}/taylor_terms.c",
        "for (int m = even - 2; m >= 0; m -= 2) {", "for (int m = even - 4; m >= 0; m -= 2) {",
        "a term of the series is left out", (STEPS,),
    ),
    Fault(
        "taylor-dense", f"{STEPPERS}/taylor_terms.c",
        "m <= run->order ? power * rows[m * n + i] : same(0.0)", "m < run->order ? power * rows[m * n + i] : same(0.0)",
        "values between steps lack the last term", (STEPS,),
    ),
    Fault(
        "taylor-defect", f"{STEPPERS}/taylor_terms.c",
        "TAYLOR_DEFECT = 10.0", "TAYLOR_DEFECT = 1e9",
        "steps are not judged by their ends", (STEPS,),
    ),
    Fault(
        "first-step", f"{STEPPERS}/control.c",
        "pow(0.01 / d, 1.0 / (method->error_order + 1))", "pow(0.01 / d, 1.0 / method->error_order)",
        "the first step is chosen for the wrong order", (STEPS,),
    ),
    Fault(
        "rejected-growth", f"{STEPPERS}/control.c",
        "factor = rejected && factor > 1.0 ? 1.0 : factor;", "factor = factor > 1.0 ? 1.0 : factor;",
        "steps never grow", (STEPS,),
    ),
    Fault(
        "event-direction", f"{STEPPERS}/crossings.c",
        "ev->direction[i] != 0 && ev->direction[i] * (fb - fa) < 0.0", "ev->direction[i] == 2",
        "the direction of an event is ignored", (EVENTS,),
    ),
    Fault(
        "event-touch", f"{STEPPERS}/crossings.c",
        "return least < 0.5 * fmin(fabs(a), fabs(b));", "return least < -0.5 * fmin(fabs(a), fabs(b));",
        "a value that comes to zero and back within a step is missed", (EVENTS,),
    ),
    Fault(
        "event-tolerance", f"{STEPPERS}/event_zero.c",
        "tolerance = 2.0 * DBL_EPSILON * (1.0 + fabs(b))", "tolerance = 2e9 * DBL_EPSILON * (1.0 + fabs(b))",
        "times of events are found to 1e-7 only", (EVENTS,),
    ),
    Fault(
        "reset-after-event", f"{STEPPERS}/loop.c",
        "run->h_abs = 0.0;\n    eomgen_start(method, run);\n    if (j->n_eval < 0)", "run->h_abs = 0.0;\n    if (j->n_eval < 0)",
        "after a reset the old rates are used", (BALL,),
    ),
    Fault(
        "table-hold", f"{STEPPERS}/signals.c",
        "if (s->times[middle] <= at) {", "if (s->times[middle] <= at + 0.1) {",
        "values of a table are held from too early", (EVENTS,),
    ),
    Fault(
        "table-cubic", f"{STEPPERS}/signals.c",
        "return v[0] + x * (v[1] + x * (v[2] + x * v[3]));", "return v[0] + x * (v[1] + x * (2.0 * v[2] + x * v[3]));",
        "a cubic table doubles its curvature", (EVENTS,),
    ),
    Fault(
        "sine-coefficient", "templates/c/eomgen_sincos.h",
        "-0.00019841269836722437\n        + z * (2.755731608382574e-06", "-0.00019841629836722437\n        + z * (2.755731608382574e-06",
        "a coefficient of the sine: two digits swapped", ("tests/emit/test_sincos.py",),
    ),
    Fault(
        "wide-steps", f"{STEPPERS}/wide.c",
        "(a >= b ? a : b) * run->rtol;", "(a >= b ? b : a) * run->rtol;",
        "steps four states at a time measure errors by the smaller of two sizes", ("tests/emit/test_wide_steps_in_c.py",),
    ),
    Fault(
        "lanes-rejected", "templates/c/ensembles/lane_runs.c",
        "run->y[i] = choose(moved, run->y[i], run->y_old[i]);", "run->y[i] = run->y[i];",
        "a lane whose step is rejected goes on from where it led", (LANES,),
    ),
    Fault(
        "lanes-safety", "templates/c/ensembles/lane_runs.c",
        "0.8 * stretch_of(error, order)", "0.4 * stretch_of(error, order)",
        "lanes take twice as many steps as they need", (LANES,),
    ),
    Fault(
        "lanes-rates", "templates/c/ensembles/lane_runs.c",
        "run->f[i] = choose(moved, run->f[i], run->K[i]);", "run->f[i] = choose(moved, run->K[i], run->f[i]);",
        "lanes begin a step with the rates of the one before", (LANES,),
    ),
    Fault(
        "lanes-samples", "templates/c/ensembles/lane_runs.c",
        "e->samples[(run->index[l] * e->n_eval + run->done[l]) * n + i] = run->z[i][l];", "e->samples[(run->index[l] * e->n_eval + run->done[l]) * n + i] = run->z[i][0];",
        "samples of all lanes are those of the first", (LANES,),
    ),
    Fault(
        "lanes-tables", "templates/c/ensembles/lane_steps.c",
        "eomgen_table_value(run->signals + i, t[l], run->hold[l])", "eomgen_table_value(run->signals + i, t[0], run->hold[l])",
        "tables are read in all lanes at the time of the first", (LANES,),
    ),
    Fault(
        "lanes-taylor-sums", "templates/c/ensembles/lane_taylor.c",
        "taylor_sum(run, run->K, h, run->y, run->f);", "taylor_sum(run, run->after, h, run->y, run->f);",
        "steps of Taylor's method in lanes sum the coefficients of the step before", (LANES,),
    ),
)  # fmt: skip
