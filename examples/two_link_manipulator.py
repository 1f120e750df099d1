"""Two-link manipulator: equations and the end effector's motion (Shabana, 1.4)."""

import numpy as np
import sympy

import eomgen as eg


def build() -> eg.Model:
    """Two links; the elbow's coordinate is the angle between them, th3 the book's absolute angle."""
    m = eg.Model("two_link_manipulator", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    l2, l3 = m.parameter("l2", 0.5, unit="m"), m.parameter("l3", 0.4, unit="m")
    c2, c3 = m.parameter("c2", 0.25, unit="m"), m.parameter("c3", 0.2, unit="m")
    m2, m3 = m.parameter("m2", 2.0, unit="kg"), m.parameter("m3", 1.5, unit="kg")
    I2, I3 = m.parameter("I2", 0.042), m.parameter("I3", 0.02)
    link2 = m.body("link2", mass=m2, com=(c2, 0, 0), inertia={"zz": I2})
    link3 = m.body("link3", mass=m3, com=(c3, 0, 0), inertia={"zz": I3})
    tip = link3.marker("tip", at=(l3, 0, 0))
    shoulder = m.revolute("shoulder", m.ground, link2, coordinate="th2")
    elbow = m.revolute("elbow", link2.at(l2, 0, 0), link3, coordinate="bend")
    m.torque("motor2", shoulder, m.input("tau2"))
    m.torque("motor3", elbow, m.input("tau3"))
    m.output("th3", shoulder.coordinate + elbow.coordinate)
    for name, vector in {"r": tip.position, "v": tip.velocity, "a": tip.acceleration}.items():
        m.output(f"{name}_x", vector[0])
        m.output(f"{name}_y", vector[1])
    return m


def main() -> None:
    """Print the equations, then let the arm fall and compare the tip's acceleration with eq. (1.3) of the book."""
    equations = build().derive()
    sympy.pprint(equations.mass_matrix.applyfunc(sympy.simplify), use_unicode=False, wrap_line=False)
    for name, force in zip(equations.independent, equations.force, strict=True):
        print(f"force along {name}:", sympy.simplify(force))
    module = equations.compile()
    run = module.simulate((0, 2), initial={"th2": 0.5, "bend": -0.8}, rtol=1e-10, atol=1e-12)

    l2, l3 = 0.5, 0.4
    rates = np.array([module.rhs(t, x) for t, x in zip(run.t, run.x.T, strict=True)]).T
    th2, th3 = run["th2"], run["th3"]
    w2, w3 = run["th2_dot"], run["th2_dot"] + run["bend_dot"]
    a2, a3 = rates[2], rates[2] + rates[3]
    a_x = -a2 * l2 * np.sin(th2) - a3 * l3 * np.sin(th3) - w2**2 * l2 * np.cos(th2) - w3**2 * l3 * np.cos(th3)
    print(f"tip acceleration against the book: {np.abs(run['a_x'] - a_x).max():.1e} m/s^2 of {np.abs(a_x).max():.1f}")


if __name__ == "__main__":
    main()
