"""Systems of SymPy's mechanics, built as its own tests and books build them, for use through from_sympy."""

from math import acos, atan2, cos, hypot, pi, sin
from typing import Any

import sympy
from sympy import symbols
from sympy.physics.mechanics import (
    KanesMethod,
    LagrangesMethod,
    Particle,
    PinJoint,
    Point,
    ReferenceFrame,
    RigidBody,
    System,
    cross,
    dynamicsymbols,
    inertia,
)

t = dynamicsymbols._t


def rolling_disc(solver: str = "LU") -> Any:
    """A disc rolling on a plane, speeds in body axes (SymPy, test_kane5.py)."""
    q1, q2, q3, q4, q5, u1, u2, u3, u4, u5 = dynamicsymbols("q1:6 u1:6")
    g, r, m = symbols("g r m")
    plane, disc, lean = ReferenceFrame("N"), ReferenceFrame("D"), ReferenceFrame("L")
    lean.orient_body_fixed(plane, (q1, q2, 0), "zxy")
    disc.orient_axis(lean, lean.y, q3)
    spin = disc.ang_vel_in(plane)
    disc.set_ang_vel(plane, u1 * disc.x + u2 * disc.y + u3 * disc.z)
    origin, centre = Point("O"), Point("C")
    contact = origin.locatenew("P", q4 * plane.x + q5 * plane.y)
    contact.set_vel(plane, u4 * plane.x + u5 * plane.y)
    centre.set_pos(contact, r * lean.z)
    centre.set_vel(plane, cross(disc.ang_vel_in(plane), centre.pos_from(contact)))
    slip = contact.vel(plane) + cross(disc.ang_vel_in(lean), contact.pos_from(centre))
    body = RigidBody("disc", centre, disc, m, (m * r**2 / 4 * inertia(disc, 1, 2, 1), centre))
    kinematics = [spin.dot(disc.x) - u1, spin.dot(disc.y) - u2, spin.dot(disc.z) - u3, q4.diff(t) - u4, q5.diff(t) - u5]
    kane = KanesMethod(
        plane,
        [q1, q2, q3, q4, q5],
        [u1, u2, u3],
        kinematics,
        u_dependent=[u4, u5],
        velocity_constraints=[slip.dot(plane.x), slip.dot(plane.y)],
        kd_eqs_solver=solver,
    )
    kane.kanes_equations([body], [(centre, -m * g * plane.z)])
    return kane


def bicycle() -> Any:
    """The Whipple bicycle after Meijaard, Papadopoulos, Ruina, Schwab (2007), as in SymPy's test_kane3.py."""
    q1, q2, q4, q5, u1, u2, u3, u4, u5, u6 = dynamicsymbols("q1 q2 q4 q5 u1:7")
    WFrad, WRrad, htangle, forkoffset, forklength, framelength = symbols(
        "WFrad WRrad htangle forkoffset forklength framelength"
    )
    forkcg1, forkcg3, framecg1, framecg3, g = symbols("forkcg1 forkcg3 framecg1 framecg3 g")
    mframe, mfork, mwf, mwr, Iwr11, Iwr22, Iwf11, Iwf22 = symbols("mframe mfork mwf mwr Iwr11 Iwr22 Iwf11 Iwf22")
    N = ReferenceFrame("N")
    yaw = N.orientnew("Y", "Axis", [q1, N.z])
    roll = yaw.orientnew("R", "Axis", [q2, yaw.x])
    frame = roll.orientnew("Frame", "Axis", [q4 + htangle, roll.y])
    frame_axes = frame.orientnew("TempFrame", "Axis", [-htangle, frame.y])
    fork = frame.orientnew("Fork", "Axis", [q5, frame.x])
    fork_axes = fork.orientnew("TempFork", "Axis", [-htangle, fork.y])
    rear, front = ReferenceFrame("WR"), ReferenceFrame("WF")
    rear_contact = Point("WR_cont")
    rear_centre = rear_contact.locatenew("WR_mc", WRrad * roll.z)
    steer = rear_centre.locatenew("Steer", framelength * frame.z)
    frame_centre = rear_centre.locatenew("Frame_mc", -framecg1 * frame.x + framecg3 * frame.z)
    fork_centre = steer.locatenew("Fork_mc", -forkcg1 * fork.x + forkcg3 * fork.z)
    front_centre = steer.locatenew("WF_mc", forklength * fork.x + forkoffset * fork.z)
    down = (fork.y.dot(yaw.z) * fork.y - yaw.z).normalize()
    front_contact = front_centre.locatenew("WF_cont", WFrad * down)
    yaw.set_ang_vel(N, u1 * yaw.z)
    roll.set_ang_vel(yaw, u2 * roll.x)
    rear.set_ang_vel(frame, u3 * frame.y)
    frame.set_ang_vel(roll, u4 * frame.y)
    fork.set_ang_vel(frame, u5 * fork.x)
    front.set_ang_vel(fork, u6 * fork.y)
    rear_contact.set_vel(N, 0)
    rear_centre.v2pt_theory(rear_contact, N, rear)
    steer.v2pt_theory(rear_centre, N, frame)
    frame_centre.v2pt_theory(rear_centre, N, frame)
    fork_centre.v2pt_theory(steer, N, fork)
    front_centre.v2pt_theory(steer, N, fork)
    front_contact.v2pt_theory(front_centre, N, front)
    moments = {name: symbols(f"I{name}11 I{name}22 I{name}33 I{name}31") for name in ("frame", "fork")}
    bodies = []
    for name, centre, axes, turned, mass in (
        ("frame", frame_centre, frame, frame_axes, mframe),
        ("fork", fork_centre, fork, fork_axes, mfork),
    ):
        xx, yy, zz, zx = moments[name]
        bodies.append(RigidBody(name, centre, axes, mass, (inertia(turned, xx, yy, zz, 0, 0, zx), centre)))
    bodies.append(RigidBody("rear", rear_centre, rear, mwr, (inertia(frame, Iwr11, Iwr22, Iwr11), rear_centre)))
    bodies.append(RigidBody("front", front_centre, front, mwf, (inertia(fork, Iwf11, Iwf22, Iwf11), front_centre)))
    slip = front_contact.vel(N)
    kane = KanesMethod(
        N,
        q_ind=[q1, q2, q5],
        q_dependent=[q4],
        configuration_constraints=[front_contact.pos_from(rear_contact).dot(yaw.z)],
        u_ind=[u2, u3, u5],
        u_dependent=[u1, u4, u6],
        velocity_constraints=[slip.dot(yaw.x), slip.dot(yaw.y), slip.dot(yaw.z)],
        kd_eqs=[q1.diff(t) - u1, q2.diff(t) - u2, q4.diff(t) - u4, q5.diff(t) - u5],
        constraint_solver="CRAMER",
    )
    kane.kanes_equations(bodies, [(body.masscenter, -body.mass * g * yaw.z) for body in bodies])
    return kane


