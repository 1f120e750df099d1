"""Slider-crank and four-bar over a full turn against closed forms, to 1e-10 of each quantity's largest value.

Sources: textbook vector loops (Shabana, Computational Dynamics, ch. 3), checked here against the rows of
tests/reference/slider_crank_kinematics.json and four_bar_kinematics.json.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

OMEGA, ALPHA = 10.0, 3.0
TURN = np.linspace(0.0, 2 * np.pi, 73)

# a planar quantity as (value, rate, second rate), each (k,) or a number
Triple = tuple[Any, Any, Any]


def arm(length: float, angle: Triple, turn: float = 0.0) -> tuple[Triple, Triple]:
    """x and y of a vector that turns with an angle, with their derivatives."""
    f, w, a = angle
    c, s = np.cos(f + turn), np.sin(f + turn)
    return (length * c, -length * s * w, -length * (s * a + c * w**2)), (
        length * s,
        length * c * w,
        length * (c * a - s * w**2),
    )


def add(*parts: Triple) -> Triple:
    return tuple(sum(terms) for terms in zip(*parts, strict=True))  # type: ignore[return-value]


def crank_angle(theta: Any) -> Triple:
    ones = np.ones_like(theta)
    return theta, OMEGA * ones, ALPHA * ones


def slider_crank(crank: Triple, r: float, l: float, e: float = 0.0) -> dict[str, Triple]:
    """Rod angle b and slider x from r sin th + l sin b = e, x = r cos th + l cos b."""
    x, y = arm(r, crank)
    sine = [(e - y[0]) / l, -y[1] / l, -y[2] / l]
    b = np.arcsin(sine[0])
    w = sine[1] / np.cos(b)
    rod = (b, w, (sine[2] + np.sin(b) * w**2) / np.cos(b))
    along, up = arm(l, rod)
    return {"rod": rod, "s": add(x, along), "height": add(y, up), "pin_x": x, "pin_y": y}


def four_bar(crank: Triple, a1: float, a2: float, a3: float, a4: float) -> dict[str, Triple]:
    """Coupler and rocker angles of the open branch from the diagonal crank pin - rocker pivot, rates from the loop."""
    x, y = arm(a1, crank)
    dx, dy = a4 - x[0], -y[0]
    diagonal = np.hypot(dx, dy)
    coupler = np.arctan2(dy, dx) + np.arccos((a2**2 + diagonal**2 - a3**2) / (2 * a2 * diagonal))
    rocker = np.arctan2(y[0] + a2 * np.sin(coupler), x[0] + a2 * np.cos(coupler) - a4)
    # a2 e(c) w2 - a3 e(r) w3 = -x', with e the vector normal to each link, and its derivative
    matrix = np.array([[-a2 * np.sin(coupler), a3 * np.sin(rocker)], [a2 * np.cos(coupler), -a3 * np.cos(rocker)]])
    D = np.moveaxis(matrix, (0, 1), (-2, -1))

    def solved(right: np.ndarray) -> np.ndarray:
        return np.linalg.solve(D, np.moveaxis(right, 0, -1)[..., None])[..., 0].T

    w = solved(np.array([-x[1], -y[1]]))
    pull = np.array([-a2 * np.cos(coupler) * w[0] ** 2 + a3 * np.cos(rocker) * w[1] ** 2,
                     -a2 * np.sin(coupler) * w[0] ** 2 + a3 * np.sin(rocker) * w[1] ** 2])  # fmt: skip
    a = solved(np.array([-x[2], -y[2]]) - pull)
    return {"coupler": (coupler, w[0], a[0]), "rocker": (rocker, w[1], a[1]), "pin_x": x, "pin_y": y}


def close(ours: Any, theirs: Any, digits: float = 1e-10, angle: bool = False) -> None:
    """Equal to 1e-10 of the largest value; angles up to full turns."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    gap = ours - theirs
    if angle:
        gap = np.remainder(gap + np.pi, 2 * np.pi) - np.pi
    assert np.abs(gap).max() <= digits * np.abs(theirs).max()


def named(module: Any, motion: tuple[np.ndarray, np.ndarray, np.ndarray]) -> dict[str, Triple]:
    return {name: tuple(part[j] for part in motion) for j, name in enumerate(module.q_names)}  # type: ignore[misc]


# the closed forms themselves against the published rows


