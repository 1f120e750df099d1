"""Stage emit: Program -> the driver files a C source needs, and where each keeps its numbers in the work array."""

from __future__ import annotations

from ..program import Block, Program
from ..program.block_groups import ALONG, SHIFTS
from ..program.loop_slopes import BY_BODIES
from .held_states import held_areas
from .pair_statements import kept_of
from .pair_sums_used import sums_again

CLOSE = ("scaled", "cholesky", "residual_sizes", "correct", "project", "close")
PIVOT = ("eliminate", "pivots", "partition")
ACCELERATE = (*CLOSE, *PIVOT, "embed", "ldl", "accelerate")
SOLVE = ("system_balance", "system_factor", "system_substitute", "system_solve")
DERIVE = ("correct_change", "jacobian_projection", "jacobian")
#: from states on both sides of a change point
PASSING = ("passing_curve", "passing_points", "passing", "passing_search")

FORMED = {"terms", "gamma"}  #: blocks of M, h, C_q, gamma

LOOPS: dict[str, tuple[str, ...]] = {
    "project": (*CLOSE, "is_closed", "project_drive"),
    "embedded_mass_matrix": ("scaled", *PIVOT, "embed", "mass"),
    "kinematics": ("scaled", *PIVOT, "embed", "kinematics", "kinematics_drive"),
    "outputs": (*CLOSE, "outputs_closed"),
}

TREES: dict[str, tuple[str, ...]] = {
    "rhs": ("tree", "tree_accelerate", "tree_rhs"),
    "outputs": ("tree", "tree_accelerate", "tree_outputs"),
}


COLUMNS: dict[str, tuple[str, ...]] = {
    "jacobian": ("columns_jacobian",),
    "mass_matrix": ("mass_by_columns", "columns_mass_drive"),
    "embedded_mass_matrix": ("mass_by_columns", "columns_mass_embedded"),
}


def shift_files(program: Program, name: str, direct: str) -> tuple[str, ...]:
    """The files of a derivative by inputs or parameters."""
    if program.tree_by_columns:
        return ("shift_columns", name)
    if not program.has_loops:
        return ("tree", "tree_accelerate", "shift_tree", name)
    return (*ACCELERATE, "multipliers", direct, "correct_change", "shift_projection", "shift_loops", name)


def passes(program: Program) -> bool:
    """Whether the right-hand side is taken from both sides of a change point where it is next to one."""
    return program.has_loops and program.projects and not program.given_rates


def rhs_files(program: Program) -> tuple[str, ...]:
    """The files of the right-hand side of a mechanism with loops, but for its driver."""
    if "system" in program.block_names:
        here: tuple[str, ...] = (*CLOSE, *PIVOT, "embed", *SOLVE, "weakest", "system_rhs_here")
    else:
        direct = (straight_file(program), "rhs_here_direct") if "dynamics" in program.block_names else ("rhs_here",)
        here = (*ACCELERATE, *(("weakest",) if passes(program) or direct[0] != "rhs_here" else ()), *direct)
    return (*here, *(PASSING if passes(program) else ()))


def straight_file(program: Program) -> str:
    """The file that calls the blocks of straight-line code of loops."""
    return "straight_regular" if "regular_dynamics" in program.block_names else "straight_usual"


def space_file(program: Program) -> str:
    """The file that says how coordinates move with velocities."""
    if program.given_rates:
        return "space_given"
    return "space_quaternions" if program.quaternion_slots or program.n_states else "space_plain"


def derive_files(program: Program) -> tuple[str, ...]:
    """The files of the Jacobian of a mechanism with loops, but for its driver."""
    return (*DERIVE, "jacobian_bodies" if BY_BODIES[0] in program.block_names else "jacobian_here")


