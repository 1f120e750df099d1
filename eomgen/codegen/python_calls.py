"""Program -> the Python calls of a model: arguments, shapes of results, and what they are."""

from __future__ import annotations

from typing import NamedTuple

from .program import Program


class Call(NamedTuple):
    """One call, as a user writes it."""

    text: str  #: with its arguments
    result: str  #: shape of the result for one state
    meaning: str

    @property
    def name(self) -> str:
        """Without its arguments."""
        return self.text.partition("(")[0]


def describe_calls(program: Program) -> list[Call]:
    """Every call of a generated package or Module, with its sizes as numbers."""
    s = program.sizes
    rows = len(program.metadata.get("independent_rows", range(s.n_c)))
    holonomic = len([i for i in program.metadata.get("independent_rows", range(s.n_c)) if i < s.n_h])
    unknowns = s.n_x + rows + holonomic
    independent = "q_i, v_i, a_i"
    calls = [
        Call("rhs(t, x)", _shape(s.n_x), "x' = [q'; v'], after projecting x onto the constraints"),
        Call("jacobian(t, x)", _shape(s.n_x, s.n_x), "dx'/dx of the complete rhs; wrt='u', 'p' as the next two"),
        Call("input_jacobian(t, x)", _shape(s.n_x, s.n_u), "dx'/du of the complete rhs"),
        Call("parameter_jacobian(t, x)", _shape(s.n_x, s.n_p), "dx'/dp of the complete rhs"),
        Call("mass_matrix(q)", _shape(s.n_v, s.n_v), "M of the spanning tree"),
        Call("embedded_mass_matrix(q)", _shape(s.n_dof, s.n_dof), "M of the independent coordinates"),
        Call("bias(t, x)", _shape(s.n_v), "h in M v' + h = generalized forces not in the model"),
        Call("inverse_dynamics(q, v, a)", _shape(s.n_v), "M a + h, the generalized forces to add"),
        Call(
            "inverse_dynamics_derivatives(q, v, a)",
            ", ".join(_shape(s.n_v, n) for n in (s.n_q, s.n_v, s.n_v)),
            "derivatives of inverse_dynamics by q, v and a",
        ),
        Call("energy(x)", _shape(2), "kinetic and potential energy T, V (J)"),
        Call("center_of_mass(q)", _shape(3), "centre of mass of all bodies, ground axes (m)"),
        Call("com_jacobian(q)", _shape(3, s.n_v), "velocity of the centre of mass = com_jacobian v"),
        Call("momentum(x)", _shape(6), "linear and angular momentum about the centre of mass, ground axes (SI)"),
        Call("centroidal_inertia(q)", _shape(3, 3), "inertia of all bodies about their centre of mass (kg m^2)"),
        Call("constraints(q)", _shape(holonomic), "independent loop residuals (m, rad)"),
        Call("constraint_jacobian(q)", _shape(rows, s.n_v), "C_q of C_q v + C_t = 0, nonholonomic rows last"),
        Call("velocity_constraints(x)", _shape(rows), "C_q v + C_t"),
        Call('constraints(q, rows="all")', _shape(s.n_h), "all loop residuals, redundant ones included"),
        Call('constraint_jacobian(q, rows="all")', _shape(s.n_c, s.n_v), "C_q of all rows"),
        Call("project(x, t=0.0)", _shape(s.n_x), "the nearest state on the constraints"),
        Call("x0(**values)", _shape(s.n_x), "a state assembled from named values"),
        Call("assemble(**guess)", _shape(s.n_q), "q with the loops closed, from a guess"),
        Call(
            f"kinematics({independent})",
            ", ".join(_shape(n) for n in (s.n_q, s.n_v, s.n_v)),
            f"q, v, a of the whole tree; {independent} are {_shape(s.n_dof)}",
        ),
        Call("kinematic_analysis(t, **led)", "KinematicAnalysis", "motion over a range of time or of coordinates"),
        Call("motion_range(name)", "MotionRange", "the limits between which a coordinate can move"),
        Call("poses(q)", _shape(s.n_bodies, 4, 4), "body frames to ground, homogeneous"),
        Call("outputs(t, x)", _shape(s.n_y), "the outputs of the model at the projected state"),
        Call("minimal.rhs(t, x_min)", _shape(2 * s.n_dof), "x_min' of the independent x_min = [q_i; v_i]"),
        Call("minimal.x0(**values)", _shape(2 * s.n_dof), "x_min assembled from named values"),
        Call("minimal.expand(x_min)", _shape(s.n_x), "x of the whole tree"),
        Call("dae.residual(t, y, yp)", _shape(unknowns), "F(t, y, y') of y = [q; v; multipliers; corrections]"),
        Call("dae.jacobian(t, y, yp, cj)", _shape(unknowns, unknowns), "dF/dy + cj dF/dy'"),
        Call("dae.initial(x)", f"{_shape(unknowns)}, {_shape(unknowns)}", "consistent y and y' of a state"),
        Call("canonical.rhs(t, z)", _shape(s.n_x), "z' of z = [q; p] by Hamilton's equations"),
        Call("canonical.of(x)", _shape(s.n_x), "z = [q; p] of a state x"),
        Call("canonical.expand(z)", _shape(s.n_x), "x = [q; v] of z"),
        Call("canonical.hamiltonian(z)", "number", "H = p v - L (J)"),
        Call("bind(p=None, u=None)", "Module", "the same calls with other parameters and inputs"),
        Call("simulate(span, initial=None)", "Trajectory", "a run; SciPy where its methods or functions are asked for"),
        Call("linearize(x=None, t=0.0)", "Linearization", "A, B, C, D along the constraints, eigenvalues"),
        Call("modes(x=None, t=0.0)", "Modes", "frequencies, shapes and damping ratios about an equilibrium"),
        Call("equilibrium(guess=None, hold=(), unknowns=())", "Equilibrium", "a position where all forces balance"),
        Call("multipliers(t, x)", _shape(s.n_c), "l of all constraint rows in M v' + h + C_q^T l = 0"),
        Call("reactions(t, x)", _shape(len(program.metadata.get("joint_names", ())), 6), "force and moment in joints"),
        Call("actuator_forces(t, x, a, actuated=None)", "ActuatorForces", "forces of drives that make a motion"),
        Call("impact(t, x, {gap: restitution})", "Impact", "the state after an impact, impulses"),
        Call("consistent(x, t=0.0)", _shape(s.n_x), "the nearest consistent state, with weights"),
        Call("sensitivities(names, span)", "Sensitivities", "a run with its derivatives; needs SciPy"),
    ]
    plain = s.n_h == s.n_c and all(program.coordinate_of[i] >= 0 for i in program.preferred)
    calls = [call for call in calls if plain or not call.text.startswith(("minimal", "kinematics"))]
    calls = [call for call in calls if s.n_momenta or not call.text.startswith("canonical")]
    sums = ("center_of_mass", "com_jacobian", "momentum", "centroidal_inertia")
    kept = [call for call in calls if s.n_com or call.text.partition("(")[0] not in sums]
    kept = [call for call in kept if s.n_wrenches or not call.text.startswith("reactions")]
    return [call for call in kept if s.n_c or not ("constraint" in call.text or call.text.startswith("multipliers"))]


def _shape(*sizes: int) -> str:
    return str(sizes)
