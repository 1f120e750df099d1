"""Published models in few lines, by the elements that they need: a gait model and an arm with muscles."""

from typing import Any

import models
import numpy as np
import pytest
from sweeps import TARGETS

import eomgen as eg


# -- Short models ------------------------------------------------------------------------------------------------------
def gait(p: dict[str, float]) -> eg.Model:
    m = eg.Model("gait", gravity=(0, -9.81, 0))
    for name, value in p.items():
        m.parameter(name, value)
    trunk = m.body("trunk", mass="TrunkMass", com=(0, "TrunkCMy", 0), inertia={"zz": "TrunkInertia"})
    m.planar("hip", m.ground, trunk, coordinates=("q1", "q2", "q3"))
    feet, k = [trunk.marker("com", at=(0, "TrunkCMy", 0)), trunk], 4
    for side in ("right", "left"):
        above, at = trunk, 0
        for name in ("Thigh", "Shank", "Foot"):
            com = ("FootCMx" if name == "Foot" else 0, f"{name}CMy", 0)
            body = m.body(f"{side}{name}", mass=f"{name}Mass", com=com, inertia={"zz": f"{name}Inertia"})
            m.torque(f"M{k}", m.revolute(f"q{k}", above.at(0, at, 0), body), m.input(f"T{k}"))
            above, at, k = body, f"-{name}Len", k + 1
            feet += [body] * (name != "Thigh")
        feet += [body.marker(part.lower(), at=(f"Contact{part}X", "ContactY", 0)) for part in ("Heel", "Toe")]
    m.force("push", feet[0], value=(m.input("Fx"), m.input("Fy"), 0))
    m.torque("turn", trunk, value=(0, 0, m.input("T3")))
    for k, foot in enumerate(feet):
        y = f"y({foot.label})"
        m.output(f"N{k}", f"(ContactStiff*max(0, -{y})**3 - {y})*(1 - ContactDamp*vy({foot.label}))")
        m.force(f"floor{k}", foot, value=(f"-ContactFric*N{k}*tanh(vx({foot.label})/(2*ContactV0))", f"N{k}", 0))
    return m


def arm(p: dict[str, Any]) -> eg.Model:
    m = eg.Model("arm", gravity=(0, 0, p["g"]), check_inertia="note")
    thin = {name: p[f"m{name}"] * p[f"l{name}"] ** 2 for name in "ACD"}  # the tutorial's rods have l^2 / 2 along
    A, C, D = (
        m.body(
            n,
            mass=p[f"m{n}"],
            com=(0, 0, 0 if n == "A" else p[f"l{n}"] / 2),
            inertia=[I / (2 if k == (n != "A") + 1 else 12) for k in range(3)],
        )
        for n, I in thin.items()
    )
    B = m.body("B", mass=0)
    m.revolute("q1", m.ground.at(p["dx"], 0, 0), A, coordinate="q1")
    m.revolute("q2", m.ground.at(0, p["dy"], p["dz"]), B, axis="y", coordinate="q2")
    m.revolute("q3", B, C, coordinate="q3")
    m.revolute("q4", C.at(0, 0, p["lC"]), D, axis="y", coordinate="q4")
    m.spherical("hand", A.at(0, p["lA"], 0), D.at(0, 0, p["lD"]))
    m.torsional_element("grip", "q1", law=f"-{p['k']}*angle - {p['c']}*rate")
    drum = {"around": C.at(0, 0, p["lC"], rpy=(-np.pi / 2, 0, 0)), "radius": p["r"], "sense": "positive"}
    for name, via in (("biceps", []), ("triceps", [drum])):
        own = dict(zip(("force_max", "fiber_length", "slack_length"), p[name].values(), strict=True))
        m.muscle(
            name, C.at(0, 0, p["lC"] / 3), D.at(0, 0, p["lD"] / 3), excitation=m.input(f"e_{name}"), via=via, **own
        )
    return m


@pytest.mark.parametrize("target", TARGETS)
def test_gait(target: str) -> None:
    """Accelerations and the ground's forces of Autolev's code, with all contacts and inputs."""
    given = models.reference("gait2d_autolev")
    mod = gait(given["parameters_SI"]).compile(target=target)
    for case in given["cases"]:
        names = ["Fx", "Fy", "T3", *(f"T{k}" for k in range(4, 10))]
        x = mod.x0(
            **{f"q{k + 1}": q for k, q in enumerate(case["q"])}, **{f"q{k + 1}_dot": v for k, v in enumerate(case["u"])}
        )
        inputs = dict(zip(names, case["inputs"], strict=True))
        rates = dict(zip(mod.v_names, mod.rhs(0.0, x, u=[inputs[n] for n in mod.u_names])[9:], strict=True))
        found = [rates[f"q{k}_dot"] for k in range(1, 10)]
        assert found == pytest.approx(case["qdd_autolev"], rel=1e-12, abs=1e-11)
        y = dict(zip(mod.y_names, mod.outputs(0.0, x), strict=True))
        right, left = y["N4"] + y["N5"], y["N8"] + y["N9"]
        assert [right, left] == pytest.approx([case["grf_autolev"][k] for k in (1, 4)], rel=1e-12)


def test_arm() -> None:
    """The consistent accelerations; activation follows its excitation by the published rate."""
    given = models.reference("muscle_lever_sympy")
    m = arm(given["parameters_SI"])
    q = {f"q{k + 1}": value for k, value in enumerate(given["own"]["q0"])}
    m.guess(**q)
    mod = m.compile(target="numpy")
    rates = dict(zip(mod.x_names, mod.rhs(0.0, mod.x0(**q)), strict=True))
    assert [rates[f"q{k}_dot"] for k in range(1, 5)] == pytest.approx(given["own"]["qdd0"], rel=1e-7)
    x = mod.x0(**q, biceps_activation=0.3, triceps_activation=0.1)
    e = {"e_biceps": 0.8, "e_triceps": 0.05}
    rates = dict(zip(mod.x_names, mod.rhs(0.0, x, u=[e[n] for n in mod.u_names]), strict=True))

    def published(e: float, a: float) -> float:
        h = np.tanh(10 * (e - a)) / 2
        return float(((0.5 + h) / (0.015 * (0.5 + 1.5 * a)) + (0.5 + 1.5 * a) * (0.5 - h) / 0.06) * (e - a))

    found = [rates["biceps_activation"], rates["triceps_activation"]]
    assert found == pytest.approx([published(0.8, 0.3), published(0.05, 0.1)], rel=1e-13)
