"""Names: one that is not known -> those that were probably meant; parts of dotted names; places of markers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

LONGEST = 64  #: characters of a name

#: What other programs and textbooks call it -> what eomgen does, of which those are suggested that there are.
SYNONYMS = {
    # elements of a model (MuJoCo, Simscape, Modelica, Adams, PyDy, Pinocchio, textbooks)
    "hinge pin rotary rotational rotation pivot bearing axle crank_pin": "revolute",
    "slider slide translational sliding translation linear": "prismatic translational",
    "telescope telescoping telescopic piston ram jack": "prismatic",
    "ball socket ball_and_socket gimbal": "spherical", "cardan hooke u_joint": "universal",
    "fixed rigid lock bolted glue glued attach solder rigid_transform fixed_translation fixed_rotation rigidly": "weld",
    "helical lead_screw leadscrew ball_screw": "screw",
    "floating six_dof free6 freeflyer freejoint bushing_free": "free", "cv rzeppa": "constant_velocity",
    "rod strut two_force_member": "distance", "connect point_to_point": "spherical",
    "pin_slot pin_in_slot": "inline point_on_curve", "cartesian gantry xyz": "translational",
    "dashpot shock viscous shock_absorber": "damper torsional_damper", "dry_friction coulomb stiction": "friction",
    "rope cable tendon wire string": "spring belt muscle", "elastic coil spring_damper": "spring",
    "rotational_spring spiral_spring": "torsional_spring", "rotational_damper": "torsional_damper",
    "limit bump endstop bumper hard_stop end_stop": "stop",
    "contact collision": "sphere_plane point_plane stop contacts",
    "thruster load sforce external_force single_component_force": "force", "moment couple": "torque",
    "motor motion servo": "driver actuator torque", "hydraulic_cylinder cylinder_actuator pneumatic": "actuator",
    "gravitation attraction inverse_square": "point_gravity", "wheel roll rolling_contact": "rolling",
    "skate nonholonomic": "knife_edge", "pulley chain_drive timing_belt": "belt", "pinion rack_and_pinion": "rack",
    "epicyclic sun_planet differential": "planetary", "gears gear_pair gearbox": "gear planetary constraints",
    "follower": "cam cam_contact", "mimic equality ratio": "coupling", "rheonomic prescribed drive": "driver",
    "link rigid_body part particle point_mass mass_point segment": "body",
    "frame site connector reference_frame port": "marker", "joint": "coordinate", "dof": "coordinate independent",
    "world earth fixed_frame fixed_base": "ground", "variable state_variable": "state input parameter",
    "sensor observable probe measurement measure": "output", "control signal": "input", "include import_model": "add",
    # functions of expressions
    "ln": "log", "arctan": "atan", "arcsin": "asin", "arccos": "acos", "arctan2": "atan2", "radians": "deg",
    "sgn signum": "sign", "power pow": "sqrt exp", "step_function theta_function": "heaviside", "ifelse iff": "where",
    "normal normal_force contact_force tension": "force", "penetration extension elongation": "length",
    # sections and keys of a model file
    "links parts rigid_bodies segments particles": "bodies", "hinges connections": "joints",
    "constants": "parameters", "controls signals": "inputs", "sensors observables measurements probes": "outputs",
    "springs dampers loads force_elements actuators motors": "forces", "loops closures couplings": "constraints",
    "ic initial_conditions initial_values start": "initial", "dofs generalized_coordinates": "independent",
    "settings solver_settings": "simulation", "g_vector acceleration_of_gravity": "gravity",
    "description comment": "doc", "constant": "parameter", "param params": "parameter parameters set",
    "parameters": "parameter set", "weight": "mass", "cog cg center_of_gravity centre_of_mass": "com center_of_mass",
    "inertia_tensor moment_of_inertia moments_of_inertia inertial": "inertia",
    "visual visuals geometry geom shape graphics": "display", "parent child connects connect_bodies": "between",
    "spring_constant spring_rate": "stiffness", "damping_coefficient damping_constant": "damping",
    "free_length natural_length rest_length unstretched_length": "length", "direction": "axis",
    # runs and their arguments
    "t_end tend stop_time end_time duration t_final tstop time": "end t", "dt timestep time_step step_size": "step",
    "tol tolerance reltol": "rtol", "abstol": "atol", "integrator": "method solver", "tspan t_span": "span",
    "y0 x0": "initial", "args": "parameters", "teval times": "t_eval", "guesses": "guess",
    # what a Module and a Trajectory have
    "simulate integrate solve play run odeint solve_ivp forward_simulation sim": "simulate run compile",
    "mass inertia_matrix crba M generalized_mass_matrix": "mass_matrix mass",
    "nle nonlinear_effects coriolis": "bias", "com": "center_of_mass",
    "rnea id": "inverse inverse_dynamics driving_forces", "aba fd forward_dynamics ode odefun f": "rhs",
    "ik inverse_kinematics": "assemble kinematics x0", "fk forward_kinematics": "poses kinematics",
    "eig eigenvalues eigenmodes frequencies modal natural_frequencies": "modes",
    "linearise lin state_space ss": "linearize", "statics static trim steady_state": "equilibrium",
    "sweep batch monte_carlo montecarlo ensemble": "simulate_many ensemble", "set_parameters with_values": "bind",
    "initial_state": "x0", "nq": "n_q", "nv": "n_v", "nu": "n_u", "validate lint": "check verify", "test": "verify",
    "ts": "t", "y states sol": "x", "positions": "q", "velocities qd qdot": "v", "dataframe df": "to_pandas",
    "interpolate sample": "at", "write dump to_csv": "save", "export": "generate save", "keys": "names",
    "success": "status", "energy": "energies", "eom equations_of_motion equations": "derive",
    "potential": "V potential_energy", "kinetic": "T kinetic_energy", "L": "lagrangian", "H": "hamiltonian",
    "forcing": "force", "latex": "explain", "output_names outputs_names": "y_names", "input_names": "u_names",
    "parameter_names": "p_names", "state_names": "x_names", "coordinate_names": "q_names",
    # pictures, verbs and options
    "animate animation movie video gif film": "animate draw view",
    "show view picture render display": "draw plot view", "draw sketch": "check", "plot graph": "run plot",
    "gui": "view", "build codegen": "generate compile", "demo gallery list": "examples",
    "new init create": "examples", "import": "convert", "info print describe": "check", "report": "explain check",
    "clean clear": "cache", "install": "doctor", "inverse_dynamics": "inverse driving_forces",
    "sensitivities gradient": "sensitivity sensitivities", "output save": "out", "figure": "plot",
}  # fmt: skip
_MEANT: dict[str, list[str]] = {}
for _words, _meant in SYNONYMS.items():
    for _word in _words.split():
        _MEANT.setdefault(_word, []).extend(_meant.split())
MOST = 2000  #: names beyond which a comparison with each takes long
SURE = 0.8  #: likeness of a misspelt word of SYNONYMS
LIKE = 0.6  #: and of a misspelt name
BEFORE, AFTER = ("add_", "new_", "create_", "make_", "set_", "get_"), ("_joint", "_constraint", "_element")


def closest(name: object, known: Iterable[str], most: int = 1) -> list[str]:
    """At most so many of the known names, the likeliest first: of another word for it, of its case, of its spelling.

    Parameters
    ----------
    name : object
        As it was given.
    known : iterable of str
    most : int

    Returns
    -------
    list of str
    """
    from difflib import get_close_matches  # only needed once something is wrong

    word, options = str(name), list(dict.fromkeys(known))
    folded = {option.lower(): option for option in options}
    for form in _forms(word):
        if form in folded:
            return [folded[form]]
        meant = [other for other in _MEANT.get(form, ()) if other in options]
        if meant:
            return meant[:most]
    if len(options) > MOST:
        return []
    near = get_close_matches(word, options, n=most, cutoff=LIKE)
    likely = get_close_matches(word.lower(), [w for w, them in _MEANT.items() if {*them} & {*options}], 1, SURE)
    if likely and (not near or _likeness(word, near[0]) < _likeness(word, likely[0])):
        near = [other for other in _MEANT[likely[0]] if other in options]
    return near[:most]


def _forms(word: str) -> list[str]:
    """The word as it is, in small letters, and without what other programs write before and behind: PinJoint -> pin."""
    from re import sub

    small = sub(r"(?<=[a-z])(?=[A-Z])", "_", word).lower().replace("-", "_")
    bare = small
    for part in BEFORE:
        bare = bare.removeprefix(part)
    for part in AFTER:
        bare = bare.removesuffix(part)
    return list(dict.fromkeys([word, word.lower(), small, bare]))


def _likeness(word: str, other: str) -> float:
    from difflib import SequenceMatcher

    return SequenceMatcher(None, other, word).ratio()


def hint(name: object, known: Iterable[str], quoted: bool = True) -> str:
    """``"did you mean 'theta'?"`` if a known name is near, else an empty text."""
    near = closest(name, known)
    return "" if not near else f"did you mean {near[0]!r}?" if quoted else f"did you mean {near[0]}?"


def joined(*parts: str, by: str = "; ") -> str:
    """The parts that are not empty."""
    return by.join(part for part in parts if part)


# -- names of instances: ``leg1.hip``, as people write it, -> ``leg1_hip``, as the model has it ------------------------


def undotted(name: str, instances: Mapping[str, str]) -> str:
    """A name whose first part is an instance: its prefix and the rest, instances within instances too.

    Parameters
    ----------
    name : str
        Such as ``leg1.hip``, or ``leg1.shin.end`` of a marker.
    instances : mapping of str to str
        Name of an instance -> its prefix.
    """
    head, _, rest = name.partition(".")
    while rest and head in instances:
        name = instances[head] + rest
        head, _, rest = name.partition(".")
    return name


# -- place and velocity of a marker, in ground axes: ``x(rod.tip)`` and ``vx(rod.tip)`` --------------------------------


_PLACE = re.compile(r"(v?[xyz])\((\w+(?:\.\w+)*)\)")


def place_of_marker(name: object) -> tuple[str, str] | None:
    """``x`` or ``vx`` and the marker of a name such as ``x(rod.tip)``; None for other names."""
    found = _PLACE.fullmatch(name.replace(" ", "")) if isinstance(name, str) else None
    return (found[1], found[2]) if found else None
