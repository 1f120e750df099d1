"""The table of kernels, the functions of a generated module: what each takes and gives, for every model alike.

Code is generated from it, and read by it where it is called.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Sizes(NamedTuple):
    """The sizes that shapes are made of, by the names used in metadata and headers."""

    n_q: int
    n_v: int
    n_x: int
    n_u: int
    n_p: int
    n_y: int
    n_c: int
    n_h: int  #: holonomic rows, the first of n_c
    n_dof: int
    n_bodies: int
    n_loop_coordinates: int
    n_alignments: int
    n_com: int = 0  #: coordinates of the centre of mass: 3, or 0 for a system without mass
    n_finite_forces: int = 0
    n_coordinate_slopes: int = 0  #: holonomic rows where q' is given, else 0
    n_wrenches: int = 0  #: numbers of the wrenches that joints exert, 0 without bodies
    n_wrench_geometry: int = 0  #: numbers of the geometry of joint reactions, 0 without bodies
    n_momenta: int = 0  #: momenta: n_v by method hamilton, else 0
    n_events: int = 0
    n_held: int = 0  #: errors and their rates of the equations of constraints that close and open
    n_resets: int = 0  #: states that events give new values
    n_strike: int = 0  #: rows of what velocities obey where an event changes them, 0 where they just change
    n_states: int = 0  #: first-order states, the last of the n_v velocities and of the n_dof independent ones
    n_witnesses: int = 0  #: numbers of the lists of pairs of shapes that are near each other
    n_dae: int = 0  #: unknowns [q; v; multipliers; corrections] of the differential-algebraic form


class Kernel(NamedTuple):
    """One public function."""

    name: str
    inputs: tuple[str, ...]  #: ports that make up ``x``: q v a, q_i v_i a_i (independent coordinates), q_guess
    shape: Callable[[Sizes], tuple[int, ...]]  #: of the result for one state
    result: str  #: what the result is, one line for headers and documentation
    #: left out of a module made in this process until one of those with the same value is called; never of an export
    lazy: bool | str = False
    absent: bool = False  #: whether models where a size of the result is 0 are without it, as without lazy ones

    @property
    def optional(self) -> bool:
        """Whether a model has it only if no size of its result is 0."""
        return self.absent or bool(self.lazy)

    @property
    def kind(self) -> str:
        """Of its arguments: 'timed' (t and states), 'motion' (q, v and a) or 'state'."""
        return "timed" if self.name in TIMED else "motion" if self.inputs == ("q", "v", "a") else "state"

    def length(self, sizes: Sizes) -> int:
        """How many numbers ``x`` has."""
        each = {"q": sizes.n_q, "q_guess": sizes.n_q, "q_rate": sizes.n_q, "v": sizes.n_v, "a": sizes.n_v, "cj": 1}
        each |= dict.fromkeys(("v_i", "a_i"), sizes.n_dof) | {"q_i": sizes.n_dof - sizes.n_states}
        each |= {"impulses": sizes.n_events, "held_impulses": sizes.n_held // 2}
        each |= dict.fromkeys(("multipliers", "multiplier_rates"), sizes.n_c)
        each |= dict.fromkeys(("corrections", "correction_rates"), sizes.n_h)
        return sum(each[port] for port in self.inputs)


#: One kernel for all sums over bodies, which share the poses: each alone would make models slower to compile.
CENTROIDAL = "com (3), its Jacobian (3 x n_v), linear and angular momentum (6), inertia (9), both about the com"
INERTIAL = "of bodies, about their origins: twist, its rate less gravity; m, m c, I"

#: Numbers that say where two shapes are near each other: normal, penetration, point, direction out of the plane of
#: shapes in the plane (0 in space), coefficient of friction, restitution.
WITNESS = 12
#: The same in the list of kernel ``near_pairs``, behind the numbers of both shapes.
RECORD = 2 + WITNESS

#: y, then y', of which only the rates of q and v are there
DAE = ("q", "v", "multipliers", "corrections", "q_rate", "a", "multiplier_rates", "correction_rates")

#: velocities, their change, impulses of the constraint rows, of the gaps and of what closes and opens
STRIKE = ("q", "v", "a", "multipliers", "impulses", "held_impulses")

KERNELS: tuple[Kernel, ...] = (
    Kernel("rhs", ("q", "v"), lambda s: (s.n_x,), "x' = [q'; v'], after projecting x onto the constraints"),
    Kernel("jacobian", ("q", "v"), lambda s: (s.n_x, s.n_x), "dx'/dx of the complete rhs, row-major"),
    Kernel("mass_matrix", ("q",), lambda s: (s.n_v, s.n_v), "M of the spanning tree, row-major"),
    Kernel("embedded_mass_matrix", ("q",), lambda s: (s.n_dof, s.n_dof), "M of the independent coordinates, row-major"),
    Kernel("bias", ("q", "v"), lambda s: (s.n_v,), "h in M v' + h = generalized forces not in the model"),
    Kernel("inverse_dynamics", ("q", "v", "a"), lambda s: (s.n_v,), "M a + h, the generalized forces to add"),
    Kernel("inverse_dynamics_derivatives", ("q", "v", "a"), lambda s: (s.n_v, s.n_q + 2 * s.n_v),
           "M a + h by [q, v, a], each at fixed others; by a it is M", lazy="inverse dynamics"),
    Kernel("energy", ("q", "v"), lambda s: (2,), "kinetic and potential energy (J)"),
    Kernel("centroidal", ("q", "v"), lambda s: (s.n_com * (s.n_v + 6),), CENTROIDAL, lazy=True),
    Kernel("constraints", ("q",), lambda s: (s.n_h,), "residuals C of the holonomic rows (m, rad)"),
    Kernel("constraint_jacobian", ("q",), lambda s: (s.n_c, s.n_v), "C_q, all rows, row-major"),
    Kernel("coordinate_slopes", ("q",), lambda s: (s.n_coordinate_slopes, s.n_q),
           "dC/dq of holonomic rows where q' is given", absent=True),
    Kernel("velocity_constraints", ("q", "v"), lambda s: (s.n_c,), "C_q v + C_t, all rows, nonholonomic ones last"),
    Kernel("project", ("q", "v"), lambda s: (s.n_x,), "the nearest state on the constraints"),
    Kernel("poses", ("q",), lambda s: (s.n_bodies, 4, 4), "body frames to ground, homogeneous, row-major"),
    Kernel("outputs", ("q", "v"), lambda s: (s.n_y,), "the outputs of the model at the projected state"),
    Kernel("events", ("q", "v"), lambda s: (s.n_events,), "values whose zeros are the model's events", absent=True),
    Kernel("resets", ("q", "v"), lambda s: (s.n_resets,),
           "new values of states after events, in the order of `resets`", absent=True),
    Kernel("held_errors", ("q", "v"), lambda s: (s.n_held,), "errors and their rates of equations that are closed now",
           absent=True),
    Kernel(
        "event_derivatives", ("q", "v"),
        lambda s: ((s.n_events + s.n_resets), s.n_x + 1 + s.n_u + s.n_p) if s.n_events else (0, 0),
        "[events, resets] by [q, v, t, u, p]",
        lazy=True,
    ),
    Kernel(
        "strike_derivatives",
        STRIKE,
        lambda s: (s.n_strike, s.n_x + 1 + s.n_u + s.n_p),
        "[M a + C_q^T l - n^T g, a/s^2 + C_q^T l, C_q v + C_t, rates of events, of what is closed] by [q, v, t, u, p]",
        lazy=True,
    ),
    Kernel(
        "kinematics", ("q_i", "v_i", "a_i", "q_guess"), lambda s: (s.n_q + 2 * s.n_v,), "[q; v; a] of the whole tree"
    ),
    Kernel(
        "loop_coordinates", ("q", "v", "a"), lambda s: (3, s.n_loop_coordinates), "coordinates of cut joints, y y' y''"
    ),
    Kernel("loop_coordinate_jacobian", ("q",), lambda s: (s.n_loop_coordinates, s.n_v), "dy/dq, row-major"),
    Kernel("alignment", ("q",), lambda s: (s.n_alignments,), "positive unless an axis of a cut joint is flipped"),
    Kernel("motion_outputs", ("q", "v", "a"), lambda s: (s.n_y,), "the outputs at any accelerations", lazy=True),
    Kernel("finite_forces", ("q", "v"), lambda s: (s.n_finite_forces,), "1 where a force element's loads are finite"),
    Kernel("input_jacobian", ("q", "v"), lambda s: (s.n_x, s.n_u), "dx'/du of the complete rhs, row-major", lazy=True),
    Kernel("parameter_jacobian", ("q", "v"), lambda s: (s.n_x, s.n_p), "dx'/dp of the complete rhs, row-major",
           lazy=True),
    Kernel(
        "assembly_jacobian",
        ("q", "v"),
        lambda s: (s.n_h + s.n_c + 2 * s.n_loop_coordinates, s.n_x + s.n_u + s.n_p),
        "[C, C_q v + C_t, loop coordinates, their rates] by [q, v, u, p]",
        lazy=True,
    ),
    Kernel(
        "output_derivatives",
        ("q", "v", "a"),
        lambda s: (s.n_y, s.n_q + 2 * s.n_v + s.n_u + s.n_p),
        "outputs by [q, v, a, u, p], each at fixed others",
        lazy=True,
    ),
    Kernel(
        "needed_wrenches",
        ("q", "v", "a"),
        lambda s: (s.n_wrenches,),
        "wrench that joints and constraints exert on each body (6, about its origin), loads of cut joints (6)",
        lazy="reactions",
    ),
    Kernel(
        "wrench_geometry",
        ("q",),
        lambda s: (s.n_wrench_geometry,),
        "constraint rows by displacements of bodies (n_c, n_bodies, 6), joints' points (3), their free directions (6)",
        lazy="reactions",
    ),
    Kernel("inertial_terms", ("q", "v", "a"), lambda s: ((s.n_wrenches > 0) * s.n_bodies, 22), INERTIAL, lazy=True),
    Kernel("canonical", ("q", "v"), lambda s: (2, s.n_momenta), "momenta dL/dv, and their rates -dH/dq + Q", lazy=True),
    Kernel("dae_residual", DAE, lambda s: (s.n_dae,), "F(t, y, y') of y = [q; v; multipliers; corrections]", lazy=True),
    Kernel("dae_jacobian", (*DAE, "cj"), lambda s: (s.n_dae, s.n_dae), "dF/dy + cj dF/dy', row-major", lazy=True),
    Kernel("meeting_time", ("q", "v", "a"), lambda s: (5,), "s until shapes may meet; depth, thickness, deepest pair"),
    Kernel("near_pairs", ("q",), lambda s: (s.n_witnesses,), "of each contact: how many pairs are near, and where",
           lazy="rigid contact"),
    Kernel("bias_apart", ("q", "v"), lambda s: (s.n_v if s.n_witnesses else 0,), "h without contacts between groups",
           lazy="rigid contact"),
    Kernel("motion_axes", ("q",), lambda s: (s.n_v if s.n_witnesses else 0, 6), lazy="rigid contact",
           result="angular velocity of what a velocity moves, and velocity of its point at the origin, ground axes"),
    Kernel("scales", (), lambda s: (s.n_v + s.n_c,), "typical sizes of the coordinates, then of the constraint rows"),
)  # fmt: skip

#: Those that take the time first.
TIMED = frozenset((
    *("rhs", "jacobian", "bias", "outputs", "input_jacobian", "parameter_jacobian", "dae_residual", "dae_jacobian"),
    *("events", "resets", "held_errors", "event_derivatives", "strike_derivatives"),
))  # fmt: skip
#: The same by name.
NAMED = {kernel.name: kernel for kernel in KERNELS}


def argument(kernel: str, label: str) -> str:
    """What users call an argument of a kernel: the x of some is q."""
    return "q" if label == "x" and kernel in NAMED and NAMED[kernel].inputs == ("q",) else label
