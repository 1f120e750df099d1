"""Every error has a code, and its text is as it was when somebody last looked at it: ``messages.json``."""

import json
import pickle
import re
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import command
import golden
import models
import numpy as np
import pytest

import eomgen as eg
from eomgen.errors import CODES

MESSAGES = Path(__file__).with_name("messages.json")
#: Codes of which no example stands here, and why.
NOT_HERE = {
    "EG-STALLED": "needs a run that takes long; tests/runs",
    "EG-ENDLESS": "needs a run that takes long; tests/runs",
    "EG-UNSOLVED": "depends on rounding",
    "EG-EVALUATION": "no public call is known to meet it",
    "EG-INTERRUPTED": "needs Ctrl-C; tests/runs",
    "EG-CACHE": "needs a folder that nobody may write; tests/code",
    "EG-COMPILER-MISSING": "depends on the machine; tests/code",
    "EG-COMPILER-FAILED": "its text is that of the compiler; tests/code",
    "EG-PACKAGE-MISSING": "needs a package that is missing; tests/core",
    "EG-NO-DERIVATIVE": "needs a run with sensitivities; tests/runs",
}


@cache
def crank(name: str = "slider_crank") -> Any:
    return models.build(name).compile(target="numpy")


def pendulum(mass: float = 1.0, inertia: float = 0.1) -> eg.Model:
    m = eg.Model("swing", gravity=(0, -9.81, 0))
    m.revolute("A", m.ground, m.body("rod", mass=mass, com=(0.5, 0, 0), inertia={"zz": inertia}))
    return m


def swing(section: str, *given: Any, mass: float = 1.0, inertia: float = 0.1, **values: Any) -> Any:
    """A pendulum with one thing more, compiled and started."""
    m = pendulum(mass, inertia)
    getattr(m, section)(*given, **values)
    module = m.compile(target="numpy")
    return module.rhs(0.0, module.x0())


def swung() -> Any:
    m = pendulum()
    m.torque("k", "A", 30)
    return m.compile(target="numpy")


def massless_rhs() -> None:
    m = eg.Model("swing")
    m.parameter("mass", 1.0)
    m.revolute("A", m.ground, m.body("rod", mass="mass", com=(0.5, 0, 0)))
    m.compile(target="numpy", method="newton_euler", kernels=["rhs"]).rhs(0.0, [0, 0], p={"mass": 0})


def crank_with(section: str, *given: Any, **values: Any) -> None:
    m = models.build("slider_crank")
    getattr(m, section)(*given, **values)
    m.compile(target="numpy")


def idle_driver() -> None:
    m = eg.Model("lever")
    a = m.body("a", mass=1, inertia=(1, 1, 1))
    m.revolute("A", m.ground, a)
    m.driver("d", between=[m.ground.at(0, 0, 0), a.at(1, 0, 0)], value="1 + 0.1*t")
    m.compile(target="numpy")


def over_driven() -> None:
    m = pendulum()
    m.driver("d1", coordinate="A", value="t")
    m.driver("d2", coordinate="A", value="2*t + 1")
    m.compile(target="numpy")


def angle_across() -> None:
    m = pendulum()
    tip = m.body("tip", mass=1, inertia={"xx": 1, "yy": 1, "zz": 1})
    m.spherical("S", "rod", tip)
    m.torsional_spring("k", "rod", tip, stiffness=1)
    m.compile(target="numpy")


def undetermined() -> None:
    m = models.build("bricard")
    m.output("o", "reaction(J1).x")
    m.compile(target="numpy")


def jumping() -> None:
    m = pendulum()
    m.input("u", 0.0)
    m.driver("d", coordinate="A", value="u")
    m.compile(target="numpy").simulate(1.0, inputs={"u": "1 if t > 0.5 else 0"})


def read(text: str, name: str = "model.yaml") -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_text(text, encoding="utf-8")
        return eg.load(file).compile(target="numpy")


def shout(*words: str) -> None:
    result = command.run(*words, "--json").json["error"]
    raise eg.UsageError(result["message"], code=result["code"])


def faulty(path: str) -> None:
    read(json.dumps(golden.changed(path, golden.FAULTS[path]))).simulate()


ROBOT = '<robot name="r"><link name="a"/><joint name="j" type="revolute"><parent link="a"/></joint></robot>'

