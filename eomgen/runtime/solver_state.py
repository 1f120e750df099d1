"""Stage runtime: one of SciPy's solvers between two steps <-> numbers, so that another of its class goes on from there.

A run by SciPy that keeps a checkpoint is cut where one is due: the solver says that it has finished, and the next one
takes over what it held.  The same steps follow, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..numeric.scales import Array

if TYPE_CHECKING:
    from .checkpoint import Checkpoint
    from .events import Event
    from .resets import Resets

_COMMON = ("t", "t_old", "y", "h_abs", "nfev", "njev", "nlu")
_RUNGE_KUTTA = (*_COMMON, "y_old", "f", "h_previous")
_NEWTON = (*_COMMON, "h_abs_old", "error_norm_old", "J")
#: What the next steps of a solver depend on, besides what it was made with.
STATE = {
    "RK23": _RUNGE_KUTTA, "RK45": _RUNGE_KUTTA, "DOP853": _RUNGE_KUTTA,
    "Radau": (*_NEWTON, "y_old", "f", "Z", "current_jac", "LU_real", "LU_complex"),
    "BDF": (*_NEWTON, "D", "order", "n_equal_steps", "LU"),
}  # fmt: skip
_WHOLE = ("nfev", "njev", "nlu", "order", "n_equal_steps")


class Pause:
    """Cuts a run where a checkpoint is due, and keeps what goes on from there.

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
            raise UsageError(
                f"no checkpoint can be kept with method {name}: its state cannot be read; "
                f"take one of {', '.join(STATE)}"
            )
        if dense:
            raise UsageError(
                f"a checkpoint of a run by SciPy's {name} keeps no continuous solution: leave dense_output out and "
                "give t_eval, or take DOP853, RK45, RK23 or Radau in compiled code"
            )
        self.checkpoint, self.names, self.carried = checkpoint, STATE[name], dict[str, Any]()
        self.due, self.cut = perf_counter() + checkpoint.every, False

    def begin(self, solver: Any) -> None:
        """Give a new solver the state of the one before."""
        for name, value in self.carried.items():
            setattr(solver, name, value)
        if self.carried.get("Z") is not None:  # Radau goes on from the polynomial of its last step
            solver.sol = solver._compute_dense_output()
        self.carried, self.cut = {}, False

    def look(self, solver: Any) -> None:
        """Cut the run after a step, if it is time."""
        if solver.status == "running" and perf_counter() >= self.due:
            self.carried = {name: getattr(solver, name) for name in self.names}
            solver.status, self.cut = "finished", True

    def keep(
        self, paths: Sequence[Any], found: Sequence[Any], counts: dict[str, int], events: Sequence[Event],
        resets: Resets, at: tuple[Array, int, float, int],
    ) -> None:  # fmt: skip
        """Write what the run and its solver hold: times, states and walked steps; times and states of events; the state
        from which the part after `k` corners goes on at a time; and the status."""
        (times, states, walked), (x, k, start, status) = paths, at
        for parts, axis in ((times, 0), (states, 1)):
            parts[:] = [np.concatenate(parts, axis=axis)] if parts else []
        kept = {
            "times": times[0], "states": states[0], "x": x, "counts": np.array(list(counts.values())),
            "place": np.array([k, status], dtype=np.int64), "start": np.array(start),
            "walked_t": np.array([t for t, _ in walked]),
            "walked_x": np.array([state for _, state in walked]).reshape(len(walked), len(x)),
            **_freeze_events(events, resets),
        }  # fmt: skip
        for e in range(len(events)):
            kept[f"t_events_{e}"] = np.concatenate([np.empty(0), *found[0][e]])
            kept[f"x_events_{e}"] = np.concatenate([np.empty((len(x), 0)), *found[1][e]], axis=1)
        for name, value in self.carried.items():
            own = value if isinstance(value, tuple) else () if value is None else (value,)
            kept |= {f"solver_{name}_{i}": np.asarray(part) for i, part in enumerate(own)}
        self.checkpoint.save(kept)
        self.due = perf_counter() + self.checkpoint.every

    def go_on(
        self, paths: Sequence[Any], found: Sequence[Any], counts: dict[str, int], events: Sequence[Event],
        resets: Resets, corners: int,
    ) -> tuple[Array, int, float, int]:  # fmt: skip
        """Fill what :meth:`keep` wrote into the same lists, and return the state, the part, the time and the status.

        Raises
        ------
        ValueError, KeyError, TypeError, IndexError
            It cannot be of such a run.
        """
        kept: dict[str, Any] = self.checkpoint.kept or {}
        times, states, x = (np.asarray(kept[name], dtype=float) for name in ("times", "states", "x"))
        k, status = kept["place"].tolist()
        t_walked, x_walked = kept["walked_t"], kept["walked_x"]
        if states.shape != (len(x), *times.shape) or x_walked.shape != (len(t_walked), len(x)):
            raise ValueError("results that do not fit each other")
        if not (0 <= k < corners and status in (0, 1, 2)):
            raise ValueError("a place that is not there")
        paths[0].append(times)
        paths[1].append(states)
        paths[2].extend(zip(t_walked.tolist(), x_walked, strict=True))
        for e in range(len(events)):
            t, columns = kept[f"t_events_{e}"], kept[f"x_events_{e}"]
            if columns.shape != (len(x), *t.shape):
                raise ValueError("events that do not fit each other")
            found[0][e].append(t)
            found[1][e].append(columns)
        counts |= zip(counts, kept["counts"].tolist(), strict=True)
        _thaw_events(kept, events, resets)
        if status == 2:  # under way
            self.restore(kept, len(x))
        return x, k, float(kept["start"]), status

    def restore(self, kept: dict[str, Any], n: int) -> None:
        """Take what :meth:`keep` wrote of the solver.

        Raises
        ------
        ValueError, KeyError
            It cannot be of such a solver.
        """
        for name in self.names:
            parts = [kept[f"solver_{name}_{i}"] for i in range(2) if f"solver_{name}_{i}" in kept]
            if any(part.dtype.kind not in "bifc" for part in parts):
                raise ValueError(f"{name} is no number")
            if len(parts) == 2:  # a matrix and the rows that were exchanged
                matrix, rows = parts
                if matrix.shape != (n, n) or rows.shape != (n,) or not np.isin(rows, np.arange(n)).all():
                    raise ValueError(f"{name} is no factored matrix of {n} rows")
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


def _freeze_events(events: Sequence[Event], resets: Resets) -> dict[str, Any]:
    """What the loop knows of its events."""
    left = [event.left or (np.nan, np.nan) for event in events]
    return {
        "terminal": np.array([event.terminal for event in events], dtype=np.int64),
        "known": np.array([event.known for event in events], dtype=bool),
        "left": np.array(left, dtype=float).reshape(len(events), 2),
        "resets": np.array([resets.count, resets.crowded, resets.last], dtype=float),
    }


def _thaw_events(kept: dict[str, Any], events: Sequence[Event], resets: Resets) -> None:
    """Take back what :func:`_freeze_events` gave."""
    count, crowded, last = kept["resets"].tolist()
    resets.count, resets.crowded, resets.last = int(count), int(crowded), last
    rows = zip(events, kept["terminal"].tolist(), kept["known"].tolist(), kept["left"].tolist(), strict=True)
    for event, terminal, known, (t, side) in rows:
        event.terminal, event.known, event.left = terminal, known, None if t != t else (t, side)
