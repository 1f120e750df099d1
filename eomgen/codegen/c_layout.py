"""Program -> the table of a model that the solvers (eomgen/native) read, and areas of its work memory."""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import accumulate
from typing import Any

from ..toolchain.layer import SOLVER_HEADERS, read_header
from .pair_sums import contact_areas, kept_of, sums_again
from .program import BY_BODIES, SHIFTS, Block, Program


def is_straight(program: Program) -> bool:
    """Whether the right-hand side of loops is straight-line code, which the model compiles with its own sizes."""
    return "dynamics" in program.block_names and any(d.name == "rhs" for d in program.drivers)


def crosses_singular(program: Program) -> bool:
    """Whether the right-hand side is taken from both sides of a singular position where it is next to one."""
    return program.has_loops and program.projects and not program.general_rates


def describe_equations(
    program: Program,
    areas: list[tuple[str, int, int]],
    linked: Collection[str] = (),
    private: Collection[str] = (),
) -> dict[str, Any]:
    """The entries of ``eom_model`` in its order: numbers, tables, starts of areas, functions; each with a comment.

    ``linked`` are the functions that lie in another file, ``private`` those that the model's own code calls alone.
    """
    header = read_header(SOLVER_HEADERS[0])
    starts = {name: start for name, start, _ in areas}
    used = {name for driver in program.drivers for name in driver.blocks}
    sizes, metadata = program.sizes, program.metadata
    others = [i for i in range(sizes.n_v) if i not in program.preferred]
    known = metadata.get("row_velocities") or [range(sizes.n_v - program.n_states)] * sizes.n_c
    system = program.system if "system" in program.block_names else None
    numbers = {
        "velocities, coordinates, rows of constraints, holonomic ones":
            (sizes.n_v, sizes.n_q, sizes.n_c, sizes.n_h),
        "rank, degrees of freedom, inputs, parameters":
            (sizes.n_v - sizes.n_dof, sizes.n_dof, sizes.n_u, sizes.n_p),
        "velocities before states; whether inertias may be negative, states are projected":
            (sizes.n_v - program.n_states, int(bool(metadata.get("indefinite"))), int(program.projects)),
        "whether singular positions are crossed, by project too; whether outputs need accelerations":
            (int(crosses_singular(program)),
             int(crosses_singular(program) and any(d.name == "rhs" for d in program.drivers)),
             int(bool(metadata["output_accelerations"]))),
        "Euler parameters; unknowns, entries and relaxed ones of the linear system":
            (len(program.quaternion_slots), len(system.unknowns) if system else 0, len(system.places) if system else 0,
             len(system.relaxed) if system else 0),
    }  # fmt: skip
    tables = {
        "ORDER": [*program.preferred, *others],
        "PREFERRED_DEPENDENT": [int(i in others) for i in range(sizes.n_v)],
        "ROW_GROUP": list(metadata.get("row_groups") or [0] * sizes.n_c),
        "ROW_START": list(accumulate(map(len, known), initial=0)),
        "ROW_VELOCITY": [k for row in known for k in row],
        "PARENT": list(program.parent),
        "COORDINATE": list(program.coordinate_of),
    }
    return {
        "numbers": [(", ".join(map(str, values)), comment) for comment, values in numbers.items()],
        "tables": tables,
        "areas": [starts.get(name, 0) for name in re.findall(r"^    AREA_(\w+),", header, re.MULTILINE)],
        "functions": [
            f"{program.name}_{name}_block"
            if name in linked
            else f"{name}_block"
            if name in used.difference(private) and name in program.block_names
            else "NULL"
            for name in re.findall(r"eomgen_function (\w+);", header)
        ],
    }


def _singular_areas(program: Program) -> list[tuple[str, int]]:
    """Areas of the curve through a singular position."""
    if not crosses_singular(program):
        return []
    n_q, n, f = program.sizes.n_q, program.sizes.n_v, program.sizes.n_dof
    values = 2 * (n_q + n)
    return [
        ("STATE", n_q + n),
        ("NEXT", values),
        ("TANGENT", n * f),
        ("INVERSE", f * (f + n)),
        ("HEADING", 2 * f),
        ("DIRECTION", n),
        ("AWAY", n_q + n),
        ("POINTS", 10 * n_q),
        ("SUMS", 4 * values),
        ("BEST", values),
        ("KEPT", n_q + n),
        ("RATED", n_q + n),
        ("TURN", (n_q + n) ** 2 if "jacobian" in {d.name for d in program.drivers} else 0),
    ]


