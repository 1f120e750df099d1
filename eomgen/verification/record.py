"""Stage verification, record: Program -> the figures that its exported package is tested by, wherever it is built."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .cases import SPREAD
from .rounding_sizes import bounded

if TYPE_CHECKING:
    from ..program.program import Program

STATES = 2
#: Straight-line kernels with figures; what drivers compute is judged by identities.
KERNELS = (
    "mass_matrix", "bias", "inverse_dynamics", "energy", "poses", "constraints", "constraint_jacobian",
    "velocity_constraints", "motion_outputs", "centroidal",
)  # fmt: skip
SEED = 20


def record(program: Program) -> str:
    """The text of ``selftest.json``.

    States are random, on no constraints, which straight-line kernels do not ask for; figures are those of the graph in
    double arithmetic, ``bound`` twice the bound of their rounding.
    """
    rng, sizes = np.random.default_rng(SEED), program.sizes
    metadata = program.metadata
    reference = np.array(metadata.get("q_reference") or np.zeros(sizes.n_q), dtype=float)
    values = np.array([0.0 if x is None else x for x in metadata["p_values"]], dtype=float)
    inputs = np.array([0.0 if x is None else x for x in metadata["u_values"]], dtype=float)
    states: list[dict[str, Any]] = []
    for _ in range(STATES):
        states.append(
            {
                "t": rng.uniform(),
                "q": reference + 0.3 * rng.standard_normal(sizes.n_q),
                "v": rng.standard_normal(sizes.n_v),
                "a": rng.standard_normal(sizes.n_v),
                "p": values * (1.0 + SPREAD * rng.uniform(-1.0, 1.0, sizes.n_p)),
                "u": inputs + rng.standard_normal(sizes.n_u),
            }
        )
    symbols = {program.time: np.array([s["t"] for s in states])}
    for names, key in (
        (program.parameters, "p"),
        (program.inputs, "u"),
        (program.coordinates, "q"),
        (program.velocities, "v"),
    ):
        symbols |= {name: np.array([s[key][k] for s in states]) for k, name in enumerate(names)}
    figures = _figures(program, symbols, states)
    plain = [{key: value if np.ndim(value) == 0 else value.tolist() for key, value in s.items()} for s in states]
    return json.dumps({"name": program.name, "states": plain, "kernels": figures}, separators=(",", ":")) + "\n"


def _figures(program: Program, symbols: Mapping[str, Any], states: list[dict[str, Any]]) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for block in program.blocks:
        if block.name not in KERNELS or not block.public or not block.outputs:
            continue
        own = dict(symbols)
        for port in block.ports:
            if port.name == "a":
                own |= {name: np.array([s["a"][k] for s in states]) for k, name in enumerate(port.symbols)}
        try:
            values, bounds = bounded(block.outputs, own, STATES)
        except ModelError:  # it calls C code that nothing else can evaluate
            continue
        if np.isfinite(values).all() and np.isfinite(bounds).all():
            figures[block.name] = [
                {"values": values[:, k].tolist(), "bound": 2.0 * float(bounds[:, k].max())} for k in range(STATES)
            ]
    return figures