def bicycle_numbers() -> dict[str, float]:
    """The benchmark's parameters in the measures of :func:`bicycle` (SymPy, test_kane3.py)."""
    rear, front, tilt, trail, base = 0.3, 0.35, pi / 2 - pi / 10, 0.08, 1.02
    frame_x, frame_z, fork_x, fork_z = 0.3, 0.9, 0.9, 0.7
    rake = -(trail * sin(tilt) - front * cos(tilt))
    fork_length = base * cos(tilt) - (front - rear) * sin(tilt)
    up, ahead = fork_z - front, base - fork_x
    size = hypot(up, ahead)
    turn = pi / 2 - tilt - acos(up / size)
    assert abs(acos(up / size) - atan2(ahead, up)) < 1e-15
    return {
        "WFrad": front, "WRrad": rear, "htangle": tilt, "forkoffset": rake, "forklength": fork_length,
        "framelength": base * sin(tilt) - (rake - (front - rear) * cos(tilt)),
        "forkcg1": size * cos(turn) - fork_length, "forkcg3": rake + size * sin(turn),
        "framecg1": (frame_z - rear - frame_x / sin(tilt) * cos(tilt)) * sin(tilt),
        "framecg3": frame_x / sin(tilt) + (frame_z - rear - frame_x / sin(tilt) * cos(tilt)) * cos(tilt),
        "Iwr11": 0.0603, "Iwr22": 0.12, "Iwf11": 0.1405, "Iwf22": 0.28,
        "Ifork11": 0.05892, "Ifork22": 0.06, "Ifork33": 0.00708, "Ifork31": 0.00756,
        "Iframe11": 9.2, "Iframe22": 11, "Iframe33": 2.8, "Iframe31": -2.4,
        "mfork": 4, "mframe": 85, "mwf": 3, "mwr": 2, "g": 9.81,
    }  # fmt: skip


