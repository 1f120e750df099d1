"""Simulation: one of SciPy's solvers between two steps <-> numbers.

The same steps follow, to the last bit.
"""

from __future__ import annotations

from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import cannot

if TYPE_CHECKING:
    from .checkpoint import Checkpoint

_COMMON = ("t", "t_old", "y", "h_abs", "nfev", "njev", "nlu")
_RUNGE_KUTTA = (*_COMMON, "y_old", "f", "h_previous")
_NEWTON = (*_COMMON, "h_abs_old", "error_norm_old", "J")
#: What the next steps of a solver depend on, besides what it was made with.
STATE = {
    "RK23": _RUNGE_KUTTA, "RK45": _RUNGE_KUTTA, "DOP853": _RUNGE_KUTTA,
    "Radau": (*_NEWTON, "y_old", "f", "Z", "current_jac", "LU_real", "LU_complex"),
    "BDF": (*_NEWTON, "D", "order", "n_equal_steps", "LU"),
}  # fmt: skip
RESULTS = ("x", "asked", "walked_t", "walked_x")
CROSSING = ("g", "slope", "slope_new", "size", "leaving", "touch", "resets", "crowded", "last")
_WHOLE = ("nfev", "njev", "nlu", "order", "n_equal_steps")


class Pause:
    """Keeps a run by one of SciPy's solvers in a checkpoint.

    Parameters
    ----------
    checkpoint : Checkpoint
    solver : OdeSolver subclass
    dense : bool
        Whether the run keeps a continuous solution.

    Raises
    ------
    UsageError
        A solver whose state cannot be read, or a continuous solution.
    """

    def __init__(self, checkpoint: Checkpoint, solver: Any, dense: bool) -> None:
        name = solver.__name__
        if name not in STATE or not solver.__module__.startswith("scipy."):
            raise cannot(
                f"a run with method {name} cannot keep a checkpoint, because its state cannot be read; "
                f"use one of {', '.join(STATE)}"
            )
        if dense:
            raise cannot(
                f"a checkpoint of a run by SciPy's {name} keeps no continuous solution: leave dense_output out and "
                "give t_eval, or take DOP853, RK45 or Radau in compiled code"
            )
        self.checkpoint, self.names, self.carried = checkpoint, STATE[name], dict[str, Any]()
        self.due = perf_counter() + checkpoint.every

    def thaw(self, solver: Any) -> None:
        """Give a new solver the state of the one that was kept."""
        for name, value in self.carried.items():
            setattr(solver, name, value)
        if self.carried.get("Z") is not None:  # Radau goes on from the polynomial of its last step
            solver.sol = solver._compute_dense_output()
        self.carried = {}

    def save(self, journey: Any, k: int, solver: Any = None, ended: int = 2) -> None:
        """Write a journey after a step in the part after `k` corners, or one that has ended with a status."""
        n, walked, found = len(journey.x), journey.walked, journey.crossings
        kept = {
            "x": journey.x, "place": np.array([k, ended, journey.kept], dtype=np.int64), "start": np.array(journey.t),
            "counts": np.array(list(journey.counts.values())), "asked": np.array(journey.asked).reshape(-1, n),
            "walked_t": np.array([t for t, _ in walked]),
            "walked_x": np.array([x for _, x in walked]).reshape(len(walked), n),
        }  # fmt: skip
        if found is not None:
            kept |= {name: np.array(getattr(found, name), dtype=float) for name in CROSSING}
            kept["known"] = np.array([event.known for event in found.events], dtype=bool)
            for e, (t, x) in enumerate(zip(found.t, found.x, strict=True)):
                kept[f"t_events_{e}"], kept[f"x_events_{e}"] = np.array(t, dtype=float), np.array(x).reshape(len(t), n)
        for name in self.names if solver is not None else ():
            value = getattr(solver, name)
            own = value if isinstance(value, tuple) else () if value is None else (value,)
            kept |= {f"solver_{name}_{i}": np.asarray(part) for i, part in enumerate(own)}
        self.checkpoint.save(kept)
        self.due = perf_counter() + self.checkpoint.every

    def go_on(self, journey: Any, corners: int) -> tuple[int, int]:
        """Give a journey what was kept, and return its part and its status, 2 on the way.

        Raises
        ------
        UsageError
            It cannot be of such a run.
        """
        try:
            return self._go_on(journey, corners, self.checkpoint.kept or {})
        except (KeyError, TypeError, ValueError, IndexError) as error:
            raise self.checkpoint.damaged(error) from None

    def _go_on(self, journey: Any, corners: int, kept: dict[str, Any]) -> tuple[int, int]:
        n, found = len(journey.x), journey.crossings
        k, ended, journey.kept = kept["place"].tolist()
        x, asked, t_walked, x_walked = (np.asarray(kept[name], dtype=float) for name in RESULTS)
        if x.shape != (n,) or asked.shape[1:] != (n,) or x_walked.shape != (*t_walked.shape, n):
            raise ValueError("results that do not fit each other")
        if not (0 <= k < corners and ended in (0, 1, 2)) or len(asked) > len(journey.t_eval if asked.size else asked):
            raise ValueError("a place that is not there")
        journey.x, journey.t, journey.asked = x, float(kept["start"]), list(asked)
        journey.walked = list(zip(t_walked.tolist(), x_walked, strict=True))
        journey.counts |= zip(journey.counts, kept["counts"].tolist(), strict=True)
        if found is not None:
            _thaw_crossings(found, kept, n)
        if ended == 2:
            self.restore(kept, n)
        return k, ended

    def restore(self, kept: dict[str, Any], n: int) -> None:
        """Take what :meth:`save` wrote of the solver.

        Raises
        ------
        ValueError, KeyError
            It cannot be of such a solver.
        """
        for name in self.names:
            parts = [kept[f"solver_{name}_{i}"] for i in range(2) if f"solver_{name}_{i}" in kept]
            if any(part.dtype.kind not in "bifc" for part in parts):
                raise ValueError(f"{name} is not a number")
            if len(parts) == 2:  # a matrix and the rows that were exchanged
                matrix, rows = parts
                if matrix.shape != (n, n) or rows.shape != (n,) or not np.isin(rows, np.arange(n)).all():
                    raise ValueError(f"{name} is not a factored matrix of {n} rows")
                self.carried[name] = (matrix, rows.astype(np.int32))
            elif not parts:
                self.carried[name] = None
            elif parts[0].ndim == 0:
                self.carried[name] = parts[0][()] if name not in _WHOLE else int(parts[0])
            else:
                self.carried[name] = parts[0]
        if any(not np.isrealobj(self.carried[name]) for name in self.names if not name.startswith("LU")):
            raise ValueError("a complex number")
        sizes = {"y": (n,), "y_old": (n,), "f": (n,), "J": (n, n), "Z": (3, n), "D": (8, n)}
        for name, shape in sizes.items():
            if name in self.names and self.carried[name] is not None and self.carried[name].shape != shape:
                raise ValueError(f"{name} has shape {self.carried[name].shape}, not {shape}")
        if not 1 <= self.carried.get("order", 1) <= 5:
            raise ValueError("order must be 1 to 5")


def _thaw_crossings(found: Any, kept: dict[str, Any], n: int) -> None:
    for name in CROSSING:
        value = np.asarray(kept[name], dtype=float)
        if value.shape != np.shape(getattr(found, name)):
            raise ValueError(f"{name} has shape {value.shape}")
        whole = name in ("leaving", "touch", "resets", "crowded")
        plain = value.astype(np.int64).tolist() if whole else value if value.ndim else float(value)
        setattr(found, name, plain)
    for e, (event, known) in enumerate(zip(found.events, kept["known"].tolist(), strict=True)):
        t, x = (np.asarray(kept[f"{name}_events_{e}"], dtype=float) for name in "tx")
        if x.shape != (*t.shape, n):
            raise ValueError("events that do not fit each other")
        event.known, found.t[e], found.x[e] = known, t.tolist(), list(x)
