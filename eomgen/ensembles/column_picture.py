"""An Ensemble -> a picture of one of its columns."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..base.notation import TIME, Notation, label
from ..base.value_rules import read_count
from ..runtime.near_names import require


class DrawnEnsemble(Protocol):
    """What an :class:`~.ensemble.Ensemble` is drawn from."""

    t: Any
    count: int
    names: tuple[str, ...]
    reduced: dict[str, Any]

    def __getitem__(self, name: str) -> Any: ...

    def unit(self, name: str) -> str: ...

    @property
    def notation(self) -> Notation: ...


def draw(ensemble: DrawnEnsemble, name: str, ax: Any, limit: int) -> Any:
    """See :meth:`.ensemble.Ensemble.plot`; returns the axes."""
    values, limit = ensemble[name], read_count("limit, of the runs drawn,", limit, 1)
    if ax is None:
        plt: Any = require("matplotlib.pyplot", "matplotlib", "plot")
        ax = plt.subplots(figsize=(7, 4), layout="constrained")[1]
    printed = label(ensemble.notation.mathtext(name), ensemble.unit(name))
    if "mean" in ensemble.reduced:
        row = ensemble.names.index(name)
        spread = np.sqrt(ensemble.reduced["variance"][row])
        ax.fill_between(ensemble.t, values - spread, values + spread, alpha=0.3, label="mean ± deviation")
        ax.plot(ensemble.t, values, label="mean")
        ax.plot(ensemble.t, ensemble.reduced["least"][row], "k:", lw=0.8, label="least, greatest")
        ax.plot(ensemble.t, ensemble.reduced["greatest"][row], "k:", lw=0.8)
        ax.legend(frameon=False)
    elif values.ndim == 2:
        chosen = np.unique(np.linspace(0, ensemble.count - 1, min(limit, ensemble.count)).astype(int))
        ax.plot(ensemble.t, values[:, chosen], color="C0", lw=0.8, alpha=max(0.08, min(1.0, 10 / len(chosen))))
    else:
        ax.hist(values[np.isfinite(values)], bins="auto")
        ax.set_xlabel(f"{printed} at $t$ = {ensemble.t[0]:.6g} s")
        ax.set_ylabel("runs")
        return ax
    ax.set_xlabel(TIME)
    ax.set_ylabel(printed)
    return ax
