"""Carvallo-Whipple bicycle: canonical matrices, eigenvalues and stable speeds, then a ride."""

from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import eomgen as eg

MODEL = Path(__file__).with_name("bicycle.yaml")
STRAIGHT = dict.fromkeys(["x", "y", "yaw", "lean", "steer", "rear", "front", "lean_dot", "steer_dot"], 0.0)
G, RADIUS = 9.81, 0.3  # gravity, rear wheel
WEAVE, CAPSIZE = 4.292382536341104, 6.024262015388359  # m/s (Meijaard, Papadopoulos, Ruina and Schwab 2007)


def main() -> None:
    """Linearize the nonlinear model about straight rides, find where they are stable, and ride."""
    module = eg.load(MODEL).compile()

    def matrices(v: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return module.linearize(module.x0(STRAIGHT, rear_dot=-v / RADIUS)).second_order("lean", "steer")

    def eigenvalues(v: float) -> np.ndarray:
        M, C, K = matrices(v)
        zero, one = np.zeros((2, 2)), np.eye(2)
        return np.linalg.eigvals(np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))

    M, _, K = matrices(0.0)
    _, C1, K1 = matrices(1.0)
    print("M q'' + v C1 q' + (g K0 + v^2 K2) q = 0, q = (lean, steer)")
    for name, matrix in (("M", M), ("C1", C1), ("K0", K / G), ("K2", K1 - K)):
        print(f"{name:>3} {np.array2string(matrix, precision=14, suppress_small=True, prefix='    ')}")
    print("\n v m/s  eigenvalues 1/s")
    for v in range(11):
        found = sorted(eigenvalues(v), key=lambda z: (z.real, z.imag))
        print(f"{v:6}  " + "  ".join(f"{z.real:9.5f} {z.imag:+9.5f}j" for z in found))

    def growth_of_weave(v: float) -> float:
        return max(z.real for z in eigenvalues(v) if abs(z.imag) > 1e-3)

    weave = brentq(growth_of_weave, 3.0, 5.0, xtol=1e-13)
    capsize = brentq(lambda v: np.linalg.det(matrices(v)[2]), 5.0, 7.0, xtol=1e-13)
    print(f"\nstable from {weave:.10f} to {capsize:.10f} m/s,", end=" ")
    print(f"as in the paper: equal to {max(abs(weave - WEAVE), abs(capsize - CAPSIZE)):.1e}")

    push = STRAIGHT | {"lean_dot": 0.5, "rear_dot": -4.6 / RADIUS}
    run = module.simulate((0, 5), push, rtol=1e-10, atol=1e-12)
    energy = np.array([sum(module.energy(x)) for x in run.x.T])
    leans = np.rad2deg(run["lean"])
    print(f"pushed at 4.6 m/s it leans {leans.max():.2f} degrees, {leans[-1]:.2f} after 5 s;", end=" ")
    print(f"energy kept to {np.ptp(energy) / energy[0]:.1e}")


if __name__ == "__main__":
    main()
