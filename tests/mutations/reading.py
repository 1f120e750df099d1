"""Faults of what is read: quantities by name, equations near a state, values put in."""

from __future__ import annotations

from mutations.fault import Fault

SHOWN = "tests/shown/test_shown_is_compiled.py"
FORMS = "tests/core/test_simplified.py"

FAULTS = (
    Fault(
        "read-uphill", "_downhill",
        "[-x for x in gradient(potential, list(kinematics.q))]",
        "[x for x in gradient(potential, list(kinematics.q))]",
        "generalized forces that are shown push up the potential",
        "tests/shown/test_shown_is_compiled.py::test_of_every_example[slider_crank]",
    ),
    Fault(
        "read-velocity-offset", "transform_velocities",
        "row[n + 1]",
        "row[n]",
        "b of v = B v_i + b is that of accelerations",
        "tests/shown/test_shown_is_compiled.py::test_of_every_example[car_axis]",
    ),
    Fault(
        "read-hamiltonian-half", "hamiltonian",
        "0.5 * total",
        "total",
        "the Hamiltonian has twice its kinetic part",
        "tests/shown/test_against_sympy.py::test_open_chains[cart_pendulum-hamilton]",
    ),
    Fault(
        "read-block-gamma", "block_system",
        "(-g for g in quantities.gamma)",
        "quantities.gamma",
        "the block system that is shown turns the right side of its constraints round",
        "tests/shown/test_against_sympy.py::test_a_loop_with_multipliers",
    ),
    Fault(
        "read-free-body-reaction", "BodiesApart._from_joints",
        "vec.neg(force)",
        "force",
        "a joint pushes both of its bodies the same way",
        "tests/shown/test_shown_is_compiled.py::test_free_bodies_hold_at_the_compiled_accelerations[slider_crank-newto"
        "n_euler]",
    ),
    Fault(
        "read-near-turning", "_shift",
        "vec.add(own, vec.cross(r, w))",
        "vec.sub(own, vec.cross(r, w))",
        "small rotations about turning axes change the wrong way in A",
        "tests/shown/test_shown_is_compiled.py::test_equations_near_a_state_are_those_of_the_module[satellite]",
    ),
    Fault(
        "read-near-velocities", "_move",
        "tuple(jvp(v, dq)) if dq else (graph.zero,) * len(v)",
        "(graph.zero,) * len(v)",
        "dependent velocities stay where a displacement of a loop moves them",
        "tests/shown/test_shown_is_compiled.py::test_equations_near_a_state_are_those_of_the_module[slider_crank]",
    ),
    Fault(
        "read-quarter-turn", "_turned",
        "(0.0, 1.0, 0.0, -1.0)",
        "(0.0, -1.0, 0.0, 1.0)",
        "the sine of a quarter turn that is put in has the wrong sign",
        "tests/shown/test_views.py::test_values_put_in_one_after_the_other",
    ),
    Fault(
        "form-angle-sum", "JoinedAngles._sums",
        'less if (made == "cos") == alike else both',
        'both if (made == "cos") == alike else less',
        "cos a cos b - sin a sin b is joined to cos(a - b)",
        "tests/core/test_simplified.py::test_as_by_hand[cos(A)*cos(B) - sin(A)*sin(B)-cos(A + B)]",
    ),
    Fault(
        "form-signed-root", "Expansion._root",
        'self.atoms.poly("abs", (freeze({base: 1}),))',
        "{base: 1}",
        "the root of a square has the sign of what is squared",
        "tests/core/test_simplified.py::test_roots_of_squares_and_magnitudes_have_no_sign[sqrt(1 - sin(A)**2)]",
    ),
    Fault(
        "unit-bracket", "_factors",
        "signs[-1] * sign",
        "signs[-1]",
        "a bracket behind a division multiplies: N/(mm/s)",
        "tests/model/test_units.py::test_sizes_are_those_of_pint",
    ),
    Fault(
        "chained-comparison", "_Walker.compare",
        'self.fold(node, "and", results)',
        'self.fold(node, "or", results)',
        "a < b < c is true where one of both holds",
        "tests/model/test_expressions.py::test_meaning",
    ),
)  # fmt: skip