def four_bar(method: Any = KanesMethod) -> System:
    """Four uniform rods in a plane, the loop closed by constraints (SymPy, test_jointsmethod.py)."""
    q1, q2, q3, u1, u2, u3 = dynamicsymbols("q1:4 u1:4")
    lengths, rho = symbols("l1:5"), symbols("rho")
    links = []
    for k, length in enumerate(lengths):
        link = RigidBody(f"link{k + 1}", mass=rho * length)
        link.central_inertia = inertia(link.frame, 0, 0, rho * length**3 / 12)
        links.append(link)
    system = System.from_newtonian(links[0])
    lagrange = method is LagrangesMethod
    speeds = [q.diff(t) for q in (q1, q2, q3)] if lagrange else [u1, u2, u3]
    for k, (q, u) in enumerate(zip((q1, q2, q3), speeds, strict=True)):
        inner, outer = links[k], links[k + 1]
        system.add_joints(
            PinJoint(
                f"J{k + 1}",
                inner,
                outer,
                coordinates=q,
                speeds=u,
                joint_axis=inner.z,
                parent_point=lengths[k] / 2 * inner.x,
                child_point=-lengths[k + 1] / 2 * outer.x,
            )
        )
    loop = links[3].masscenter.pos_from(links[0].masscenter)
    loop += lengths[0] / 2 * links[0].x + lengths[3] / 2 * links[3].x
    system.add_holonomic_constraints(loop.dot(links[0].x), loop.dot(links[0].y))
    if lagrange:
        system.form_eoms(eom_method=LagrangesMethod)
    else:
        system.q_ind, system.q_dep = [q1], [q2, q3]
        system.u_ind, system.u_dep = [u1], [u2, u3]
        system.form_eoms()
    return system


def hanging(names: str = "q1 q2") -> tuple[Any, Any, Any]:
    """Symbols of a plane double pendulum: coordinates, the points of its bobs and the frame."""
    q1, q2 = dynamicsymbols(names)
    l1, l2 = symbols("l1 l2")
    N = ReferenceFrame("N")
    A = N.orientnew("A", "Axis", [q1, N.z])
    B = N.orientnew("B", "Axis", [q2, N.z])
    origin = Point("O")
    origin.set_vel(N, 0)
    one = origin.locatenew("P1", -l1 * A.y)
    two = one.locatenew("P2", -l2 * B.y)
    return (q1, q2), (origin, one, two, A, B), N


def double_pendulum(swap: bool = False) -> Any:
    """Kane's equations of a plane double pendulum in absolute angles; ``swap`` names the speeds crosswise."""
    (q1, q2), (origin, one, two, A, B), N = hanging()
    u1, u2 = dynamicsymbols("w2 w1") if swap else dynamicsymbols("w1 w2")
    m1, m2, g = symbols("m1 m2 g")
    A.set_ang_vel(N, u1 * N.z)
    B.set_ang_vel(N, u2 * N.z)
    one.v2pt_theory(origin, N, A)
    two.v2pt_theory(one, N, B)
    bobs = [Particle("bob1", one, m1), Particle("bob2", two, m2)]
    kane = KanesMethod(N, [q1, q2], [u2, u1] if swap else [u1, u2], [q1.diff(t) - u1, q2.diff(t) - u2])
    kane.kanes_equations(bobs, [(bob.point, -bob.mass * g * N.y) for bob in bobs])
    return kane


def cartesian_pendulum() -> Any:
    """A bob in Cartesian coordinates on a rod that is a constraint."""
    x, y = dynamicsymbols("x y")
    m, g, l = symbols("m g l")
    kinetic = m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2
    method = LagrangesMethod(kinetic - m * g * y, [x, y], hol_coneqs=[x**2 + y**2 - l**2])
    method.form_lagranges_equations()
    return method


def knife_edge() -> Any:
    """A skate on a plane: it does not slip sideways."""
    x, y, heading = dynamicsymbols("x y heading")
    m, J = symbols("m J")
    kinetic = m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + J * heading.diff(t) ** 2 / 2
    slip = x.diff(t) * sympy.sin(heading) - y.diff(t) * sympy.cos(heading)
    method = LagrangesMethod(kinetic, [x, y, heading], nonhol_coneqs=[slip])
    method.form_lagranges_equations()
    return method


def pulled_pendulum() -> Any:
    """A pendulum with an auxiliary speed along its rod, which brings the force in the rod into evidence; driven."""
    theta, omega, stretch, torque, pull = dynamicsymbols("theta omega stretch torque pull")
    m, g, l = symbols("m g l")
    N = ReferenceFrame("N")
    A = N.orientnew("A", "Axis", [theta, N.z])
    A.set_ang_vel(N, omega * N.z)
    origin = Point("O")
    origin.set_vel(N, 0)
    bob = origin.locatenew("P", -l * A.y)
    bob.v2pt_theory(origin, N, A)
    bob.set_vel(N, bob.vel(N) - stretch * A.y)
    kane = KanesMethod(N, [theta], [omega], [theta.diff(t) - omega], u_auxiliary=[stretch])
    loads = [(bob, -m * g * N.y), (bob, pull * A.y), (bob, torque / l * A.x)]
    kane.kanes_equations([Particle("bob", bob, m)], loads)
    return kane