@pytest.mark.parametrize("case", ["inline", "offset"])
def test_slider_crank_formulas_equal_the_reference(case: str) -> None:
    given = models.reference("slider_crank_kinematics")["reference"][case]
    r, l, e = (float(given[key]) for key in "rle")
    for degrees, row in given["rows"].items():
        found = slider_crank(crank_angle(np.array([np.radians(float(degrees))])), r, l, e)
        for ours, names in ((found["s"], "x v a"), (found["rod"], "rod_angle rod_omega rod_alpha")):
            for value, name in zip(ours, names.split(), strict=True):
                assert abs(value[0] - float(row[name])) <= 1e-13 * max(1.0, abs(float(row[name])))


def test_four_bar_formulas_equal_the_reference() -> None:
    given = models.reference("four_bar_kinematics")["reference"]["crank_rocker_open"]
    lengths = [float(given[f"a{k}"]) for k in (1, 2, 3, 4)]
    u, v = map(float, given["coupler_point_local"])
    for degrees, row in given["rows"].items():
        found = four_bar(crank_angle(np.array([np.radians(float(degrees))])), *lengths)
        reach, turn = np.hypot(u, v), np.arctan2(v, u)
        x, y = arm(reach, found["coupler"], turn)
        found |= {"P_x": add(found["pin_x"], x), "P_y": add(found["pin_y"], y)}
        for name in ("coupler", "rocker", "P_x", "P_y"):
            for level in (0, 1, 2):
                gap = found[name][level][0] - float(row[name][level])
                if name in ("coupler", "rocker") and not level:
                    gap = np.remainder(gap + np.pi, 2 * np.pi) - np.pi
                assert abs(gap) <= 1e-13 * max(1.0, abs(float(row[name][level]))), (degrees, name, level)


# mod.kinematics: every body's angle and centre of mass, position to acceleration


def centre(module: Any, q: np.ndarray, body: str, at: tuple[float, float]) -> np.ndarray:
    """Ground x and y of a point of a body, from the module's poses."""
    pose = module.poses(q)[module.body_names.index(body)]
    return np.einsum("ijk,j->ik", pose[:2, :, :], np.array([*at, 0.0, 1.0]))


@pytest.mark.parametrize(("name", "case"), [("slider_crank", "inline"), ("offset_slider_crank", "offset")])
def test_slider_crank_over_a_full_turn(module: Callable[..., Any], name: str, case: str) -> None:
    given = models.reference("slider_crank_kinematics")["reference"][case]
    r, l, e = (float(given[key]) for key in "rle")
    mod = module(name).bind(p={"r": r, "l": l})
    full = mod.kinematics(*(np.array(part)[None, :] for part in crank_angle(TURN)))
    found, expected = named(mod, full), slider_crank(crank_angle(TURN), r, l, e)
    rod = add(found["theta"], found["B"])
    for level in range(3):
        close(found["theta"][level], crank_angle(TURN)[level])
        close(rod[level], expected["rod"][level])
        close(found["s"][level], expected["s"][level])
        # centres of mass: composed of the module's own angles, against the closed form's
        for axis in range(2):
            half_crank, half_rod = arm(r / 2, found["theta"])[axis], arm(l / 2, rod)[axis]
            pin = expected["pin_x"] if axis == 0 else expected["pin_y"]
            close(half_crank[level], pin[level] / 2)
            close(add(arm(r, found["theta"])[axis], half_rod)[level],
                  add(pin, arm(l / 2, expected["rod"])[axis])[level])  # fmt: skip
    half = arm(l / 2, expected["rod"])
    close(centre(mod, full[0], "crank", (r / 2, 0)), [expected["pin_x"][0] / 2, expected["pin_y"][0] / 2])
    close(centre(mod, full[0], "rod", (l / 2, 0)),
          [add(expected["pin_x"], half[0])[0], add(expected["pin_y"], half[1])[0]])  # fmt: skip
    close(centre(mod, full[0], "slider", (0, 0)), [expected["s"][0], np.full_like(TURN, e)])


def test_slider_position_as_independent_coordinate(module: Callable[..., Any]) -> None:
    """The same motion given by s, s', s'' between the dead centres, where s can move the mechanism."""
    r, l = 0.1, 0.35
    mod = module("slider_crank", independent=("s",))
    assert mod.minimal.q_names == ("s",)
    crank = crank_angle(np.linspace(0.25, np.pi - 0.25, 41))
    expected = slider_crank(crank, r, l)
    full = mod.kinematics(*(np.asarray(part)[None, :] for part in expected["s"]))
    found = named(mod, full)
    rod = add(found["theta"], found["B"])
    for level in range(3):
        close(found["s"][level], expected["s"][level])
        close(found["theta"][level], crank[level])
        close(rod[level], expected["rod"][level])


