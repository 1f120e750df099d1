"""Chain of n uniform rods hinged in a plane: python chain.py [n]; how the work grows with n."""

import sys
from time import perf_counter

import numpy as np

import eomgen as eg


def build(n: int) -> eg.Model:
    """A chain of n rods of 1 m and 1 kg that hangs from the ground, held out horizontally."""
    m = eg.Model(f"chain_{n}", gravity=(0, "-g", 0))
    m.parameter("g", 9.81)
    mass, length = m.parameter("m", 1.0, unit="kg"), m.parameter("l", 1.0, unit="m")
    previous = m.ground
    for k in range(1, n + 1):
        rod = m.body(f"rod{k}", mass=mass, com=(0, -length / 2, 0), inertia={"zz": mass * length**2 / 12})
        m.revolute(f"q{k}", previous, rod)
        previous = rod.marker("tip", at=(0, -length, 0))
    m.output("x", previous.position[0])
    m.output("y", previous.position[1])
    m.initial(q1=np.pi / 2)
    return m


def main() -> None:
    """Derive and compile, then let the chain fall."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    start = perf_counter()
    equations = build(n).derive()
    derived = perf_counter()
    module = equations.compile()
    compiled = perf_counter()
    run = module.simulate((0, 2), rtol=1e-10, atol=1e-12)
    done = perf_counter()
    print(equations)
    print(f"derive {derived - start:.3f} s, compile {compiled - derived:.3f} s, simulate {done - compiled:.3f} s")
    energy = np.array([sum(module.energy(x)) for x in run.x.T])
    kinetic = max(module.energy(x)[0] for x in run.x.T)
    print(f"{n} rods fell for 2 s: tip at ({run['x'][-1]:.4f}, {run['y'][-1]:.4f}) m", end=", ")
    print(f"energy kept to {np.ptp(energy) / kinetic:.1e}")


if __name__ == "__main__":
    main()
