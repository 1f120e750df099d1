"""What a test demands of an error: its code, where in the model it is, and the names and numbers that it tells."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import eomgen as eg


def tells(text: str, value: str) -> bool:
    """Whether a message contains a name, a number or a place, and not as a part of a longer name or number."""
    start = r"(?<![\w.])" if value[0].isdigit() else r"(?<!\w)" if value[0].isalpha() else ""
    end = r"(?!\w|\.\d)" if value[-1].isdigit() else r"(?!\w)" if value[-1].isalpha() else ""
    return re.search(start + re.escape(value) + end, text) is not None


@contextmanager
def refused(demand: str, kind: type[Exception] = eg.EomgenError) -> Iterator[pytest.ExceptionInfo[Any]]:
    """Demand an error of eomgen, or of a model one of its problems, with a code, that tells certain values.

    Parameters
    ----------
    demand : str
        The code, then what the message must tell, between blanks: the place in the model or a line of a file, names and
        numbers, as in ``"EG-RANGE forces.k.stiffness -1"``.
    kind : type, optional
        The class of the error.
    """
    with pytest.raises(kind) as caught:
        yield caught
    error, (code, *values) = caught.value, demand.split()
    faults = [(p.code, str(p)) for p in getattr(error, "problems", ())] or [(error.code, str(error))]
    lacking = [[value for value in values if not tells(text, value)] for known, text in faults if known == code]
    assert [] in lacking, f"{demand}: {min(lacking, key=len, default=code)} not in {faults}"


def refuses(demand: str, call: Callable[..., object], /, *given: Any, **keys: Any) -> None:
    """Demand such an error of one call."""
    with refused(demand):
        call(*given, **keys)
