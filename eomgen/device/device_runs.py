"""Stage device: states, parameters and a span -> many runs on a device, and what became of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.value_rules import read_count
from ..errors import cannot, ill_shaped, no_choice
from ..runtime.given_start import Span
from ..simulation.run_arguments import check_method, check_tolerances, declare, find_span, ordered_times, own_step
from .arrays_on_device import Array
from .device_functions import DeviceFunctions

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel


@dataclass(frozen=True)
class DeviceRuns:
    """What became of the runs.

    Attributes
    ----------
    x : (n_x, k) array
        Last states, on the constraints.
    t : (k,) array
        Their times.
    samples : (n_x, m, k) array or None
        States at the times asked for, on the constraints; NaN where a run did not get to.
    status : (k,) int array
        0: the end was reached; 1: an event ended the run; below 0: the run failed, with the numbers of
        ``simulate_many``: -100 a step became too small, -104 more than max_steps steps, -102 resets follow each other
        ever faster, -103 a reset failed, -110 the parameters give no constants.
    failure, failure_time : (k,) arrays
        Status of the last evaluation that failed, 0 if none did, and its time.
    steps, rejected, evaluations : (k,) int arrays
    noted : (k,) int array
        Number of events.
    notes : (2 + n_x, m, k) array or None
        Number, time and state of the first m events of each run; NaN where there were fewer.
    """

    x: Array
    t: Array
    samples: Array | None
    status: Array
    failure: Array
    failure_time: Array
    steps: Array
    rejected: Array
    evaluations: Array
    noted: Array
    notes: Array | None = None


def carry_out(
    module: DeviceFunctions,
    span: Span,
    x0: Any,
    p: Any,
    u: Any,
    method: str | None,
    t_eval: ArrayLike | None,
    options: Mapping[str, Any],
    step: float | None,
    max_steps: int,
    keep_events: int,
) -> DeviceRuns:
    """Run every column of x0; see :meth:`~.device_module.DeviceModule.simulate_many`."""
    if module.facts["no_runs"]:
        raise cannot(f"simulate_many of {module.name!r} on a device: {module.facts['no_runs']}")
    like = cast("BoundModel", module)  # metadata and n_dof are all that is read
    declared, device, n = declare(like), module.device, module.n_x
    start, end = find_span(span, float(declared["end"]))
    if module.metadata.get("clocks") and (start != 0.0 or end < 0.0):
        raise cannot(
            f"runs on a device of a model with sampled states begin at 0 s and go forward, not from {start:.6g} s to "
            f"{end:.6g} s; use simulate_many of the module"
        )
    method, step = own_step(like, declared["method"] if method is None else method, step)
    methods = [name.upper() for name in module.facts["methods"]]
    if method not in methods:
        raise no_choice(f"no method {method!r} on a device; there are {', '.join(methods)}")
    step = check_method(method, step)
    own = {name: declared[name] for name in ("rtol", "atol", "max_step") if name in declared}
    chosen = own | {k: v for k, v in options.items() if v is not None}
    if step is not None:
        chosen |= {"max_step": step, "first_step": step}
    chosen = check_tolerances(n, abs(end - start), chosen)
    if not isinstance(chosen["rtol"], float):
        raise ill_shaped(f"rtol must be one number on a device, not of shape {np.shape(chosen['rtol'])}")
    times = np.empty(0) if t_eval is None else ordered_times(t_eval, start, end, n)
    most, keep = read_count("max_steps", max_steps, 1), read_count("keep_events", keep_events, 1)
    states, count = module.columns("x0", x0, n)
    if count is None:
        states, count = states.reshaped((n, 1)), 1
    parameters, each_p = module.columns("p", module.p if p is None else p, module.n_p, count)
    inputs, each_u = module.columns("u", module.u if u is None else u, module.n_u, count)
    events = len(module.metadata.get("events") or ())
    kept = keep if events else 0
    shapes = {
        "times": (len(times),), "samples": (count, len(times), n), "x": (n, count), "t": (count,),
        "status": (count,), "counts": (3, count), "failure": (count,), "failure_time": (count,),
        "notes": (count, kept, 2 + n), "noted": (count,),
    }  # fmt: skip
    kinds = {"status": np.int32, "failure": np.int32, "counts": np.int64, "noted": np.int64}
    made = {name: device.empty(shape, kinds.get(name, np.float64)) for name, shape in shapes.items()}
    if events:
        made["notes"] = device.put(np.full(shapes["notes"], np.nan))
    results = ("times", "samples", "x", "t", "status", "counts", "failure", "failure_time")
    launch = module.kernel(f"{method.lower()}_runs", "runs", method)
    if not count:
        raise ill_shaped("x0 holds no states; give one column for each run")
    nodes, atol = device.put(np.array([start, end])), device.put(np.broadcast_to(chosen["atol"], (n,)) * 1.0)
    launch(
        count, nodes, np.int32(2), states, parameters, np.int64(each_p is not None), inputs,
        np.int64(each_u is not None), np.float64(chosen["rtol"]), atol,
        np.float64(chosen.get("max_step", np.inf)), np.float64(chosen.get("first_step", 0.0)), np.int64(most),
        device.put(times), np.int64(len(times)), *(made[name] for name in results),
        *((made["notes"], np.int64(kept), made["noted"]) if events else ()),
    )  # fmt: skip
    found = {name: made[name].numpy() for name in shapes if name != "times"}
    steps, rejected, evaluations = found["counts"]
    x = _projected(module, found["x"], found["t"], p, u)
    samples = None
    if t_eval is not None:
        samples = np.ascontiguousarray(found["samples"].transpose(2, 1, 0))
        every = np.broadcast_to(times[:, None], samples.shape[1:])
        samples = _projected(module, samples, every, p, u)
    notes = None
    if events:
        notes = np.ascontiguousarray(found["notes"].transpose(2, 1, 0))
        notes[2:] = _projected(module, notes[2:], notes[1], p, u)
    return DeviceRuns(
        x, found["t"], samples, found["status"], found["failure"], found["failure_time"], steps, rejected,
        evaluations, found["noted"] if events else np.zeros(count, dtype=np.int64), notes,
    )  # fmt: skip


def _projected(module: DeviceFunctions, x: Array, t: Array, p: Any, u: Any) -> Array:
    """States (n_x, ..., k) at times (..., k) brought onto the constraints; NaN stays NaN."""
    if "project" not in module.facts["kernels"] or not x.size:
        return x
    flat = np.ascontiguousarray(x.reshape(x.shape[0], -1))
    repeated = [None if given is None else _repeated(module, given, flat.shape[1] // x.shape[-1]) for given in (p, u)]
    found = module.call("project")(flat, *repeated, t=np.ascontiguousarray(t).ravel())
    return np.asarray(found).reshape(x.shape)


def _repeated(module: DeviceFunctions, given: Any, times: int) -> Any:
    """Parameters of k runs for as many states of each."""
    there = module.device.view(given)
    array = np.asarray(given, dtype=float) if there is None else there.numpy()
    return np.tile(array, (1, times)) if array.ndim == 2 else array
