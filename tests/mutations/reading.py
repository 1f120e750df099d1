"""Faults of what is read: quantities by name, equations near a state, values put in."""

from __future__ import annotations

from mutations.fault import Fault

SHOWN = "tests/shown/test_shown_is_compiled.py"
FORMS = "tests/core/test_simplified.py"

FAULTS = (
    Fault(
        "read-uphill", "eomgen/reading/applied_forces.py",
        "slope = [-x for x in gradient(potential, list(kinematics.q))]",
        "slope = [x for x in gradient(potential, list(kinematics.q))]",
        "generalized forces that are shown push up the potential",
        (f"{SHOWN}::test_of_every_example[slider_crank]",),
    ),
    Fault(
        "read-velocity-offset", "eomgen/equations/reduction.py",
        "tuple(b for _, b in rest), tuple(c for c, _ in rest)",
        "tuple(c for c, _ in rest), tuple(c for c, _ in rest)",
        "b of v = B v_i + b is that of accelerations",
        (f"{SHOWN}::test_of_every_example[car_axis]",),
    ),
    Fault(
        "read-hamiltonian-half", "eomgen/reading/of_methods.py",
        "found = 0.5 * total - at_rest",
        "found = total - at_rest",
        "the Hamiltonian has twice its kinetic part",
        ("tests/shown/test_against_sympy.py::test_open_chains[cart_pendulum-hamilton]",),
    ),
    Fault(
        "read-block-gamma", "eomgen/reading/of_methods.py",
        "*(-g for g in quantities.gamma)",
        "*quantities.gamma",
        "the block system that is shown turns the right side of its constraints round",
        ("tests/shown/test_against_sympy.py::test_a_loop_with_multipliers",),
    ),
    Fault(
        "read-free-body-reaction", "eomgen/reading/bodies_apart.py",
        "force, moment = vec.neg(force), vec.neg(moment)",
        "force, moment = force, vec.neg(moment)",
        "a joint pushes both of its bodies the same way",
        (f"{SHOWN}::test_free_bodies_hold_at_the_compiled_accelerations[slider_crank-newton_euler]",),
    ),
    Fault(
        "read-near-turning", "eomgen/reading/near_state.py",
        "result[j : j + 3] = vec.add(own, vec.cross(r, w))",
        "result[j : j + 3] = vec.sub(own, vec.cross(r, w))",
        "small rotations about turning axes change the wrong way in A",
        (f"{SHOWN}::test_equations_near_a_state_are_those_of_the_module[satellite]",),
    ),
    Fault(
        "read-near-velocities", "eomgen/reading/near_state.py",
        "return _Move(dq, tuple(jvp(v, dq)) if dq else (graph.zero,) * len(v))",
        "return _Move(dq, (graph.zero,) * len(v))",
        "dependent velocities stay where a displacement of a loop moves them",
        (f"{SHOWN}::test_equations_near_a_state_are_those_of_the_module[slider_crank]",),
    ),
    Fault(
        "read-quarter-turn", "eomgen/reading/put_in.py",
        "(0.0, 1.0, 0.0, -1.0)[k]",
        "(0.0, -1.0, 0.0, 1.0)[k]",
        "the sine of a quarter turn that is put in has the wrong sign",
        ("tests/shown/test_views.py::test_values_put_in_one_after_the_other",),
    ),
    Fault(
        "form-angle-sum", "eomgen/simplify/joined_angles.py",
        'angle = less if (made == "cos") == alike else both',
        'angle = both if (made == "cos") == alike else less',
        "cos a cos b - sin a sin b is joined to cos(a - b)",
        (f"{FORMS}::test_as_by_hand[cos(A)*cos(B) - sin(A)*sin(B)-cos(A + B)]",),
    ),
    Fault(
        "form-half-turn", "eomgen/simplify/joined_angles.py",
        'sign = {("sin", 2): -1, ("sin", 3): -1, ("cos", 1): -1, ("cos", 2): -1}.get((kind, quarters), 1)',
        'sign = {("sin", 2): -1, ("sin", 3): -1, ("cos", 2): -1}.get((kind, quarters), 1)',
        "cos(a + pi/2) becomes sin a",
        (f"{FORMS}::test_as_by_hand[cos(A + pi/2)--sin(A)]",),
    ),
    Fault(
        "form-signed-root", "eomgen/simplify/expansion.py",
        'return self.atoms.poly("abs", (freeze({base: 1}),))',
        "return {base: 1}",
        "the root of a square has the sign of what is squared",
        (f"{FORMS}::test_roots_of_squares_and_magnitudes_have_no_sign[sqrt(1 - sin(A)**2)]",),
    ),
    Fault(
        "unit-bracket", "eomgen/describe/units.py",
        "signs.append(signs[-1] * sign)",
        "signs.append(signs[-1])",
        "a bracket behind a division multiplies: N/(mm/s)",
        ("tests/model/test_units.py::test_sizes_are_those_of_pint",),
    ),
    Fault(
        "chained-comparison", "eomgen/describe/expressions.py",
        'return self.fold(node, "and", results)',
        'return self.fold(node, "or", results)',
        "a < b < c is true where one of both holds",
        ("tests/model/test_expressions.py::test_meaning",),
    ),
)  # fmt: skip
