"""Words of other programs and slips of spelling lead to the name that was meant."""

from __future__ import annotations

import pytest
from models import EXAMPLES

import eomgen as eg
from eomgen.cli.command import VERBS
from eomgen.suggestions import closest, hint


@pytest.mark.parametrize(
    ("word", "meant"),
    [("hinge", "revolute"), ("pin", "revolute"), ("ball", "spherical"), ("fixed", "weld"), ("slider", "prismatic"),
     ("motor", "driver"), ("dashpot", "damper"), ("rope", "spring"), ("animate", "draw"), ("Revolute", "revolute"),
     ("sprnig", "spring"), ("COM", "center_of_mass")],
)  # fmt: skip
def test_a_method_of_model(word: str, meant: str) -> None:
    with pytest.raises(AttributeError, match=f"did you mean '{meant}'"):
        getattr(eg.Model("m"), word)


@pytest.mark.parametrize(("word", "meant"), [("x0", "initial"), ("tol", "rtol"), ("teval", "t_eval")])
def test_an_argument_of_a_run(word: str, meant: str) -> None:
    mod = eg.load(EXAMPLES / "pendulum.yaml").compile(target="numpy")
    with pytest.raises(eg.UsageError, match=f"did you mean .*{meant}"):
        mod.simulate((0, 1), **{word: 1.0})


def test_the_normal_force_of_a_contact_is_its_force() -> None:
    m = eg.Model("m")
    m.prismatic("s", m.ground, m.body("ball", mass=1.0), axis="y")
    m.output("N", "normal(floor)")
    with pytest.raises(eg.ModelError, match=r"unknown function 'normal'.*did you mean 'force'"):
        m.check()


def test_types_in_a_file_and_verbs() -> None:
    m = eg.Model("m")
    m.body("a")
    with pytest.raises(eg.ModelError, match="did you mean 'revolute'"):
        m.joint("hinge", "j", m.ground, "a")
        m.derive()
    assert closest("integrate", VERBS) == ["run"]
    assert closest("eigenvalues", VERBS) == ["modes"]
    assert [closest(word, VERBS) for word in ("animate", "plot", "draw")] == [["view"], ["run"], ["check"]]
    assert closest("sweep", ["simulate", "simulate_many"]) == ["simulate_many"]


def test_what_a_name_is_not_near() -> None:
    assert hint("zzzzz", ["theta", "s"]) == ""
    assert hint("Theta", ["theta", "s"]) == "did you mean 'theta'?"
    assert hint("pin", ["theta", "spin"]) == "did you mean 'spin'?"  # no revolute among what there is
    assert closest("x", [f"n{k}" for k in range(3000)]) == []