def driver_files(program: Program) -> list[str]:
    """Names of the files in templates/c/drivers that hold this program's drivers, callees first."""
    direct = "residuals_along" if "residual_tangent" in program.block_names else "residuals_direct"
    files: dict[str, None] = {}
    if "mass_times" in program.block_names:
        files["mass_by_columns"] = None
    if program.composes_terms:
        files |= {"terms": None, "terms_loops" if program.has_loops else "terms_tree": None}
    if program.drivers:
        space = space_file(program)
        further = (f"{space}_more",) if program.has_loops or space == "space_plain" else ()
        files.update(dict.fromkeys((space, *further)))
    for driver in program.drivers:
        if driver.name in ALONG:
            needed: tuple[str, ...] = (driver.name,)
        elif driver.name in SHIFTS:
            needed = shift_files(program, driver.name, direct)
        elif passes(program) and driver.name in ("rhs", "project", "outputs", "jacobian"):
            needed = _passing_files(program, driver.name, direct)
        elif "system" in driver.blocks:
            needed = _system_files(program, driver.name, direct)
        elif driver.name == "mass_matrix" or (program.tree_by_columns and "terms" not in driver.blocks):
            needed = COLUMNS[driver.name]
        elif not program.has_loops and driver.name == "jacobian":
            along = (direct, "tree_jacobian_along") if direct == "residuals_along" else ("tree_jacobian",)
            needed = ("tree", "tree_accelerate", *along)
            if program.held is not None:
                needed = ("tree", direct, "tree_jacobian_held")
        elif not program.has_loops:
            needed = TREES[driver.name]
        elif driver.name == "rhs":
            needed = (*rhs_files(program), "rhs")
        elif driver.name == "jacobian":
            needed = (*rhs_files(program), "multipliers", direct, *derive_files(program), "jacobian_plain")
        elif driver.name == "outputs" and FORMED.intersection(driver.blocks):
            needed = (*ACCELERATE, "outputs_accelerated")
        else:
            needed = LOOPS[driver.name]
        files.update(dict.fromkeys(needed))
    normal = ("correct_change", "normal") if program.given_rates and program.sizes.n_h else ()
    return list(dict.fromkeys(file for name in files for file in (*(normal if name == "project" else ()), name)))


def _passing_files(program: Program, name: str, direct: str) -> tuple[str, ...]:
    """Files of a driver of :func:`passes`."""
    accelerates = {"system", *FORMED} & {block for d in program.drivers if d.name == name for block in d.blocks}
    if name == "jacobian":
        return (*rhs_files(program), *ACCELERATE, "multipliers", direct, *derive_files(program), "jacobian_passing")
    if name == "project":
        rates = any(d.name == "rhs" for d in program.drivers)
        near = "nearness_direct" if "dynamics" in program.block_names else "nearness"
        across = (*rhs_files(program), "rhs_across", near, "project_passing")
        return (*CLOSE, "is_closed", *(across if rates else ("project_drive",)))
    if name == "outputs" and not accelerates:
        return LOOPS[name]
    return (*rhs_files(program), "rhs_across", f"{name}_passing")


def _system_files(program: Program, name: str, direct: str) -> tuple[str, ...]:
    """Files of a driver that solves the linear system of a method."""
    if name == "jacobian":
        return (*SOLVE, direct, "system_jacobian")
    if program.has_loops and (program.projects or name == "outputs"):
        return (*rhs_files(program), "rhs") if name == "rhs" else (*CLOSE, *SOLVE, "system_outputs_closed")
    return (*SOLVE, f"system_{name}_given")


