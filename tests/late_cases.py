"""Every number of an element that is judged: an entry with a number in it, one that is allowed, and some that are not.

``"@"`` stands for the number.  The place is where the fault is told, from the entry on.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Judged(NamedTuple):
    """One number of one element."""

    section: str
    entry: dict[str, Any]
    place: str  #: of the fault, behind the name of the entry
    good: float
    bad: tuple[float, ...]

    def __str__(self) -> str:
        kind = self.entry.get("type", self.entry.get("shape", self.section))
        return f"{self.section} {kind} {self.place}"


ON = {"between": ["ground", "a"]}
PAIR = {"between": ["a", "b"]}
LAW = {"stiffness": 1e4}
RUB = {"friction": 0.3, "smoothing": 0.01}
LUGRE = {"friction_law": "lugre", "friction": 0.3, "bristle_stiffness": 1e3, "bristle_damping": 10.0}
BROWN = {"friction_law": "brown_mcphee", "friction": 0.3, "transition": 0.01}
SPHERES = {"type": "sphere_sphere", **PAIR, "radii": [0.1, 0.1], "normal_law": "hertz"}
PULL = {"type": "muscle", "between": ["a", "b"], "force_max": 900.0, "fiber_length": 0.1, "slack_length": 0.2}
TYRE = {"type": "tyre", **ON, "radius": 0.3, "stiffness": 2e5, "relaxation": [0.3, 0.2]}
BRUSH = {**TYRE, "law": "brush", "slip_stiffness": 8e4, "friction": 1.0}
CREEP = {"type": "creep", **ON, "radius": 0.5, "longitudinal": 1e6, "lateral": 1e6}
FLOOR = {"shape": "half_plane", "on": "ground"}
SPACE = {"shape": "half_space", "on": "ground"}
DISC = {"shape": "circle", "on": "a", "radius": 0.1}
PLATE = {"shape": "plate", "on": "a", "length": 0.2, "width": 0.1, "points": 2}
SOIL = {"soil": "dry_sand", "shear_modulus": 0.02}
RACK = {"shape": "sprocket", "on": "ground", "teeth": 9, "pitch": 0.1, "seat": 0.03, "tip_radius": 0.17}
REACT = {"type": "friction", "joint": "ja", "coefficient": 0.1, "radius": 0.02, "smoothing": 0.01}
NOT_POSITIVE, NEGATIVE = (0.0, -1.5), (-1.5,)


def force(place: str, good: float, bad: tuple[float, ...], **entry: Any) -> Judged:
    return Judged("forces", entry, place, good, bad)


def shape(place: str, good: float, bad: tuple[float, ...], **given: Any) -> Judged:
    """A shape of a contact; ground is met by it if it is on ``a``, a disc of ``a`` if it is on the ground."""
    other = DISC if given["on"] == "ground" else SPACE if given["shape"] in ("ellipsoid", "cuboid") else FLOOR
    law = SOIL if given["shape"] == "plate" else LAW
    entry = {"type": "contacts", "first": [given], "second": [other], **law}
    return Judged("forces", entry, f"first[0].{place}", good, bad)


def contacts(place: str, good: float, bad: tuple[float, ...], **keys: Any) -> Judged:
    first = PLATE if "soil" in keys else DISC
    law = keys if "soil" in keys or "moduli" in keys or "normal_law" in keys else LAW | keys
    return Judged("forces", {"type": "contacts", "first": [first], "second": [FLOOR], **law}, place, good, bad)


CASES: tuple[Judged, ...] = (
    # normal laws
    *(
        force("stiffness", 1e4, NOT_POSITIVE, **one, stiffness="@")
        for one in (
            {"type": "point_plane", **ON},
            {"type": "sphere_plane", **ON, "radius": 0.1},
            {"type": "sphere_sphere", **PAIR, "radii": [0.1, 0.1]},
            {"type": "stop", "joint": "ja", "upper": 1.0},
        )
    ),
    contacts("stiffness", 1e4, NOT_POSITIVE, stiffness="@"),
    contacts("stiffness", 1e4, NOT_POSITIVE, normal_law="linear", stiffness="@"),
    contacts("damping", 0.0, NEGATIVE, normal_law="linear", stiffness=1e4, damping="@"),
    contacts("exponent", 1.0, (0.5, -1.0), exponent="@"),
    contacts("dissipation", 0.0, NEGATIVE, dissipation="@"),
    contacts("restitution", 1.0, (0.0, -0.1, 1.2), restitution="@", velocity=1.0),
    contacts("velocity", 0.1, NOT_POSITIVE, restitution=0.5, velocity="@"),
    force("moduli[1]", 1e9, NOT_POSITIVE, **SPHERES, moduli=[1e9, "@"], poisson=[0.3, 0.3]),
    force("poisson[0]", 0.5, (-1.0, 0.6), **SPHERES, moduli=[1e9, 1e9], poisson=["@", 0.3]),
    contacts("friction", 0.0, NEGATIVE, normal_law="rigid", friction="@"),
    contacts("restitution", 1.0, (-0.5, 1.5), normal_law="rigid", restitution="@"),
    # friction
    contacts("friction", 0.0, NEGATIVE, **RUB | {"friction": "@"}),
    contacts("smoothing", 0.1, NOT_POSITIVE, **RUB | {"smoothing": "@"}),
    contacts("static_friction", 0.3, (0.2, -0.1), **RUB, static_friction="@", stribeck=0.1),
    contacts("stribeck", 0.1, NOT_POSITIVE, **RUB, static_friction=0.4, stribeck="@"),
    contacts("transition", 0.1, NOT_POSITIVE, **BROWN | {"transition": "@"}),
    contacts("static_friction", 0.3, (0.2, -0.1), **BROWN, static_friction="@"),
    contacts("friction", 0.1, NOT_POSITIVE, **LUGRE | {"friction": "@"}),
    contacts("bristle_stiffness", 1.0, NOT_POSITIVE, **LUGRE | {"bristle_stiffness": "@"}),
    contacts("bristle_damping", 1.0, NOT_POSITIVE, **LUGRE | {"bristle_damping": "@"}),
    contacts("static_friction", 0.3, (0.2, -0.1), **LUGRE, static_friction="@", stribeck=0.1),
    contacts("viscous_friction", 0.0, NEGATIVE, **RUB, viscous_friction="@"),
    contacts("viscous_friction", 0.1, NEGATIVE, **LUGRE, viscous_friction="@"),
    force("viscous", 0.0, NEGATIVE, type="friction", joint="ja", viscous="@"),
    force("viscous", 0.1, NEGATIVE, type="friction", joint="ja", viscous="@", coulomb=1.0, smoothing=0.1),
    force("viscous", 0.1, NEGATIVE, **REACT, viscous="@"),
    force("coulomb", 0.0, NEGATIVE, type="friction", joint="ja", coulomb="@", smoothing=0.1),
    force("static", 1.0, (0.9, -0.1), type="friction", joint="ja", coulomb=1.0, smoothing=1.0, static="@", stribeck=1),
    *(
        force(key, 0.1, bad, **{**REACT, key: "@", **more})
        for key, bad, more in (
            ("coefficient", NEGATIVE, {}),
            ("radius", NOT_POSITIVE, {}),
            ("thrust_radius", NOT_POSITIVE, {}),
            ("smoothing", NOT_POSITIVE, {}),
            ("coulomb", NEGATIVE, {}),
            ("static_coefficient", NEGATIVE, {"stribeck": 0.1}),
            ("stribeck", NOT_POSITIVE, {"static_coefficient": 0.2}),
            ("static", NEGATIVE, {"coulomb": 0.1, "stribeck": 0.1}),
        )
    ),
    # single contacts, stops, other forces
    force("radius", 0.1, NOT_POSITIVE, type="sphere_plane", **ON, radius="@", **LAW),
    force("radii[1]", 0.0, NEGATIVE, type="sphere_sphere", **PAIR, radii=[0.1, "@"], **LAW),
    force(
        "radii[0]", 0.1, NOT_POSITIVE, type="sphere_sphere", **PAIR, radii=["@", 0.1], normal_law="hertz",
        moduli=[1e9, 1e9], poisson=[0.3, 0.3],
    ),
    force("upper", 1.0, (0.2, 0.1), type="stop", joint="ja", lower=0.2, upper="@", **LAW),
    force("mu", 1.0, NOT_POSITIVE, type="point_gravity", center="ground", body="a", mu="@"),
    *(
        force(f"via[0].{key}", 0.1, bad, type="spring", stiffness=1.0, between=["a", "b"],
              via=[{"around": "ground", "radius": 0.1, "friction": 0.2, "smoothing": 0.1} | {key: "@"}])
        for key, bad in (("radius", NOT_POSITIVE), ("friction", NEGATIVE), ("smoothing", NOT_POSITIVE))
    ),
    force("stiffness[1][0]", 2.0, (1.0, 3.0), type="bushing", **PAIR, stiffness=[
        [9.0, 2.0, 0, 0, 0, 0], ["@", 9.0, 0, 0, 0, 0], *([0] * k + [9.0] + [0] * (5 - k) for k in range(2, 6))
    ]),
    *(force(key, 0.2, NOT_POSITIVE, **{**PULL, "activation": 0.5, key: "@"})
      for key in ("force_max", "fiber_length", "slack_length", "velocity_max")),
    *(force(key, 0.2, NOT_POSITIVE, **{**PULL, "excitation": 0.5, key: "@"})
      for key in ("activation_time", "deactivation_time")),
    force("activation", 1.0, (-0.1, 1.1), **PULL, activation="@"),
    force("excitation", 0.0, (-0.1, 1.1), **PULL, excitation="@"),
    force("pennation", 0.3, (1.6, -1.6), **PULL, activation=0.5, pennation="@"),
    *(force(key, 0.2, bad, **{**CREEP, key: "@"})
      for key, bad in (("radius", NOT_POSITIVE), ("longitudinal", NEGATIVE), ("lateral", NEGATIVE))),
    force("friction", 0.0, NEGATIVE, **CREEP, creep_law="polach", normal=1e4, friction="@"),
    *(force(key, 0.2, bad, **{**BRUSH, key: "@"}) for key, bad in (
        ("radius", NOT_POSITIVE), ("stiffness", NOT_POSITIVE), ("rolling_radius", NOT_POSITIVE),
        ("damping", NEGATIVE), ("settling", NEGATIVE), ("reversal", NOT_POSITIVE), ("slip_stiffness", NOT_POSITIVE),
        ("friction", NOT_POSITIVE), ("half_length", NOT_POSITIVE),
    )),
    force("relaxation[1]", 0.1, NOT_POSITIVE, **{**TYRE, "relaxation": [0.1, "@"]}, law="magic_formula"),
    force("friction", 0.1, NOT_POSITIVE, **TYRE, law="magic_formula", friction="@"),
    # soil
    *(contacts(key, 0.4, bad, **{**SOIL, key: "@"}) for key, bad in (
        ("cohesive_modulus", NEGATIVE), ("frictional_modulus", NEGATIVE), ("cohesion", NEGATIVE),
        ("sinkage_exponent", NOT_POSITIVE), ("shear_modulus", NOT_POSITIVE), ("friction_angle", (-0.1, 1.6)),
        ("contact_width", NOT_POSITIVE), ("recovery", NOT_POSITIVE), ("dissipation", NEGATIVE),
        ("rebound", (0.0, 1.1)), ("unloading_stiffness", NEGATIVE), ("unloading_rise", NEGATIVE),
    )),
    contacts("frictional_modulus", 1.0, (0.0,), **SOIL | {"cohesive_modulus": 0.0, "frictional_modulus": "@"}),
    *(Judged("forces", {"type": "contacts", "first": [{**DISC, "width": 0.2}], "second": [FLOOR], **SOIL, **keys},
             place, 0.3, bad)
      for keys, place, bad in (
          ({"peak_angle": ["@", 0.3]}, "peak_angle[0]", (0.0, 1.1)),
          ({"peak_angle": [0.4, "@"]}, "peak_angle[1]", NEGATIVE),
          ({"reversal": "@"}, "reversal", NOT_POSITIVE),
      )),
    Judged("forces", {"type": "contacts", "first": [{**DISC, "width": 0.2}],
                      "second": [{"shape": "bed", "on": "ground", "length": 1, "cells": 4}], **SOIL, "settling": "@"},
           "settling", 0.3, NOT_POSITIVE),
    # shapes
    shape("radius", 0.1, NOT_POSITIVE, shape="circle", on="a", radius="@"),
    shape("length", 0.1, NOT_POSITIVE, shape="segment", on="a", length="@"),
    shape("radius", 0.1, NEGATIVE, shape="segment", on="a", length=0.2, radius="@"),
    shape("size[1]", 0.1, NOT_POSITIVE, shape="box", on="a", size=[0.1, "@"]),
    shape("length", 0.1, NOT_POSITIVE, **{**PLATE, "length": "@"}),
    shape("width", 0.1, NOT_POSITIVE, **{**PLATE, "width": "@"}),
    shape("semi_axes[2]", 0.1, NOT_POSITIVE, shape="ellipsoid", on="a", semi_axes=[0.1, 0.2, "@"]),
    shape("size[0]", 0.1, NOT_POSITIVE, shape="cuboid", on="a", size=["@", 0.2, 0.1]),
    shape("edge_radius", 0.02, (*NOT_POSITIVE, 0.06), shape="cuboid", on="a", size=[0.3, 0.2, 0.1], edge_radius="@"),
    shape("points[1]", 0.5, (0.0, -1.0), shape="profile", on="ground", points=[[0, 0], ["@", 0], [1, 0]]),
    shape("points[2]", 0.8, (0.5, 0.2), shape="smooth_profile", on="ground", points=[[0, 0], [0.5, 0], ["@", 0]]),
    shape("depth", 0.1, NOT_POSITIVE, shape="profile", on="ground", points=[[0, 0], [1, 0]], depth="@"),
    shape("points", 1.2, (0.9, 0.5), shape="polygon", on="a", points=[[0, 0], [1, 0], [1, 1], [0.5, "@"], [0, 1]]),
    shape("points[1]", 0.5, (0.0,), shape="polygon", on="a", points=[[0, 0], [1, 0], [2, "@"], [0, 1]]),
    shape("points", 1.0, (-1.0,), shape="outline", on="ground", depth=0.1,
          points=[[0, 0], [2, 0], [2, "@"], [0, 1]]),
    shape("depth", 0.1, NOT_POSITIVE, shape="outline", on="ground", points=[[0, 0], [1, 0], [0, 1]], depth="@"),
    *(shape(key, good, bad, **{**RACK, key: "@"}) for key, good, bad in (
        ("pitch", 0.1, NOT_POSITIVE), ("seat", 0.03, (0.0, -0.1, 0.06)), ("tip_radius", 0.17, (0.0, -0.1, 0.1, 0.4)),
        ("seat_angle", 2.2, (0.0, 3.2)), ("depth", 0.1, NOT_POSITIVE),
    )),
    Judged("forces", {"type": "contacts", "first": [{"shape": "segment", "on": "a", "length": 0.2, "radius": "@"}],
                      "second": [{"shape": "box", "on": "b", "size": [0.1, 0.1]}], **LAW}, "first", 0.1, (0.0,)),
    # constraints
    Judged("constraints", {"type": "gear", "joints": ["ja", "jb"], "radii": ["@", 0.1]}, "radii[0]", 0.2, NOT_POSITIVE),
    Judged("constraints", {"type": "belt", "joints": ["ja", "jb"], "radii": [0.1, "@"]}, "radii[1]", 0.2, NOT_POSITIVE),
    Judged("constraints", {"type": "gear", "joints": ["ja", "jb"], "cones": [0.4, "@"]}, "cones[1]", 0.2, NOT_POSITIVE),
    Judged("constraints", {"type": "planetary", "sun": "ja", "carrier": "jb", "radii": {"sun": 0.1, "ring": "@"}},
           "radii.ring", 0.3, NOT_POSITIVE),
    Judged("constraints", {"type": "planetary", "sun": "ja", "carrier": "jb", "radii": {"sun": 0.1, "ring": "@"}},
           "radii", 0.3, (0.05,)),
    Judged("constraints", {"type": "planetary", "sun": "ja", "carrier": "jb",
                           "radii": {"sun": 0.1, "ring": 0.3, "planet": "@"}}, "radii", 0.1, (0.2,)),
    *(Judged("constraints", {"type": "rolling", "wheel": "c", "plane": "ground", **keys}, place, 0.2, NOT_POSITIVE)
      for keys, place in (
          ({"shape": "sphere", "radius": "@"}, "radius"),
          ({"shape": "disc", "radius": "@"}, "radius"),
          ({"shape": "ellipsoid", "semi_axes": [0.3, "@", 0.2]}, "semi_axes[1]"),
      )),
    Judged("constraints", {"type": "rolling", "wheel": "c", "plane": "ground", "shape": "convex",
                           "support": "sqrt(nx**2 + ny**2 + @*nz**2)"}, "support", 0.5, (-0.5,)),
    Judged("constraints", {"type": "cam_contact", "cam": "a", "follower": "b", "shape": "roller",
                           "contour": "1 + 0.1*sin(theta)", "radius": "@"}, "radius", 0.1, NOT_POSITIVE),
    Judged("constraints", {"type": "cam", "cam": "ja", "follower": "jb", "lift": "0.1*sin(@*theta)"}, "lift", 2.0,
           (1.3,)),
    # joints
    Judged("joints", {"type": "distance", **PAIR, "length": "@"}, "length", 0.2, NOT_POSITIVE),
    Judged("joints", {"type": "revolute_spherical", **PAIR, "length": "@"}, "length", 0.2, NOT_POSITIVE),
    Judged("joints", {"type": "screw", "between": ["ground", "d"], "pitch": "@"}, "pitch", -0.2, (0.0,)),
    Judged("joints", {"type": "revolute", "between": ["ground", "d"], "armature": "@"}, "armature", 0.0, NEGATIVE),
    Judged("joints", {"type": "revolute", "between": [
        {"body": "ground", "matrix": [["@", 0, 0], [0, "@", 0], [0, 0, 1]]}, "d"]},
        "between[0].matrix", 1.0, (0.9, 2.0)),
    # bodies
    Judged("bodies", {"mass": "@"}, "mass", 0.0, NEGATIVE),
    Judged("bodies", {"mass": 1, "inertia": ["@", 1, 1]}, "inertia", 1.5, (-1.0, 2.5)),
    *(Judged("bodies", {"solids": [{"type": kind, "mass": 1.0, **keys}]}, f"solids[0].{place}", 0.1, bad)
      for kind, keys, place, bad in (
          ("sphere", {"radius": "@"}, "radius", NEGATIVE),
          ("box", {"size": [0.1, "@", 0.1]}, "size", NEGATIVE),
          ("tube", {"inner_radius": "@", "outer_radius": 0.2, "length": 1.0}, "inner_radius", (0.3, -1.0)),
      )),
    # states
    Judged("states", {"sampled": "a", "period": "@"}, "period", 0.1, NOT_POSITIVE),
)  # fmt: skip
