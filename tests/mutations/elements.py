"""Faults in joints, constraints, force elements and rotations."""

from __future__ import annotations

from mutations.fault import Fault

EVERY = "tests/joints/test_every_type.py"

FAULTS = (
    Fault(
        "screw-lead", "eomgen/joints/one_degree.py",
        "return self.pitch / (2 * math.pi)", "return self.pitch / math.pi",
        "a screw advances two pitches a turn", ("tests/joints/test_mechanisms.py", EVERY),
    ),
    Fault(
        "constant-velocity-half", "eomgen/joints/two_angles.py",
        "vec.scale(graph.constant(0.5), vec.add(first, third))", "vec.scale(graph.constant(0.5), first)",
        "velocity of a constant-velocity joint: one of its two half turns is left out", (EVERY,),
    ),
    Fault(
        "universal-cut", "eomgen/joints/two_angles.py",
        'Closure("x.y", rotation[0][1], "angle")]', 'Closure("x.y", rotation[1][0], "angle")]',
        "a cut universal joint holds the wrong pair of axes: transposed rotation", ("tests/joints/test_mechanisms.py", EVERY),
    ),
    Fault(
        "planar-columns", "eomgen/joints/many_degrees.py",
        "[(o, turn[0]), (o, turn[1]), (unit(graph, 2), o)]", "[(o, turn[1]), (o, turn[0]), (unit(graph, 2), o)]",
        "velocities of a planar joint are swapped", (EVERY,),
    ),
    Fault(
        "cylindrical-measure", "eomgen/joints/many_degrees.py",
        "return [position[2], atan2(rotation[1][0], rotation[0][0])]", "return [position[2], atan2(rotation[0][1], rotation[0][0])]",
        "the angle of a cut cylindrical joint has the wrong sign", (EVERY,),
    ),
    Fault(
        "quaternion-rate", "eomgen/joints/rotations.py",
        "h1, h2, h3 = (0.5 * x for x in w)", "h1, h2, h3 = (1.0 * x for x in w)",
        "rates of Euler parameters are twice what they should be", (EVERY, "tests/state/test_trees.py"),
    ),
    Fault(
        "quaternion-rate-index", "eomgen/joints/rotations.py",
        "e0 * h1 - e3 * h2 + e2 * h3", "e0 * h1 + e3 * h2 - e2 * h3",
        "rates of Euler parameters for ground axes instead of body axes", (EVERY, "tests/state/test_trees.py"),
    ),
    Fault(
        "euler-rates", "eomgen/joints/rotations.py",
        "column = vec.transpose_times(about(graph, AXES[later], angle), column)", "column = vec.times(about(graph, AXES[later], angle), column)",
        "angular velocity of Euler angles: transposed rotation", (EVERY,),
    ),
    Fault(
        "gear-internal", "eomgen/describe/build_couplings.py",
        'ratio = -ratio if e.flag("internal") else ratio', 'ratio = ratio if e.flag("internal") else -ratio',
        "outside and inside gears are exchanged", ("tests/constraints/test_gears.py",),
    ),
    Fault(
        "gear-inverted", "eomgen/constraints/gears.py",
        "self.a + self.ratio * self.b - self.phase", "self.b + self.ratio * self.a - self.phase",
        "the gear ratio is inverted", ("tests/constraints/test_gears.py",),
    ),
    Fault(
        "planetary-ring", "eomgen/constraints/gears.py",
        "r_r / r_p * (self.ring - self.carrier) - self.planet", "r_r / r_p * (self.ring - self.carrier) + self.planet",
        "ring and planet mesh outside", ("tests/constraints/test_gears.py",),
    ),
    Fault(
        "rack-radius", "eomgen/constraints/gears.py",
        "self.rack - self.radius * self.pinion - self.offset", "self.rack + self.radius * self.pinion - self.offset",
        "a rack runs backwards", ("tests/constraints/test_gears.py",),
    ),
    Fault(
        "cam-roller-normal", "eomgen/constraints/cams.py",
        "y + reach * slope", "y - reach * slope",
        "the normal of a cam's contour leans the wrong way", ("tests/constraints/test_cams.py",),
    ),
    Fault(
        "cam-phase", "eomgen/constraints/cams.py",
        "self.lift.at(self.cam - self.phase)", "self.lift.at(self.cam + self.phase)",
        "the phase of a cam has the wrong sign", ("tests/constraints/test_cam_lifts.py", "tests/constraints/test_cams.py"),
    ),
    Fault(
        "rolling-floor", "eomgen/constraints/rolling.py",
        "floor = vec.add(view.velocity(self.plane), vec.cross(view.angular_velocity(self.plane), beside))", "floor = view.velocity(self.plane)",
        "a floor that turns does not carry what rolls on it along", ("tests/constraints/test_rolling_rows.py", "tests/constraints/test_rolling_motion.py"),
    ),
    Fault(
        "rolling-tube", "eomgen/constraints/rolling.py",
        "return vec.sub(rim, vec.scale(self.tube, n))", "return rim",
        "the contact point of a rounded wheel is off by its tube's radius", ("tests/constraints/test_rolling_rows.py", "tests/constraints/test_rolling_motion.py"),
    ),
    Fault(
        "driver-place-axis", "eomgen/constraints/drivers.py",
        "vec.dot(self.axis, view.relative(self.on, self.marker).position)", "vec.dot(self.axis, view.relative(self.marker, self.on).position)",
        "a driven place is measured from the wrong end", ("tests/constraints/test_drivers.py",),
    ),
    Fault(
        "spring-energy", "eomgen/forces/elements.py",
        "return 0.5 * self.stiffness * (stretch * stretch)", "return self.stiffness * (stretch * stretch)",
        "energy of a spring without its 1/2", ("tests/forces/test_energies_of_springs.py",),
    ),
    Fault(
        "spring-rest", "eomgen/forces/elements.py",
        "-self.stiffness * (value - self.rest)", "-self.stiffness * value",
        "a spring forgets its rest length", ("tests/forces/test_energies_of_springs.py",),
    ),
    Fault(
        "body-force-axes", "eomgen/forces/elements.py",
        'vec.times(view.rotation(marker), value) if axes == "body"', 'vec.transpose_times(view.rotation(marker), value) if axes == "body"',
        "a force in body axes is turned by the transposed rotation", ("tests/forces/test_axes_of_forces.py",),
    ),
    Fault(
        "bushing-drift", "eomgen/forces/bushing.py",
        "drift = vec.cross(w1, vec.sub(", "drift = vec.cross(vec.scale(view.graph.lift(0.0), w1), vec.sub(",
        "damping of a bushing sees the turning of its first body as motion", ("tests/forces/test_loads.py::test_a_bushing",),
    ),
    Fault(
        "bushing-torque", "eomgen/forces/bushing.py",
        "vec.add(vec.scale(e0, moments), vec.cross(e, moments))", "vec.add(vec.scale(e0, moments), vec.cross(moments, e))",
        "torque of a bushing at a large turn: the term e x m has the wrong sign", ("tests/forces/test_loads.py::test_a_bushing",),
    ),
    Fault(
        "contact-rate", "eomgen/forces/contact.py",
        "vec.sub(relative, vec.scale(parting, normal)), -parting", "vec.sub(relative, vec.scale(parting, normal)), parting",
        "damping of a contact has the wrong sign", ("tests/forces/test_loads.py::test_contact_of_two_bodies",),
    ),
    Fault(
        "contact-arm", "eomgen/forces/contact.py",
        "MarkerLoad(self.first, vec.neg(force), vec.cross(force, first)),", "MarkerLoad(self.first, vec.neg(force), vec.cross(first, force)),",
        "friction at a contact turns the first body the wrong way", ("tests/forces/test_loads.py::test_contact_of_two_bodies",),
    ),
    Fault(
        "friction-stribeck", "eomgen/forces/friction.py",
        "self.dynamic + (self.static - self.dynamic) * fall", "self.static + (self.dynamic - self.static) * fall",
        "static and dynamic friction are exchanged", ("tests/forces/test_loads.py::test_contact_of_two_bodies",),
    ),
    Fault(
        "muscle-tilt", "eomgen/forces/muscle.py",
        "+ self.damping * v) * tilt", "+ self.damping * v)",
        "the pennation of a muscle does not lessen its pull", ("tests/forces/test_loads.py::test_a_muscle",),
    ),
    Fault(
        "stop-rate", "eomgen/forces/stops.py",
        "found.append((self.lower - value, -rate, 1.0))", "found.append((self.lower - value, rate, 1.0))",
        "the lower stop's damping has the wrong sign", ("tests/forces/test_energies_of_springs.py::test_a_lower_stop_brakes",),
    ),
    Fault(
        "stop-energy", "eomgen/forces/normal_laws.py",
        "self.stiffness * d**power / power", "self.stiffness * d**power / self.exponent",
        "elastic energy of a contact is divided by n instead of n + 1", ("tests/forces/test_energies_of_springs.py",),
    ),
    Fault(
        "gravity-gradient", "eomgen/forces/attraction.py",
        "trace - 5.0 * along, u", "trace - 3.0 * along, u",
        "force of a gravity gradient: 5 becomes 3", ("tests/forces/test_loads.py::test_gravity_of_a_point_of_one_body_on_another",),
    ),
    Fault(
        "wrapped-path", "eomgen/forces/routes.py",
        "last: Vec3 = (r * q[0], r * q[1], b[2] - h * t_b / across)", "last: Vec3 = (r * q[0], r * q[1], b[2])",
        "where a string leaves a cylinder is off along the axis", ("tests/forces/test_paths.py",),
    ),
    Fault(
        "rotation-vector-series", "eomgen/rotations/rates.py",
        "(1 - s / 12 * (1 - s / 30 * (1 - s / 56 *", "(1 - s / 12 * (1 - s / 30 * (1 - s / 65 *",
        "a digit pair of the series of (1 - cos a) / a^2 is swapped", ("tests/rotations/test_series_of_rates.py",),
    ),
    Fault(
        "rotation-vector-rate", "eomgen/rotations/rates.py",
        "square / 60 + square * square / 2520", "square / 60 + square * square / 2250",
        "a digit pair of the series for rates of rotation vectors is swapped", ("tests/rotations/test_series_of_rates.py",),
    ),
    Fault(
        "quaternion-product", "eomgen/rotations/quaternions.py",
        "u[2] * v[0] - u[0] * v[2]", "u[0] * v[2] - u[2] * v[0]",
        "product of quaternions: a sign", ("tests/rotations/test_rotations.py",),
    ),
    Fault(
        "euler-ground-axes", "eomgen/rotations/rates.py",
        "turns[n + 1 :] if sign < 0 else reversed(turns[:n])", "turns[n + 1 :] if sign < 0 else turns[:n]",
        "angular velocity in ground axes: turns in the wrong order", ("tests/rotations/test_rotations.py",),
    ),
)  # fmt: skip
