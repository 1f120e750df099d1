"""Faults in the runtime and in analyses: inputs and their rates, events, impacts, sensitivities, equilibria, starts."""

from __future__ import annotations

from mutations.fault import Fault

FAULTS = (
    Fault(
        "input-rates", "eomgen/describe/input_rates.py",
        'return {graph.symbol("t"): graph.one, **rates}',
        'return {graph.symbol("t"): graph.one}',
        "rates of inputs are dropped from d/dt",
        ("tests/mechanics/test_lagrangians.py::test_a_length_that_an_input_prescribes[lagrange]",),
    ),
    Fault(
        "input-second-rates", "eomgen/describe/input_rates.py",
        '(positions, 2, "a constraint", section)',
        '(positions, 1, "a constraint", section)',
        "second rates of inputs in constraints are taken for 0",
        ("tests/mechanics/test_lagrangians.py::test_a_constraint_that_an_input_moves[lagrange]",),
    ),
    Fault(
        "table-rate", "eomgen/runtime/signal_rates.py",
        "self.pieces[:, [1, 2, 3, 3]] * (1.0, 2.0, 3.0, 0.0)",
        "self.pieces[:, [1, 2, 3, 3]] * (1.0, 1.0, 1.0, 0.0)",
        "rates of cubic tables lack the factors 2 and 3",
        ("tests/runs/test_inputs.py::test_cubic_tables_and_their_rates_are_those_of_scipy",),
    ),
    Fault(
        "table-coefficients", "eomgen/runtime/signals.py",
        "(slope[:-1] + slope[1:] - 2.0 * rise) / h",
        "(slope[:-1] + slope[1:] - rise) / h",
        "cubic tables: a factor 2",
        ("tests/runs/test_inputs.py::test_cubic_tables_and_their_rates_are_those_of_scipy",),
    ),
    Fault(
        "table-held", "eomgen/runtime/signals.py",
        "k = np.clip(np.searchsorted(self.times, t, side=\"right\") - 1, 0, len(self.times) - 1)\n        if "
        "self.order == 0:",
        "k = np.clip(np.searchsorted(self.times, t, side=\"right\"), 0, len(self.times) - 1)\n        if self.order "
        "== 0:",
        "held tables give the next value instead of the last",
        ("tests/runs/test_inputs.py::test_cubic_tables_and_their_rates_are_those_of_scipy",),
    ),
    Fault(
        "event-reset-projection", "eomgen/simulation/events.py",
        "after = np.asarray(module.project(after, t=t, u=forcing(t, after)))",
        "after = np.asarray(after)",
        "a reset state is not brought back onto the loops",
        ("tests/runs/test_events.py::test_a_reset_in_a_loop_is_brought_back_onto_it[numpy]",),
    ),
    Fault(
        "event-direction-scipy", "eomgen/simulation/events.py",
        "self.direction = int(np.sign(given)) if",
        "self.direction = 0 if",
        "the direction of an event is ignored",
        ("tests/runs/test_events.py::test_texts_functions_and_mappings[DOP853-numpy]",),
    ),
    Fault(
        "gap-rate-in-time", "eomgen/analysis/impact.py",
        "rates = rows @ v + drift(",
        "rates = rows @ v + 0.0 * drift(",
        "impacts of the model's events: the rate of a gap that moves by itself is dropped",
        ("tests/runs/test_event_corners.py::test_a_floor_that_rises",),
    ),
    Fault(
        "gap-rate-of-racket", "eomgen/analysis/impact_gaps.py",
        "rates += drift(lambda time: each.values(time, x), t)",
        "rates += 0.0 * drift(lambda time: each.values(time, x), t)",
        "impacts: the rate of a gap that moves by itself is dropped",
        ("tests/runs/test_impacts.py::test_a_racket_that_moves[0.0]",),
    ),
    Fault(
        "gap-rate-of-inputs", "eomgen/runtime/signal_rates.py",
        "rates[base] = u[rate]",
        "rates[base] = 0.0",
        "impacts: the rate of a gap that an input moves is dropped",
        ("tests/runs/test_event_corners.py::test_a_floor_that_rises",),
    ),
    Fault(
        "restitution", "eomgen/analysis/impact_law.py",
        "-(1.0 + e) * rates",
        "-(1.0 + e * e) * rates",
        "the restitution of impacts is squared",
        ("tests/runs/test_impacts.py::test_balls_on_a_line",),
    ),
    Fault(
        "sensitivity-parameters", "eomgen/simulation/variational.py",
        "S_dot = S_dot + self.by_p(t, x, u=u) @ self.dp",
        "S_dot = S_dot + 0.0 * self.by_p(t, x, u=u) @ self.dp",
        "sensitivities: df/dp is dropped",
        ("tests/runs/test_sensitivities.py::test_a_linear_oscillator",),
    ),
    Fault(
        "sensitivity-input-parameters", "eomgen/simulation/variational.py",
        "du = self.du + by_x @ dx + by_p @ self.dp",
        "du = self.du + by_x @ dx",
        "sensitivities: parameters inside an input's text are dropped",
        ("tests/runs/test_sensitivities.py::test_parameters_and_states_in_the_text_of_an_input",),
    ),
    Fault(
        "sensitivity-input-states", "eomgen/simulation/variational.py",
        "du = self.du + by_x @ dx + by_p @ self.dp",
        "du = self.du + by_p @ self.dp",
        "sensitivities: states inside an input's text are dropped",
        ("tests/runs/test_sensitivities.py::test_parameters_and_states_in_the_text_of_an_input",),
    ),
    Fault(
        "sensitivity-start", "eomgen/simulation/sensitivity_start.py",
        "right = [*(-(other[lines] + E[lines, :n_q] @ dq) / scales.c[:, None])]",
        "right = [*(-other[lines] / scales.c[:, None])]",
        "sensitivities at the start: velocities do not follow the position",
        ("tests/runs/test_sensitivities.py::test_the_start_follows_the_parameters",),
    ),
    Fault(
        "saltation-time", "eomgen/simulation/saltation.py",
        "move = self.run.move(t, x, S + np.multiply.outer(before, dt), dt)",
        "move = self.run.move(t, x, S, dt)",
        "saltation: the term f- dT is dropped",
        ("tests/runs/test_sensitivities.py::test_a_bouncing_ball_in_closed_form[reset]",),
    ),
    Fault(
        "saltation-after", "eomgen/simulation/saltation.py",
        "d_after - np.multiply.outer(after, dt)",
        "d_after",
        "saltation: the term f+ dT is dropped",
        ("tests/runs/test_sensitivities.py::test_a_bouncing_ball_in_closed_form[reset]",),
    ),
    Fault(
        "saltation-sign", "eomgen/simulation/saltation.py",
        "return np.asarray(-along[0] / rate)",
        "return np.asarray(along[0] / rate)",
        "the time of an event moves the wrong way",
        ("tests/runs/test_sensitivities.py::test_an_event_that_ends_the_run",),
    ),
    Fault(
        "strike-restitution", "eomgen/simulation/impact_slopes.py",
        "names) + e * move.along(before",
        "names) + move.along(before",
        "derivative of an impact: the restitution is taken for 1",
        ("tests/runs/test_sensitivities.py::test_a_bouncing_ball_in_closed_form[impact]",),
    ),
    Fault(
        "equilibrium-nonholonomic", "eomgen/analysis/search.py",
        "return np.concatenate([forces, (here.v / s)[like.surplus]])",
        "return np.concatenate([forces, 0.0 * (here.v / s)[like.surplus]])",
        "equilibria ignore what nonholonomic rows move",
        (
            ("tests/runs/test_equilibrium.py::test_the_inner_length_of_a_maxwell_element_comes_to_re"
            "st_too[embedding]"),
        ),
    ),
    Fault(
        "equilibrium-tolerance", "eomgen/limits/statics.py",
        "ARRIVED = 1e-12",
        "ARRIVED = 1e-3",
        "equilibria are found to three digits only",
        ("tests/runs/test_equilibrium.py::test_the_iftomm_four_bar",),
    ),
    Fault(
        "dae-jacobian", "eomgen/runtime/numpy_drivers.py",
        "x[2 * n] * np.eye(n)])",
        "np.eye(n)])",
        "dF/dy + cj dF/dy' of the differential-algebraic form: cj is taken for 1",
        (
            ("tests/mechanics/test_forms.py::test_consistent_values_leave_no_residual_and_the_jacobian_is_exact[double"
             "_pendulum]"),
        ),
    ),
    Fault(
        "numpy-given-jacobian", "eomgen/runtime/numpy_drivers.py",
        "da = system.solve(-right)[:n]",
        "da = system.solve(right)[:n]",
        "the Jacobian of a stabilised right-hand side has the wrong sign",
        (
            ("tests/mechanics/test_forms.py::test_the_jacobian_is_that_of_the_stabilised_right_hand_side[slider_crank-"
             "numpy]"),
        ),
    ),
    Fault(
        "multipliers-scale", "eomgen/analysis/constrained.py",
        "scaled[:, :, 0].T / scales.c[:, None]",
        "scaled[:, :, 0].T * scales.c[:, None]",
        "multipliers are scaled back the wrong way",
        ("tests/runs/test_reactions.py::test_every_body_of_random_loops[20-False]",),
    ),
    Fault(
        "minimal-velocities", "eomgen/runtime/minimal.py",
        "q_i, v_i = x[:k], x[k:]",
        "q_i, v_i = x[:k], 0.0 * x[k:]",
        "the minimal form forgets the velocities",
        (
            ("tests/mechanics/test_published_loops.py::test_minimal_form_equals_the_tree_form[slider_crank-1.0-given0-"
             "embedding]"),
        ),
    ),
    Fault(
        "flipped-axes", "eomgen/numeric/constraint_system.py",
        "bool((np.asarray(self.alignment(q, self.t)) > 0.0).all())",
        "bool(np.isfinite(np.asarray(self.alignment(q, self.t))).all())",
        "positions with flipped axes are accepted",
        ("tests/mechanics/test_redundant_loops.py::test_flipped_solutions_are_rejected_by_the_module[numpy]",),
    ),
    Fault(
        "momenta-place", "eomgen/runtime/momenta.py",
        'self._part("momentum", 3 + 3 * self.kernels.layout.n_v, 6, rates=True)',
        'self._part("momentum", 9 + 3 * self.kernels.layout.n_v, 6, rates=True)',
        "momentum is read from the place of the inertia",
        ("tests/runs/test_momenta.py::test_calls_and_outputs_equal_mujoco[numpy]",),
    ),
    Fault(
        "cut-slider-drive", "eomgen/analysis/reactions.py",
        'zip(table["ends"][joint], (1.0, -1.0), strict=True)',
        'zip(table["ends"][joint], (-1.0, 1.0), strict=True)',
        "reactions: the drive of a cut joint acts on the wrong body, which a hinge in a plane cannot show",
        ("tests/runs/test_reactions.py::test_a_drive_on_a_cut_slider_reacts_on_both_bodies",),
    ),
    Fault(
        "driven-event-direction", "eomgen/simulation/driven.py",
        "(up and event.direction >= 0) or (down and event.direction <= 0)",
        "(up and event.direction <= 0) or (down and event.direction >= 0)",
        "events of driven runs happen in the other direction",
        ("tests/runs/test_kinematic_analysis.py::test_events_of_driven_runs_are_located",),
    ),
    Fault(
        "outputs-by-inputs", "eomgen/analysis/linear.py",
        "layout.n_u] + by_a @ U[n_q:]",
        "layout.n_u] + 0.0 * by_a @ U[n_q:]",
        "D of a linearization lacks what inputs do to outputs of accelerations",
        ("tests/runs/test_linear.py::test_outputs_and_inputs",),
    ),
    Fault(
        "grid-order", "eomgen/ensembles/case_grid.py",
        'np.meshgrid(*axes.values(), indexing="ij")',
        'np.meshgrid(*axes.values(), indexing="xy")',
        "runs of a grid stand in another order than its names",
        ("tests/runs/test_ensembles.py::test_a_grid_has_every_combination",),
    ),
)  # fmt: skip
