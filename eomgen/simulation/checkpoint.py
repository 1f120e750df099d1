"""Simulation: a run under way <-> a file from which the same call goes on, to the last bit.

The file is written beside and renamed, so that it is whole at any time; it says which run it belongs to, and that of
another run is refused.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.algebra import Array
from ..base.files import as_path, remove_parts, whole_file
from ..base.texts import shown
from ..errors import UsageError, bad_data, bad_file, no_choice, off_range
from ..runtime.arrays import BROKEN, read_arrays, sealed
from ..runtime.identity import code_digest, differences, digest
from ..runtime.input_kinds import Expressed
from ..runtime.room import read_number
from ..runtime.tapes import DeclaredSignal

if TYPE_CHECKING:
    from ..runtime.bound_model import BoundModel
    from ..runtime.signals import Forcing
    from .events import Events

FORMAT = "eomgen checkpoint 2"


class Checkpoint:
    """The file of one run.  A run that has ended is kept too: the same call again gives its result.

    Parameters
    ----------
    file : str or Path
    every : float
        Seconds of the clock on the wall between two writings.
    resume : bool or None
        True: the file must be there; False: what is there is replaced; None: go on if it is there, else begin.

    Attributes
    ----------
    kept : dict of arrays, or None
        What the run goes on from, after :meth:`open`.

    Raises
    ------
    UsageError
        Values that cannot be.
    """

    def __init__(self, file: Any, every: float | str, resume: bool | None) -> None:
        path = as_path("checkpoint", file)
        every = read_number("checkpoint_every", every)
        if every < 0.0:
            raise off_range(f"checkpoint_every must be a number of seconds, 0 or more, not {every}")
        if not isinstance(resume, bool | None):
            raise no_choice(f"resume must be True, False or None, not {shown(resume)}")
        self.file, self.every, self.resume = path, every, resume
        self.identity: dict[str, Any] = {}
        self.kept: dict[str, Any] | None = None
        self.warned = False

    def open(self, identity: dict[str, Any]) -> None:
        """Take what a run depends on, and read what there is of it.

        Raises
        ------
        UsageError
            The file is of another run, is damaged, is missing where it must be there, or could not be written.
        """
        self.identity = json.loads(json.dumps({"format": FORMAT, **identity}))
        remove_parts(self.file)
        if self.resume is False:
            return
        try:
            found = read_arrays(self.file, compressed=False)
            header = json.loads(found.pop("header").tobytes())
            if header["format"] != FORMAT or any(array.dtype.kind == "U" for array in found.values()):
                raise ValueError("another format")
        except FileNotFoundError:
            if self.resume:
                raise bad_file(f"there is no checkpoint {self.file} to resume from") from None
            return
        except BROKEN as error:
            raise self.damaged(error) from None
        names = differences(self.identity, header)
        if names:
            raise bad_data(
                f"checkpoint {self.file} belongs to another run: {', '.join(names)} differ; "
                "name another file, or begin anew with resume=False"
            )
        self.kept = found

    def damaged(self, why: object) -> UsageError:
        """The error for a file that cannot be gone on from."""
        return bad_data(
            f"checkpoint {self.file} is damaged, or is not a checkpoint of eomgen: {why}; begin anew with "
            "resume=False, or name another file"
        )

    def save(self, arrays: dict[str, Any]) -> None:
        """Write what the run goes on from.  Where that fails the run goes on, after a warning."""
        header = np.frombuffer(json.dumps(self.identity).encode(), dtype=np.uint8)
        try:
            with whole_file(self.file) as file:
                np.savez(file, **sealed({"header": header, **arrays}))
        except OSError as error:
            if not self.warned:
                warnings.warn(f"the run goes on, but its checkpoint cannot be written: {error}", stacklevel=2)
            self.warned = True


def identify(
    module: BoundModel,
    forcing: Forcing,
    events: Events,
    nodes: Sequence[float],
    x0: Array,
    method: str,
    t_eval: Array | None,
    dense: bool,
    options: dict[str, Any],
) -> dict[str, Any]:
    """All that the steps of a run depend on; parameters, inputs and options by name."""
    inputs: dict[str, Any] = dict(zip(module.u_names, module.u.tolist(), strict=True))
    for name, value in forcing.values.items():
        if isinstance(value, Expressed):
            inputs[name] = "declared" if isinstance(value, DeclaredSignal) else value.text
        else:
            inputs[name] = value if isinstance(value, float) else digest(value)
    return {
        "model": module.name,
        "model_digest": module.metadata.get("model_digest"),
        "eomgen": module.metadata.get("eomgen"),
        "code": code_digest(module),
        "method": method,
        "options": {name: digest(value) for name, value in options.items()},
        "span": [nodes[0], nodes[-1]],
        "initial": digest(x0),
        "parameters": dict(zip(module.p_names, module.p.tolist(), strict=True)),
        "inputs": inputs,
        "corners": digest(list(nodes)),
        "events": digest([events.names, events.encode()]),
        "t_eval": None if t_eval is None else digest(t_eval),
        "dense_output": dense,
    }