def test_four_bar_over_a_full_turn(module: Callable[..., Any]) -> None:
    lengths = (0.04, 0.12, 0.08, 0.10)
    mod = module("four_bar")
    full = mod.kinematics(*(np.array(part)[None, :] for part in crank_angle(TURN)))
    found, expected = named(mod, full), four_bar(crank_angle(TURN), *lengths)
    coupler = add(found["theta"], found["bend"])
    for level in range(3):
        close(found["theta"][level], crank_angle(TURN)[level])
        close(coupler[level], expected["coupler"][level], angle=not level)
        close(found["psi"][level], expected["rocker"][level], angle=not level)
    # places of every body's centre and of the coupler point, from poses
    for body, length, angle, base in (
        ("crank", lengths[0], crank_angle(TURN), None),
        ("coupler", lengths[1], expected["coupler"], "pin"),
        ("rocker", lengths[2], expected["rocker"], "ground"),
    ):
        x, y = (part[0] for part in arm(length / 2, angle))
        if base == "pin":
            x, y = x + expected["pin_x"][0], y + expected["pin_y"][0]
        close(centre(mod, full[0], body, (length / 2, 0)), [x + (lengths[3] if base == "ground" else 0.0), y])
    assert np.abs(full[0][:, -1] - full[0][:, 0] - 2 * np.pi * np.array(
        [name == "theta" for name in mod.q_names]) + 2 * np.pi * np.array(
        [name == "bend" for name in mod.q_names])).max() <= 1e-10  # fmt: skip


# the module's own velocities and accelerations of bodies: outputs, with the torque that gives the crank ALPHA


def centres_of_slider_crank() -> dict[str, tuple[Triple, Triple]]:
    r, l = 0.1, 0.35
    crank = crank_angle(TURN)
    found = slider_crank(crank, r, l)
    along, up = arm(l / 2, found["rod"])
    still = tuple(np.zeros_like(TURN) for _ in range(3))
    rod = add(found["pin_x"], along), add(found["pin_y"], up)
    return {"crank": arm(r / 2, crank), "rod": rod, "slider": (found["s"], still)}  # type: ignore[dict-item]


def centres_of_four_bar() -> dict[str, tuple[Triple, Triple]]:
    a1, a2, a3, a4 = 0.04, 0.12, 0.08, 0.10
    crank = crank_angle(TURN)
    found = four_bar(crank, a1, a2, a3, a4)
    along, up = arm(a2 / 2, found["coupler"])
    back, high = arm(a3 / 2, found["rocker"])
    coupler = add(found["pin_x"], along), add(found["pin_y"], up)
    return {"crank": arm(a1 / 2, crank), "coupler": coupler, "rocker": (add((a4, 0, 0), back), high)}


@pytest.mark.parametrize(
    ("name", "at", "expected"),
    [
        ("slider_crank", {"crank": "r/2", "rod": "l/2", "slider": 0}, centres_of_slider_crank),
        ("four_bar", {"crank": "a1/2", "coupler": "a2/2", "rocker": "a3/2"}, centres_of_four_bar),
    ],
)
def test_outputs_of_every_body_at_a_given_crank_acceleration(
    name: str, at: dict[str, Any], expected: Callable[[], dict[str, tuple[Triple, Triple]]]
) -> None:
    model = models.build(name)
    for body, x in at.items():
        marker = model.bodies[body].marker("center_of_mass", at=(x, 0, 0))
        for word, vector in (("p", marker.position), ("v", marker.velocity), ("a", marker.acceleration)):
            model.output(f"{body}_{word}x", vector[0])
            model.output(f"{body}_{word}y", vector[1])
    mod = model.compile(target="numpy")
    q, v, _ = mod.kinematics(TURN[None, :], np.full((1, TURN.size), OMEGA))
    here = mod.n_q + mod.q_names.index("theta")
    y = np.empty((mod.n_y, TURN.size))
    for k, state in enumerate(np.concatenate([q, v]).T):  # theta'' is linear in the torque
        coasting, pushed = (mod.rhs(0.0, state, u=[tau])[here] for tau in (0.0, 1.0))
        y[:, k] = mod.outputs(0.0, state, u=[(ALPHA - coasting) / (pushed - coasting)])
    for body, both in expected().items():
        for level, word in enumerate("pva"):
            size = max(np.abs(triple[level]).max() for triple in both)
            for axis, triple in zip("xy", both, strict=True):
                ours = y[mod.y_names.index(f"{body}_{word}{axis}")]
                assert np.abs(ours - triple[level]).max() <= 1e-10 * size, (body, word, axis)
