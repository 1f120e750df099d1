"""Faults in the rules of derivation: the methods, motion of bodies, loads, constraint derivatives, differentiation."""

from __future__ import annotations

from mutations.fault import Fault

AGREE, PINOCCHIO = "tests/equations/test_agreement.py", "tests/equations/test_against_pinocchio.py"
RECURSIVE, SLOPES = "tests/equations/test_recursive.py", "tests/equations/test_slopes.py"
EMBEDDING, ARTICULATED = "eomgen/equations/embedding.py", "eomgen/equations/recursive.py"

FAULTS = (
    Fault(
        "embedding-coriolis", EMBEDDING,
        "coriolis = vec.scale(two, vec.cross(above, rate.slide))", "coriolis = vec.cross(above, rate.slide)",
        "Coriolis acceleration of sliding joints: the factor 2 is lost", (PINOCCHIO,),
    ),
    Fault(
        "embedding-gyroscopic", EMBEDDING,
        "own + mixed + inertia[j][k] * (squares[j] - squares[k])", "own + mixed - inertia[j][k] * (squares[j] - squares[k])",
        "gyroscopic moment of products of inertia has the wrong sign", (PINOCCHIO,),
    ),
    Fault(
        "embedding-gyroscopic-principal", EMBEDDING,
        "(inertia[k][k] - inertia[j][j]) * (omega[j] * omega[k])", "(inertia[j][j] - inertia[k][k]) * (omega[j] * omega[k])",
        "gyroscopic moment omega x J omega of principal moments is turned round", (PINOCCHIO,),
    ),
    Fault(
        "embedding-gravity-sign", EMBEDDING,
        "lifted = vec.neg(kinematics.mechanism.gravity)  # gravity", "lifted = kinematics.mechanism.gravity  # gravity",
        "gravity pulls upwards", (PINOCCHIO,),
    ),
    Fault(
        "embedding-lever", EMBEDDING,
        "vec.cross(link.position, push)), push", "vec.cross(push, link.position)), push",
        "a force handed to the parent has its moment turned round", (PINOCCHIO,),
    ),
    Fault(
        "embedding-composite", EMBEDDING,
        "composite[link.parent].plus(link.up_inertia(composite[k]))", "composite[link.parent].plus(composite[k])",
        "inertia of a child is added to the parent's in its own axes, about its own origin", (PINOCCHIO,),
    ),
    Fault(
        "lagrange-turned-axes", "eomgen/equations/lagrange.py",
        "vec.sub(vec.vector(graph, slope[j : j + 3]), vec.cross(w, p))",
        "vec.add(vec.vector(graph, slope[j : j + 3]), vec.cross(w, p))",
        "w x dT/dw of Boltzmann and Hamel has the wrong sign", ("tests/state/test_trees.py",),
    ),
    Fault(
        "lagrange-explicit-time", "eomgen/equations/lagrange.py",
        "drift = jvp(momentum, kinematics.flow | kinematics.clock)", "drift = jvp(momentum, kinematics.flow)",
        "momentum that depends on time explicitly: its partial derivative is left out of h", ("tests/equations/test_bare_lagrangian.py",),
    ),
    Fault(
        "energy-spin", "eomgen/equations/energies.py",
        "(link.mass * vec.dot(center, center) + spin)", "(link.mass * vec.dot(center, center) - spin)",
        "energy of rotation is subtracted", (AGREE,),
    ),
    Fault(
        "energy-height", "eomgen/equations/energies.py",
        "link.mass * (height + vec.dot(pull, link.com))", "link.mass * (height - vec.dot(pull, link.com))",
        "height of the centre of mass above the joint has the wrong sign in V", (AGREE,),
    ),
    Fault(
        "dissipation-sign", "eomgen/equations/energies.py",
        "[f - d for f, d in zip(bare.forces, drag, strict=True)]", "[f + d for f, d in zip(bare.forces, drag, strict=True)]",
        "Rayleigh's dissipation drives", ("tests/equations/test_bare_lagrangian.py",),
    ),
    Fault(
        "articulated-release", ARTICULATED,
        "self.coupling[i][j] - turn[i] * push_d[j]", "self.coupling[i][j] - push[i] * turn_d[j]",
        "I - U U^T / D: the coupling block of U U^T is transposed", (RECURSIVE,),
    ),
    Fault(
        "articulated-centripetal", ARTICULATED,
        "(vec.sub(spin, turn), vec.sub(swing, push))", "(vec.sub(spin, turn), vec.neg(push))",
        "centripetal force of an eccentric body is left out", (RECURSIVE,),
    ),
    Fault(
        "articulated-coriolis", ARTICULATED,
        "vec.scale(graph.constant(2.0), rate.slide))\n        linear", "rate.slide)\n        linear",
        "Coriolis acceleration of sliding joints: the factor 2 is lost", (RECURSIVE,),
    ),
    Fault(
        "articulated-drive", ARTICULATED,
        "pivot = _dot(column, felt) + drives.get(index, graph.zero)", "pivot = _dot(column, felt)",
        "the inertia of a drive does not resist", ("tests/equations/test_armature.py",),
    ),
    Fault(
        "free-body-gyroscopic", "eomgen/equations/free_bodies.py",
        "vec.add(vec.cross(v[0], f[0]), vec.cross(v[1], f[1])), vec.cross(v[0], f[1])",
        "vec.cross(v[0], f[0]), vec.cross(v[0], f[1])",
        "V x* I V: the part v x p of the moment is left out", ("tests/forms/test_agreement.py",),
    ),
    Fault(
        "cut-joint-bend", "eomgen/equations/free_bodies.py",
        "bend=cross_motion(relative, above)", "bend=cross_motion(above, relative)",
        "closure accelerations of cut joints: what relative motion adds has the wrong sign", ("tests/forms/test_agreement.py",),
    ),
    Fault(
        "coupling-force", "eomgen/equations/free_bodies.py",
        "rest = self.forces[j] - pulls[j]", "rest = self.forces[j]",
        "the forces of gears and couplings do not act on joints", ("tests/forms/test_agreement.py",),
    ),
    Fault(
        "gibbs-appell-gyroscopic", "eomgen/equations/gibbs_appell.py",
        "vec.dot(alpha, vec.times(link.inertia, alpha)) + vec.dot(alpha, vec.cross(omega, momentum))",
        "vec.dot(alpha, vec.times(link.inertia, alpha))",
        "energy of acceleration without its gyroscopic term", ("tests/forms/test_agreement.py",),
    ),
    Fault(
        "hamilton-factor", "eomgen/equations/hamilton.py",
        "hamiltonian = hamiltonian + 0.5 * (a * b)", "hamiltonian = hamiltonian + a * b",
        "kinetic part of H: the factor 1/2 is lost", ("tests/forms/test_canonical.py", "tests/forms/test_agreement.py"),
    ),
    Fault(
        "baumgarte-damping", "eomgen/equations/augmented.py",
        "[g + 2.0 * alpha * rate for", "[g + alpha * rate for",
        "Baumgarte's 2 alpha C' loses its 2", ("tests/forms/test_baumgarte.py",),
    ),
    Fault(
        "armature-cut-joint", "eomgen/equations/armature.py",
        "rest = substitute([acceleration], still)[0]", "rest = graph.zero",
        "a drive on a cut joint: J y_q^T y_qq q'^2 is left out of h", ("tests/equations/test_armature.py",),
    ),
    Fault(
        "slopes-axis-turn", "eomgen/equations/slopes.py",
        "vec.add(vec.cross(self._twice[k], s), vec.scale(two, own)),", "vec.add(vec.cross(self._twice[k], s), own),",
        "derivative of h by velocities: columns that turn themselves count half", (SLOPES,),
    ),
    Fault(
        "slopes-euler-parameters", "eomgen/equations/slopes.py",
        "factor = 4.0 / (e[0] * e[0]", "factor = 2.0 / (e[0] * e[0]",
        "derivatives by Euler parameters are half", (SLOPES,),
    ),
    Fault(
        "reduction-particular", "eomgen/equations/reduction.py",
        "equations.bias[i] + _dot(mass[i], particular)", "equations.bias[i]",
        "the embedded force shown in SymPy lacks M a_p of loops that turn", ("tests/equations/test_reduction.py",),
    ),
    Fault(
        "constraints-second-time", "eomgen/kinematics/loops.py",
        "gamma=tuple(jvp([*velocity, *nonholonomic], along | at_rest)),",
        "gamma=tuple(jvp([*velocity, *nonholonomic], (along | at_rest) | {state.t: zero})),",
        "C_tt and C_qt of driven constraints are dropped", ("tests/constraints/test_drivers.py",),
    ),
    Fault(
        "nonholonomic-free-term", "eomgen/kinematics/loops.py",
        "*substitute(nonholonomic, at_rest)),\n        velocity", "*(zero for _ in nonholonomic)),\n        velocity",
        "b(q, t) of nonholonomic rows A v + b = 0 is dropped", ("tests/state/test_nonholonomic.py", "tests/constraints/test_rolling_rows.py"),
    ),
    Fault(
        "slide-rate", "eomgen/kinematics/rates.py",
        "slide_rates = jvp(slides, along)", "slide_rates = [graph.zero for _ in slides]",
        "acceleration along a curved guide at constant speed is left out", ("tests/joints/test_moving_guides.py",),
    ),
    Fault(
        "spin-rate", "eomgen/kinematics/rates.py",
        "vec.add(spin_rate, vec.scale(rate, _three(flows, at)))", "spin_rate",
        "axes of Euler angles turn, but their change is left out", ("tests/joints/test_moving_guides.py",),
    ),
    Fault(
        "momentum-arm", "eomgen/kinematics/momentum.py",
        "vec.cross(arm, self._momentum_of(k))", "vec.cross(self._momentum_of(k), arm)",
        "orbital part of the angular momentum has the wrong sign", ("tests/kinematics/test_momentum.py",),
    ),
    Fault(
        "inertia-shift", "eomgen/kinematics/inertia.py",
        "(p[i] * moved[j] + h[i] * p[j])", "(p[i] * moved[j])",
        "parallel axes: a term of the products of inertia is left out", (PINOCCHIO,),
    ),
    Fault(
        "inertia-turn", "eomgen/kinematics/inertia.py",
        "c * t - a[j][i], c * t - a[i][j]", "c * t - a[i][i], c * t - a[j][j]",
        "turning a tensor about an axis: wrong index in the product of inertia", (PINOCCHIO,),
    ),
    Fault(
        "load-arm", "eomgen/kinematics/loads.py",
        "vec.cross(arm, push)", "vec.cross(push, arm)",
        "moment of a force at a marker has the wrong sign", ("tests/forces/test_loads.py",),
    ),
    Fault(
        "reversed-joint", "eomgen/kinematics/tree.py",
        "vec.sub(vec.cross(angular, position), linear)", "vec.sub(vec.cross(position, angular), linear)",
        "a joint walked from its successor: velocity of the other origin", ("tests/joints/test_moving_guides.py",),
    ),
    Fault(
        "marker-transposed", "eomgen/kinematics/tree.py",
        "vec.add(outer.position, vec.times(outer.rotation, inner.position)),",
        "vec.add(outer.position, vec.transpose_times(outer.rotation, inner.position)),",
        "the place of a marker is turned by the transposed rotation", ("tests/forces/test_loads.py",),
    ),
    Fault(
        "falling-link", "eomgen/kinematics/turned.py",
        "along if b.gravity is None else vec.add(along, b.gravity)", "along if b.gravity is None else vec.sub(along, b.gravity)",
        "free bodies solved along their own axes fall upwards", ("tests/equations/test_resolved_axes.py",),
    ),
    Fault(
        "own-axes", "eomgen/kinematics/motion.py",
        "return vec.transpose_times(self.poses.marker_in_link(marker).rotation, (x, y, z))",
        "return vec.times(self.poses.marker_in_link(marker).rotation, (x, y, z))",
        "angular velocity in a turned marker's own axes: transposed rotation", ("tests/kinematics/test_angular_motion.py",),
    ),
    Fault(
        "parallel-hinges", "eomgen/kinematics/parallel.py",
        "total = angle if before is None else before + angle", "total = angle if before is None else before - angle",
        "angles of hinges in a row are subtracted", (PINOCCHIO, "tests/equations/test_resolved_axes.py"),
    ),
    Fault(
        "sum-of-turns", "eomgen/kinematics/turns.py",
        "start = substitute([angle], dict.fromkeys(q, graph.zero))[0]", "start = graph.zero",
        "the angle of a plane loop's cut joint lacks its constant part", ("tests/kinematics/test_turns.py",),
    ),
    Fault(
        "quotient-rule", "eomgen/graph/differentiate.py",
        "d = g.neg(mul(mul(i, g.div(one, b)), db))", "d = mul(mul(i, g.div(one, b)), db)",
        "forward derivative of c / x has the wrong sign", ("tests/graph/test_differentiate.py",),
    ),
    Fault(
        "reverse-subtraction", "eomgen/graph/differentiate.py",
        "adjoints[b] = sub(adjoints[b], w) if b in adjoints else g.neg(w)", "adjoints[b] = sub(adjoints[b], w) if b in adjoints else w",
        "reverse derivative of a - b by b has the wrong sign", ("tests/graph/test_differentiate.py",),
    ),
    Fault(
        "slope-acos", "eomgen/graph/slopes.py",
        '"acos": lambda g, y, a: g.neg(_asin_slope(g, a)),', '"acos": lambda g, y, a: _asin_slope(g, a),',
        "derivative of acos has the sign of asin's", ("tests/graph/test_differentiate.py",),
    ),
    Fault(
        "slope-half-power", "eomgen/graph/slopes.py",
        "power = g.make(\"pow\", c, g.constant(n - 1.0).id)", "power = g.make(\"pow\", c, g.constant(n - 0.0).id)",
        "derivative of c^n sqrt(c): wrong power", ("tests/graph/test_differentiate.py",),
    ),
    Fault(
        "slope-max", "eomgen/graph/slopes.py",
        'else g.make("le", b, a)), a, b', 'else g.make("le", a, b)), a, b',
        "derivative of max takes the branch not taken", ("tests/graph/test_differentiate.py",),
    ),
    Fault(
        "node-atan2", "eomgen/graph/slopes.py",
        "return [g.mul(b, r), g.neg(g.mul(a, r))]", "return [g.mul(a, r), g.neg(g.mul(b, r))]",
        "derivative of atan2: arguments swapped", ("tests/graph/test_differentiate.py",),
    ),
)  # fmt: skip
