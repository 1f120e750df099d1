"""What templates/fmu/fmu_model.h.j2 is rendered with: sizes, start values, events and how the model is integrated."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from ...base.limits import runs
from ...program import Program
from ..sources import number_texts
from .variables import coordinate_of, find_exact

_METHODS = ("DOP853", "RK45", "Radau")  #: those that co-simulation can run; DOP853 stands for others
_NO_LIMIT = 1e300  #: (s) of a step


def run_settings(program: Program) -> dict[str, Any]:
    """How the model is run where nothing is said: method, rtol, atol, end, perhaps max_step."""
    declared = {k: v for k, v in program.metadata.get("simulation", {}).items() if v is not None}
    return {"method": "DOP853", "rtol": runs.RTOL, "atol": runs.ATOL, "end": 10.0, **declared}


def model_context(program: Program, start: Sequence[float], token: str) -> dict[str, Any]:
    """What the header is rendered with."""
    metadata, settings = program.metadata, run_settings(program)
    atol = settings["atol"]
    free = _free(program)
    return {
        "name": program.name,
        "token": token,
        "method": settings["method"] if settings["method"] in _METHODS else "DOP853",
        "rtol": repr(float(settings["rtol"])),
        "atol": repr(float(min(atol) if isinstance(atol, list) else atol)),
        "max_step": repr(float(settings.get("max_step") or _NO_LIMIT)),
        "switches": _switches(program, free),
        "numbers": _numbers(program, len(free)),
        "tables": [
            ("START_X", number_texts(start)),
            ("START_U", number_texts(metadata["u_values"])),
            ("START_P", number_texts(metadata["p_values"])),
            ("NOMINAL", number_texts(_nominal(program))),
        ],
        "lists": _lists(program, free),
    }


def _free(program: Program) -> list[int]:
    """The velocities whose coordinates the others follow, where loops are closed by holding these."""
    sizes = program.sizes
    follows = sizes.n_h > 0 and sizes.n_h == sizes.n_c and "kinematics" in {k.name for k in program.kernels}
    return list(program.preferred) if follows else []


def _switches(program: Program, free: Sequence[int]) -> list[tuple[str, int]]:
    """Numbers that the preprocessor decides by."""
    sizes, kernels = program.sizes, {k.name for k in program.kernels}
    follows = sizes.n_h > 0 and sizes.n_h == sizes.n_c and "kinematics" in kernels
    return [
        ("CO_SIMULATION", 1),
        ("HAS_OUTPUTS", int(sizes.n_y > 0)),
        ("HAS_JACOBIAN", int("jacobian" in kernels)),
        ("HAS_MEETING_TIME", int("meeting_time" in kernels)),
        ("HAS_PROJECT", int("project" in kernels)),
        ("HAS_KINEMATICS", int(follows)),
        ("N_EVENTS", sizes.n_events),
        ("N_RESETS", sizes.n_resets),
        ("N_CLOCKS", len(program.metadata.get("clocks", []))),
        ("N_U", sizes.n_u),
        ("N_P", sizes.n_p),
    ]


def _numbers(program: Program, n_free: int) -> list[tuple[str, int | str]]:
    """Sizes of the model and of the instance's work."""
    sizes, prefix = program.sizes, program.name.upper()
    width = sizes.n_x + sizes.n_v + sizes.n_u + sizes.n_p
    values = max(sizes.n_y + max(sizes.n_p + sizes.n_u, sizes.n_events), 3 * sizes.n_events)
    trial = max(3 * n_free + 2 * sizes.n_q + 2 * sizes.n_v, sizes.n_resets, sizes.n_x + sizes.n_v + width)
    matrix = max(sizes.n_x * max(sizes.n_x, sizes.n_u, sizes.n_p), sizes.n_y * width)
    return [
        ("N_X", sizes.n_x),
        ("N_Q", sizes.n_q),
        ("N_V", sizes.n_v),
        ("N_Y", sizes.n_y),
        ("N_DOF", n_free),
        ("N_CONST", f"{prefix}_N_CONST"),
        ("N_WORK", f"{prefix}_N_WORK"),
        ("N_VALUES", values),
        ("N_TRIAL", trial),
        ("N_MATRIX", f"{matrix} + {prefix}_N_CONST"),
    ]


def _lists(program: Program, free: Sequence[int]) -> list[tuple[str, str]]:
    """Tables of whole numbers."""
    metadata = program.metadata
    events, resets, clocks = (metadata.get(key, []) for key in ("events", "resets", "clocks"))
    return [
        ("INDEPENDENT", _whole(map(int, find_exact(program)))),
        ("FREE_Q", _whole(coordinate_of(program, k) for k in free)),
        ("FREE_V", _whole(free)),
        ("DIRECTION", _whole(event["direction"] for event in events)),
        ("MOST", _whole(int(event["terminal"]) for event in events)),
        ("RESETS", _whole(int(event["resets"]) for event in events)),
        ("RESET_OF", _whole(row[0] for row in resets)),
        ("RESET_X", _whole(row[1] for row in resets)),
        ("CLOCK_EVENT", _whole(clock["event"] for clock in clocks)),
        ("CLOCK_COUNTER", _whole(clock["counter"] for clock in clocks)),
    ]


def _nominal(program: Program) -> list[float]:
    """Typical sizes of the states: 1 rad, the size of the mechanism, and their rates a second."""
    metadata = program.metadata
    length = float(metadata["length_scale"] or 1.0)
    kinds = [*metadata["coordinate_kinds"], *metadata["velocity_kinds"]]
    return [length if kind == "length" else 1.0 for kind in kinds]


def _whole(values: Iterable[int]) -> str:
    """The inside of a C initialiser of integers, which must not be empty."""
    return ", ".join(map(str, values)) or "0"
