"""Stage device: the text of a model and a device -> its functions for many states at once, and its runs.

States are columns, as in the batches of a module: an array (n, k) in C order holds k of them.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from ..runtime.given_start import Span
from .device_functions import DeviceFunctions
from .device_runs import DeviceRuns, carry_out


class DeviceModule(DeviceFunctions):
    """The functions of a model on a device.

    ``rhs(t, x, p=None, u=None)`` and the others have the arguments of a module: x (n_x,) or (n_x, k); t, p and u the
    same for all states, or (k,), (n_p, k), (n_u, k).  Arrays of NumPy are copied to the device and the result comes
    back as an array of NumPy; where one of the states is an array on the device (of CuPy, PyTorch, JAX or Numba), the
    result is a :class:`~.arrays_on_device.DeviceArray`.  An entry is NaN where the state has no value there; with
    ``status=True`` the result is (result, status), with 0 where all is well.

    Parameters
    ----------
    text : str
        Device code, as ``emit_device_text`` gives it.
    facts : mapping
        As ``describe_device`` gives them.
    metadata : mapping
        Of the model.
    device : Device, optional
        The first GPU by default.

    Attributes
    ----------
    q_names, v_names, x_names, u_names, p_names, y_names : tuple of str
    p, u : arrays
        Declared values.
    x0 : (n_x,) array
        A consistent state.
    """

    def simulate_many(
        self,
        span: Span,
        x0: Any,
        p: Any = None,
        u: Any = None,
        *,
        method: str | None = None,
        t_eval: ArrayLike | None = None,
        rtol: float | None = None,
        atol: ArrayLike | None = None,
        max_step: float | None = None,
        first_step: float | None = None,
        step: float | None = None,
        max_steps: int = 1_000_000,
        keep_events: int = 16,
    ) -> DeviceRuns:
        """Integrate the equations of motion from many states, every run with steps of its own.

        Parameters
        ----------
        span : (float, float) or float
            Times of start and end, or the end of a run from 0.
        x0 : (n_x, k) array
            Where the runs start, on the constraints; also an array on the device.
        p, u : (n_p,) or (n_p, k), (n_u,) or (n_u, k) arrays, optional
            Parameters and constant inputs; the declared values by default.
        method : {'DOP853', 'RK4'}, optional
            DOP853 controls its steps, each run its own; RK4 takes steps of the size `step`.
        t_eval : (m,) array, optional
            Times to store; the end alone by default.
        rtol, atol, max_step, first_step
            As for ``simulate``.
        step : float, optional
            Size of the steps of RK4 (s), and only of it.
        max_steps : int
            A run that takes more is given up.
        keep_events : int
            Events of the model to keep of each run, the first ones.

        Returns
        -------
        DeviceRuns
            With arrays of NumPy.

        Raises
        ------
        UsageError
            Wrong shapes or values; a model whose runs need Python.
        """
        options = {"rtol": rtol, "atol": atol, "max_step": max_step, "first_step": first_step}
        return carry_out(self, span, x0, p, u, method, t_eval, options, step, max_steps, keep_events)
