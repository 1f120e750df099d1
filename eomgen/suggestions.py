"""A name that is not known -> the names that were probably meant."""

from __future__ import annotations

from collections.abc import Iterable

#: What other programs and textbooks call it -> what eomgen does, of which those are suggested that there are.
SYNONYMS = {
    "hinge pin rotary rotational": "revolute", "slider translational sliding": "prismatic",
    "ball ball_joint socket": "spherical", "fixed rigid lock bolted": "weld", "cardan hooke": "universal",
    "helical": "screw", "floating six_dof free6": "free", "cv rzeppa": "constant_velocity", "rod strut": "distance",
    "parameters param constant": "parameter parameters", "motor motion servo": "driver actuator torque",
    "dashpot shock viscous": "damper torsional_damper", "dry_friction coulomb": "friction",
    "rope cable tendon wire": "spring belt muscle", "elastic coil": "spring", "rotational_spring": "torsional_spring",
    "rotational_damper": "torsional_damper", "limit bump endstop bumper": "stop",
    "contact collision": "sphere_plane point_plane stop", "wheel roll": "rolling", "skate": "knife_edge",
    "pulley": "belt", "link rigid_body part": "body", "frame site": "marker",
    "simulate integrate solve play": "run compile", "animate animation movie video gif film": "draw view",
    "show view picture": "draw plot view", "draw sketch": "check", "eigenvalues eigenmodes frequencies": "modes",
    "linearise": "linearize", "ensemble sweep batch monte_carlo montecarlo": "simulate_many ensemble",
    "plot graph": "run", "statics static trim": "equilibrium", "validate lint": "check",
    "build codegen export": "generate compile", "inverse_dynamics id": "inverse driving_forces",
    "com": "center_of_mass", "forward_dynamics": "rhs", "M": "mass_matrix", "joint": "coordinate",
    "point_mass particle": "body",
}  # fmt: skip
_MEANT = {word: meant.split() for words, meant in SYNONYMS.items() for word in words.split()}
MOST = 2000  #: names beyond which a comparison with each takes long


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
    meant = [other for other in _MEANT.get(word, _MEANT.get(word.lower(), ())) if other in options]
    if meant or len(options) > MOST:
        return meant[:most]
    folded = {option.lower(): option for option in options}
    same = folded.get(word.lower())
    return [same] if same is not None else get_close_matches(word, options, n=most, cutoff=0.6)


def hint(name: object, known: Iterable[str], quoted: bool = True) -> str:
    """``"did you mean 'theta'?"`` if a known name is near, else an empty text."""
    near = closest(name, known)
    return "" if not near else f"did you mean {near[0]!r}?" if quoted else f"did you mean {near[0]}?"


def joined(*parts: str, by: str = "; ") -> str:
    """The parts that are not empty."""
    return by.join(part for part in parts if part)
