"""Records are what the standard library's frozen dataclasses are."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import pytest

from eomgen.records import MANY, dataclass


def define(decorate: Callable[[type], type]) -> tuple[type, type]:
    class Base:
        """One field, one that is shared, and one that is counted from the other."""

        size: int
        kind: ClassVar[str] = "base"
        label: str = "none"

        @cached_property
        def twice(self) -> int:
            return 2 * self.size

    base: Any = decorate(Base)

    class Grown(base):
        """More of them."""

        parts: tuple[int, ...] = ()
        notes: list[str] = dataclasses.field(default_factory=list, repr=False)

        def __post_init__(self) -> None:
            if self.size < 0:
                raise ValueError("size")

    return base, decorate(Grown)


QUICK = define(dataclass(frozen=True))
PLAIN = define(dataclasses.dataclass(frozen=True))


@dataclass(frozen=True)
class Kept:
    """Can be found by pickle."""

    size: int
    label: str = "x"


def test_they_are_made_compared_shown_and_hashed_alike() -> None:
    for quick, plain in zip(QUICK, PLAIN, strict=True):
        assert inspect.signature(quick) == inspect.signature(plain)
        assert quick.__match_args__ == plain.__match_args__
        for given, named in (
            ((1,), {}),
            ((1, "a"), {}),
            ((), {"label": "b", "size": 2}),
            ((), {}),
            ((1, 2, 3, 4, 5), {}),
        ):
            try:
                expected = plain(*given, **named)
            except TypeError as error:
                with pytest.raises(TypeError) as raised:
                    quick(*given, **named)
                assert str(raised.value) == str(error)
                continue
            made = quick(*given, **named)
            assert repr(made).rpartition(".")[2] == repr(expected).rpartition(".")[2]
            assert dataclasses.asdict(made) == dataclasses.asdict(expected)
            assert made == quick(*given, **named)
            assert made != expected
            assert made != quick(7)
            assert made.twice == expected.twice
            assert dataclasses.replace(made, size=9).size == 9
            for change in (lambda m: setattr(m, "size", 3), lambda m: delattr(m, "size"), lambda m: setattr(m, "y", 3)):
                with pytest.raises(dataclasses.FrozenInstanceError) as changed:
                    change(made)
                with pytest.raises(dataclasses.FrozenInstanceError) as refused:
                    change(expected)
                assert str(changed.value) == str(refused.value)
    assert hash(QUICK[0](1, "a")) == hash(PLAIN[0](1, "a"))
    assert QUICK[0](1) != QUICK[1](1)
    with pytest.raises(TypeError, match="unhashable"):
        hash(QUICK[1](1))
    with pytest.raises(ValueError, match="size"):
        QUICK[1](-1)
    first, second = QUICK[1](1), QUICK[1](1)
    assert first.notes is not second.notes
    assert [f.name for f in dataclasses.fields(QUICK[1])] == ["size", "label", "parts", "notes"]


def test_they_can_be_copied_and_kept() -> None:
    made = Kept(3)
    assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
    match made:
        case Kept(size, label):
            assert (size, label) == (3, "x")
    with pytest.raises(TypeError, match="needs the standard library's"):

        @dataclass(frozen=True)
        class Odd:
            size: int = dataclasses.field(default=1, compare=False)


def test_other_options_are_the_standard_librarys() -> None:
    @dataclass
    class Open:
        size: int

    made = Open(1)
    made.size = 2
    assert made == Open(2)


def test_objects_made_before_and_after_compiling_are_the_same() -> None:
    quick, _ = define(dataclass(frozen=True))
    made = [quick(label="a", size=k) for k in range(MANY + 10)]
    assert type(vars(quick)["__init__"]).__name__ == "function"
    assert [m.size for m in made] == list(range(MANY + 10))
    assert {tuple(vars(m)) for m in made} == {("size", "label")}
    for wrong in ({"size": 1, "other": 2}, {}, {"label": "b"}):
        fresh, _ = define(dataclass(frozen=True))
        with pytest.raises(TypeError) as early:
            fresh(**wrong)
        with pytest.raises(TypeError) as late:
            quick(**wrong)
        assert str(early.value) == str(late.value)