def _areas_of_bodies(program: Program) -> list[tuple[str, int]]:
    """Areas of the Jacobian by bodies; the first five follow one upon the other."""
    known = next((b.n_in for b in program.blocks if b.name == BY_BODIES[1]), None)
    if known is None:
        return []
    n_q, n, f = program.sizes.n_q, program.sizes.n_v, program.sizes.n_dof
    again = sums_again(program)
    return [
        ("SLOPES", n + 2),
        ("COEFFICIENTS", known - n_q),
        ("TURNING", max(n_q, n)),
        ("MET", len(again)),
        ("SHAPES", sum(kept_of(one.function) for one in again)),
        ("CHANGE", n_q + n),
        ("SPAN", 2 * f * (n_q + n)),
        ("SHARES", f * f),
    ]


def places_again(program: Program, block: Block) -> dict[str, str]:
    """Where blocks along a direction keep near pairs, by name of the sum: in w behind what they read, x."""
    again = sums_again(program) if block.name in BY_BODIES[1:] else []
    if not again:
        return {}
    lengths = dict(_areas_of_bodies(program))
    count = lengths["COEFFICIENTS"] + lengths["TURNING"]
    result, at = {}, count + len(again)
    for k, function in enumerate(one.function for one in again):
        result[function.name] = f"w + (x - w) + {count + k}, w + (x - w) + {at}"
        at += kept_of(function)
    return result


def work_areas(program: Program, blocks: int) -> tuple[list[tuple[str, int, int]], int]:
    """Name, start and length of the areas of the work array, as eomgen_solvers.h has them, and its length.

    ``blocks``: doubles at its start that blocks use.
    """
    if not program.drivers:
        return [], blocks
    n, m, f = program.sizes.n_v, program.sizes.n_c, program.sizes.n_dof
    n_q, h = program.sizes.n_q, program.sizes.n_h
    names = program.block_names
    residual = (n + m) * (n_q + n) + m * n_q if "residual_jacobian" in names else 0
    shifted = {SHIFTS[d.name] for d in program.drivers if d.name in SHIFTS}
    seeds = max((program.sizes.n_u if what == "input" else program.sizes.n_p for what in shifted), default=0)
    matrix = n if program.contacts is None or program.composes_terms else n - program.n_states
    loads = len(program.contacts.loads) if program.contacts is not None else 0
    lengths = [
        ("X", n_q + 2 * n + m + max(n_q + n, seeds, loads)),
        ("SCALES", n + m),
        ("TERMS", matrix * (matrix + 1) // 2 + n + m * n + m),
        ("RESIDUAL", residual),
        ("ALONG", n + 2 * m),
        ("RATES", n_q),
        ("SHIFT", h + n + 2 * m if shifted else 0),
        ("DIAGONAL", n),
        ("MARKS", n_q + n),
    ]
    if program.composes_terms or "mass_times" in names:
        lengths.append(("FULL", n * n))
    if "mass_times" in names:
        lengths.append(("UNIT", n_q + 2 * n))
    if program.has_loops:
        if program.general_rates:
            lengths += [("GRADIENT", h * n_q), ("NORMAL", m * m), ("MENDED", n_q + m + n)]
        lengths += [
            ("POSITION", h + m * n),
            ("RATE", m),
            ("J", m * n),
            ("G", m * m),
            ("GH", m * m if h < m else 0),
            ("E", 2 * m),
            ("NOISE", m),
            ("STEP", n),
            ("ROWS", m * (n + 1 + m)),
            ("PARTITION", 1 + 3 * n),
            ("PIVOTING", 6 * m + 1 + n),
            ("B", n * f),
            ("MASS", n * n),
            ("MB", n * f),
            ("EMBEDDED", f * f),
            ("H", n),
            ("A", n),
            ("Y", f),
            *_singular_areas(program),
            ("CLOSING", n + 3 if "closing" in names else 0),
            ("DYNAMICS", 2 * n + 2 if "dynamics" in names else 0),
        ]
    if "system" in names and program.system is not None:
        size, places = len(program.system.unknowns), len(program.system.places)
        lengths += [
            ("SYSTEM", places + 3 * size),
            ("LU", size * size),
            ("ROW", size),
            ("COLUMN", size),
            ("DEFECT", 2 * size),
            ("PLAN", 3 * size),
            ("MOTION", n_q + n + size),
        ]
    if "dae_tangent" in names:
        lengths += [("DAE", 4 * program.sizes.n_dae), ("SLOPE", program.sizes.n_dae)]
    lengths += _areas_of_bodies(program)
    lengths += contact_areas(program)
    if "inverse_tangent" in names:
        lengths.append(("TORQUES", 2 * (n_q + 2 * n) + n))
    areas, start = [], max(blocks, 1)  # never where w itself points: blocks get w and an area
    for name, length in lengths:
        areas.append((name, start, length))
        start += length or 1  # two areas never share a place
    return areas, start