CALLS: dict[str, Callable[[], Any]] = {
    "an attribute": lambda: crank().mas_matrix,
    "a canonical form": lambda: crank().canonical,
    "a state too short": lambda: crank().rhs(0.0, [0.0]),
    "a state of words": lambda: crank().rhs(0.0, ["a", "b"]),
    "a parameter unknown": lambda: crank().bind(parameters={"rr": 1.0}),
    "a parameter too large": lambda: crank().bind(p=[1e400] * crank().n_p),
    "a parameter of words": lambda: crank().bind(parameters={"r": "long"}),
    "parameters as a list": lambda: crank().bind(parameters=[1.0]),
    "parameters negative": lambda: crank().bind(parameters={"m_c": -1.0}),
    "an initial value unknown": lambda: crank().x0(phi=1.0),
    "an initial value out of reach": lambda: crank().x0(s=9.0),
    "initial values that disagree": lambda: crank().x0(theta=0.3, s=0.1),
    "a span backwards of words": lambda: crank().simulate("soon"),
    "a span of three": lambda: crank().simulate((0, 1, 2)),
    "a method": lambda: crank().simulate(0.1, method="Euler"),
    "a method by number": lambda: crank().simulate(0.1, method=3),
    "RK4 without step": lambda: crank().simulate(0.1, method="RK4"),
    "a tolerance": lambda: crank().simulate(0.1, rtol=-1.0),
    "a tolerance of words": lambda: crank().simulate(0.1, rtol="fine"),
    "a tolerance by a formula": lambda: crank().simulate(0.1, rtol="2*fine"),
    "a first step": lambda: crank().simulate(0.1, first_step=2.0),
    "times not in order": lambda: crank().simulate(0.1, t_eval=[0.1, 0.0]),
    "an input unknown": lambda: crank().simulate(0.1, inputs={"taf": 1.0}),
    "an input of a kind": lambda: crank().simulate(0.1, inputs={"tau": {}}),
    "an input by text": lambda: crank().simulate(0.1, inputs={"tau": "2*"}),
    "an input without values": lambda: crank().simulate(0.1, inputs={"tau": lambda t, x: np.nan}),
    "an input as a table": lambda: crank().simulate(0.1, inputs={"tau": ([0, 1], [1])}),
    "an event by number": lambda: crank().simulate(0.1, events=[3]),
    "an event by text": lambda: crank().simulate(0.1, events=["theta - phi"]),
    "moreau without contacts": lambda: crank().simulate(0.1, method="moreau", step=1e-3),
    "kinematic with freedom": lambda: crank().simulate(0.1, method="kinematic"),
    "a form": lambda: crank().linearize(form="big"),
    "independent twice": lambda: crank().linearize(independent=["theta", "theta"]),
    "no equilibrium": lambda: swung().equilibrium(),
    "modes in motion": lambda: crank().modes(crank().x0(theta=0.7)),
    "an impact of nothing": lambda: crank().impact(0.0, crank().x0()),
    "a restitution": lambda: crank().impact(0.0, crank().x0(), gaps={"s": 2.0}),
    "a gap that is open": lambda: crank().impact(0.0, crank().x0(), gaps={"s": 0.5}),
    "a range of nothing": lambda: crank().kinematic_analysis(),
    "a range of unequal arrays": lambda: crank().kinematic_analysis(t=[0, 1], theta=[0, 1, 2]),
    "a range of two coordinates": lambda: crank().kinematic_analysis(theta=[0.0, 0.1], s=[0.3, 0.31]),
    "a range out of reach": lambda: crank().kinematic_analysis(s=[0.3, 9.0]),
    "projection from afar": lambda: crank().project(np.full(crank().n_x, 1e9)),
    "a state without numbers": lambda: crank().rhs(0.0, np.full(crank().n_x, np.nan)),
    "a rate without number": lambda: crank().energy([0.3, 0, 0.4, np.inf, 0, 0]),
    "a state of a large model": lambda: crank("bricard").energy(np.full(crank("bricard").n_x, np.nan)),
    "no kernel to tell more": massless_rhs,
    "energies of nothing": lambda: crank().reactions(0.0, [0.0]),
    "a drive": lambda: crank().actuator_forces(0.0, crank().x0(), actuated=["no"]),
    "runs of unequal lengths": lambda: crank().simulate_many(
        0.1, initial={"theta": [0, 1]}, parameters={"r": [1, 2, 3]}
    ),
    "a reduction": lambda: crank().simulate_many(0.1, initial={"theta": [0, 1]}, reduce="best"),
    "frames": lambda: crank().simulate(0.01).animate("a.xyz"),
    "a file of a picture": lambda: crank().draw(file="a.png"),
    "a column": lambda: crank().simulate(0.01)["phi"],
    "a time outside": lambda: crank().simulate(0.01, dense_output=True).at(1.0),
    "a file that is not there": lambda: eg.load("nowhere.yaml"),
    "a file of no kind": lambda: eg.load("robot.xacro"),
    "an example": lambda: eg.load_example("pendulem"),
    "a target": lambda: pendulum().compile(target="fortran"),
    "a method of derivation": lambda: pendulum().compile(target="numpy", method="euler"),
    "an option of numpy": lambda: pendulum().compile(target="numpy", optimize=0),
    "baumgarte": lambda: pendulum().compile(target="numpy", baumgarte=(1, 1)),
    "a name in Python": lambda: pendulum().body(3),
    "a name taken": lambda: swing("parameter", "A", 1),
    "a keyword": lambda: pendulum().revolute("B", "ground", "rod", axs="z"),
    "a marker": lambda: swing("revolute", "B", "ground", 3),
    "a foreign body": lambda: pendulum().revolute("B", pendulum().body("b"), pendulum().ground),
    "a body of another model": lambda: pendulum().revolute("B", models.build("slider_crank").ground, pendulum().ground),
    "an attribute of Model": lambda: pendulum().revolut,
    "a body that hangs in the air": lambda: swing("body", "other", mass=1),
    "no inertia": lambda: swing("output", "o", "A", mass=0, inertia=0),
    "inertia of a needle": lambda: swing("output", "o", "A", inertia=-1),
    "dimensions": lambda: swing("output", "o", "x(rod) + vx(rod)", unit="m"),
    "outputs in a circle": lambda: swing("output", "o", "o + 1"),
    "latex": lambda: swing("parameter", "k", 1, latex="\\alpha{"),
    "an expression too large": lambda: swing("output", "o", "+".join(["A"] * 50000)),
    "a driver that moves nothing": idle_driver,
    "a unit": lambda: swing("output", "o", "A", unit="blub"),
    "a sum of squares": lambda: crank_with("coupling", "c", equation="(theta - 1)**2 + (B + 1)**2"),
    "keys that go together": lambda: crank_with("torque", "k", "A", 1, axes="A"),
    "both an axis and axes": lambda: swing("universal", "U", "ground", "rod", axis="x", axes=["x", "y"]),
    "momentum without mass": lambda: pendulum(0.0, 0.0).compile(target="numpy").momentum([0.0, 0.0]),
    "two drivers": over_driven,
    "a driver of nothing": lambda: swing("coupling", "c", equation="(A - A)*A + sin(0*A)"),
    "an angle across": angle_across,
    "native code": lambda: read("name: n\nfunctions: {f: {type: native, source: f.c, arguments: 1}}\n"),
    "events without end": lambda: crank("bouncing_ball").simulate(10.0),
    "a value without end": lambda: swing("output", "o", "1/0"),
    "a force without end": lambda: swing("torque", "k", "A", "1/(A - A*cos(t))"),
    "a reaction that is not determined": undetermined,
    "an event that resets a counter": lambda: swing("event", "e", "A", reset={"t": 0}),
    "a rate of an input that jumps": jumping,
    "a damaged file": lambda: read("name: ["),
    "a link of a robot": lambda: read(ROBOT, "r.urdf"),
    "a word on the command line": lambda: shout("check"),
    "a setting on the command line": lambda: shout("run", str(models.EXAMPLES / "pendulum.yaml"), "--set", "m"),
}