def passing_areas(program: Program) -> list[tuple[str, int]]:
    """Areas of :data:`PASSING`."""
    if not passes(program):
        return []
    n_q, n, f = program.sizes.n_q, program.sizes.n_v, program.sizes.n_dof
    values = 2 * (n_q + n)
    return [
        ("STATE", n_q + n),  # q, v in the middle
        ("NEXT", values),  # q, v, x' at a point
        ("TANGENT", n * f),
        ("INVERSE", f * (f + n)),
        ("HEADING", f),
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
    """Areas of ``jacobian_bodies``; the first five follow one upon the other."""
    known = next((b.n_in for b in program.blocks if b.name == BY_BODIES[1]), None)
    if known is None:
        return []
    n_q, n, f = program.sizes.n_q, program.sizes.n_v, program.sizes.n_dof
    again = sums_again(program)
    return [
        ("SLOPES", n + 2),  # v, whether sound, whether far
        ("COEFFICIENTS", known - n_q),
        ("TURNING", max(n_q, n)),  # a direction of q or of v
        ("MET", len(again)),  # of each sum over pairs how many are near, 0 before they are looked for
        ("SHAPES", sum(kept_of(one.function) for one in again)),  # these pairs
        ("CHANGE", n_q + n),  # of q' and v'
        ("SPAN", 2 * f * (n_q + n)),
        ("SHARES", f * f),
    ]


def places_again(program: Program, block: Block) -> dict[str, str]:
    """Where blocks along a direction keep near pairs, by name of the sum: in w behind what they read, x."""
    again = sums_again(program) if block.name in BY_BODIES[1:] else []
    if not again:
        return {}
    known = next(b.n_in for b in program.blocks if b.name == BY_BODIES[1]) - program.sizes.n_q
    count = known + max(program.sizes.n_q, program.sizes.n_v)
    found, at = {}, count + len(again)
    for k, function in enumerate(one.function for one in again):
        found[function.name] = f"w + (x - w) + {count + k}, w + (x - w) + {at}"
        at += kept_of(function)
    return found


def work_areas(program: Program, blocks: int) -> tuple[list[tuple[str, int, int]], int]:
    """Areas of the work array.

    Parameters
    ----------
    program : Program
    blocks : int
        Doubles at the start of the work array that blocks use.

    Returns
    -------
    areas : list of (name, start, length)
    total : int
        Length of the work array.
    """
    if not program.drivers:
        return [], blocks
    n, m, f = program.sizes.n_v, program.sizes.n_c, program.sizes.n_dof
    n_q, h = program.sizes.n_q, program.sizes.n_h
    names = program.block_names
    residual = (n + m) * (n_q + n) + m * n_q if "residual_jacobian" in names else 0
    shifted = {SHIFTS[d.name] for d in program.drivers if d.name in SHIFTS}
    seeds = max((program.sizes.n_u if what == "input" else program.sizes.n_p for what in shifted), default=0)
    matrix = n if program.held is None or program.composes_terms else n - program.n_states
    loads = len(program.held.loads) if program.held is not None else 0
    lengths = [
        ("X", n_q + 2 * n + m + max(n_q + n, seeds, loads)),  # q, v, a, multipliers, dq, dv; du, dp or loads in place
        ("SCALES", n + m),
        ("TERMS", matrix * (matrix + 1) // 2 + n + m * n + m),  # M packed, h, C_q, gamma
        ("RESIDUAL", residual),  # r1_q, r1_v, r2_q, r2_v, r3_q
        ("ALONG", n + 2 * m),  # r1, r2, r3 along a direction
        ("RATES", n_q),
        ("SHIFT", h + n + 2 * m if shifted else 0),  # C, r1, r2, r3 along du or dp
    ]
    if program.composes_terms or "mass_times" in names:
        lengths.append(("FULL", n * n))
    if "mass_times" in names:
        lengths.append(("UNIT", n_q + 2 * n))  # q, a, M a
    if program.has_loops:
        if program.given_rates:
            lengths += [("GRADIENT", h * n_q), ("NORMAL", m * m), ("MENDED", n_q)]  # dC/dq, its products, a change of q
        lengths += [
            ("POSITION", h + m * n),  # C, C_q
            ("RATE", m),
            ("J", m * n),
            ("G", m * m),
            ("GH", m * m if h < m else 0),  # of the holonomic rows alone
            ("E", 2 * m),
            ("STEP", n),
            ("ROWS", m * (n + 1 + m)),
            ("B", n * f),
            ("MASS", n * n),
            ("MB", n * f),
            ("EMBEDDED", f * f),
            ("H", n),
            ("A", n),
            ("Y", f),
            *passing_areas(program),
            ("CLOSING", n + 3 if "closing" in names else 0),
            ("DYNAMICS", 2 * n + 2 if "dynamics" in names else 0),
        ]
    if "system" in names and program.system is not None:
        size, places = len(program.system.unknowns), len(program.system.places)
        lengths += [
            ("SYSTEM", places + 3 * size),  # entries of K, r, sizes of equations and of unknowns
            ("LU", size * size),
            ("ROW", size),  # scales
            ("COLUMN", size),
            ("DEFECT", 2 * size),
            ("MOTION", n_q + n + size),  # q, v, z
        ]
    if "dae_tangent" in names:
        lengths += [("DAE", 4 * program.sizes.n_dae), ("SLOPE", program.sizes.n_dae)]  # y, y', dy, dy'; dF
    lengths += _areas_of_bodies(program)
    lengths += held_areas(program)
    if "inverse_tangent" in names:
        lengths.append(("TORQUES", 2 * (n_q + 2 * n) + n))  # q, v, a, dq, dv, da; d(M a + h)
    areas, start = [], max(blocks, 1)  # never where w itself points: blocks get w and an area
    for name, length in lengths:
        areas.append((name, start, length))
        start += length or 1  # two areas never share a place
    return areas, start