CALLS |= {f"the entry {path}": lambda path=path: faulty(path) for path in golden.FAULTS}


def told(call: Callable[[], Any]) -> dict[str, Any]:
    """What a call says, without folders and lines, and with # for the digits of numbers."""
    try:
        call()
    except eg.EomgenError as error:
        lines = [re.sub(r"^\S+\.(py|yaml|urdf):\d+: |/tmp/\S+/", "", line)[:300] for line in str(error).splitlines()]
        lines = [re.sub(r"-?\d+\.\d{3,}(e[-+]\d+)?|\d+e-\d+", "#", line) for line in lines]
        places = [f"{problem.path} {problem.code}" for problem in getattr(error, "problems", ())]
        return {"class": type(error).__name__, "code": error.code, "places": places, "text": lines}
    return {}


@pytest.mark.parametrize("name", CALLS)
def test_what_it_says(name: str) -> None:
    said, known = told(CALLS[name]), json.loads(MESSAGES.read_text(encoding="utf-8"))[name]
    assert said == known


def test_every_code_has_an_example() -> None:
    known = json.loads(MESSAGES.read_text(encoding="utf-8"))
    shown = {entry["code"] for entry in known.values()}
    shown |= {place.rpartition(" ")[2] for entry in known.values() for place in entry["places"]}
    assert shown | NOT_HERE.keys() == CODES.keys()
    assert not shown & NOT_HERE.keys()
    assert known.keys() == CALLS.keys()


def test_a_code_is_kept_by_pickle() -> None:
    error = eg.AssemblyError("open", ["C.r_x"], code="EG-CONTRADICTION")
    again = pickle.loads(pickle.dumps(error))
    assert (again.code, again.rows, str(again)) == ("EG-CONTRADICTION", ("C.r_x",), "open")
    assert eg.AssemblyError("open").code == "EG-LOOP-OPEN"


if __name__ == "__main__":  # after a look at the difference: the messages anew
    found = {name: told(call) for name, call in CALLS.items()}
    MESSAGES.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
