"""Target web: Program -> WebAssembly, and the page in which the mechanism runs: one HTML file without a network."""

from __future__ import annotations

import os
import shutil
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import prod
from pathlib import Path
from threading import Timer
from typing import Any, overload

import numpy as np

from ...base.algebra import Array
from ...base.files import as_path, open_plain, write_whole
from ...base.operations import OPERATIONS
from ...base.picture_data import read_picture
from ...elements.frames import GROUND
from ...errors import EomgenError, ModelError, Problem, ToolchainError, bad_file, cannot, ill_typed
from ...expr import vectors as vec
from ...expr.vectors import Vec3
from ...mechanics import Kinematics
from ...mechanics.methods import TreeEquations
from ...mechanics.mobility import Mobility
from ...mechanics.motion import force_and_moment
from ...mechanics.wrenches import JointWrenches, joint_reactions
from ...model.mechanism import Output
from ...native.limits import definitions
from ...runtime.bound_model import BoundModel
from ...runtime.drawing import module_of
from ...runtime.layout import bounds_of
from ...runtime.plotting import states_at
from ...runtime.runs.events import Events
from ...runtime.runs.simulate import plan_run, simulate
from ...show.build_scene import build_scene
from ...show.frames import sample
from ...show.page import InlinePage, page_html, scene_position
from ...toolchain.cache import Cache, cache_directory, compute_key
from ...toolchain.compiler import run, zig_of_python
from ...toolchain.layer import read_layer
from ..build import program_of
from ..c import emit_c
from ..files import own_file, read_template
from ..program import Program
from ..reactions import solve_multipliers
from .fmu import refuse_impacts

#: Functions that a page calls.
KERNELS = ("rhs", "energy", "constraints", "constraint_jacobian", "velocity_constraints", "project", "poses", "outputs",
           "events", "resets", "alignment", "scales")  # fmt: skip
METHODS = {"DOP853": "dop853", "RK45": "rk45", "Radau": "radau"}  #: with watched steps; DOP853 stands for others
STEPPERS = ("eomgen_steppers.h", "eomgen_methods.h", "eomgen_steppers.c")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-mexec-model=reactor", "-s", "-DEOMGEN_LANES=0",
         "-DEOMGEN_PORTABLE", "-DEOMGEN_WITHOUT_METADATA")  # fmt: skip
SECONDS = 1800.0  #: that the compiler may take: the first time zig builds its C library, once for all
CODES = ("const", "t", "x", "u", "p", *OPERATIONS)  #: operations of tapes, by their numbers in the library
FIXED = ("RK4", "semi-implicit Euler")  #: methods of a page with steps of one size
GENERATOR = b'<meta name="generator" content="eomgen">'  #: what a page says of itself
BODIES = 200  #: more take too long for a page
BRANCHES = 8  #: ways of closing the loops that are offered
STEP = 1e-3  #: s, of methods with steps of one size, unless the model declares it
ARROWS = 120  #: of forces and of reactions; where there are more, none is drawn
ROWS = 24  #: of constraints; with more, reactions are not computed in a page
READ = 12_000  #: operations of the equations; longer ones take minutes to write, and no one reads them


def find_compiler() -> list[str]:
    """The command of a C compiler for WebAssembly. Raises ToolchainError (there is none)."""
    for zig in (shutil.which("zig"), *zig_of_python()):
        if zig is not None:
            return [str(zig), "cc", "-target", "wasm32-wasi", "-fno-sanitize=undefined"]
    kit = os.environ.get("WASI_SDK_PATH", "")
    clang = shutil.which(f"{kit}/bin/clang" if kit else "clang")
    if clang is not None and (kit or shutil.which("wasm-ld")):
        return [clang, "--target=wasm32-wasi"]
    raise ToolchainError(
        "no compiler for WebAssembly was found; pip install ziglang, or set WASI_SDK_PATH to wasi-sdk (clang with "
        "wasm-ld and a C library); a run can be shown without one: traj.animate('run.html')",
        code="EG-COMPILER-MISSING",
    )


def refuse(program: Program) -> None:
    """Refuse models that cannot run in a page. Raises ModelError."""
    refuse_impacts(program, "a page")
    metadata, remedy = program.metadata, "simulate it, and show the run: traj.animate('run.html')"
    problems = [Problem(f"constraints.{name}", "it closes and opens by impacts, which a page does not compute", remedy,
                        code="EG-UNSUPPORTED") for name in metadata.get("switched", {})]  # fmt: skip
    reset_places = {place for _, place in metadata.get("resets", ())}
    problems += [Problem(f"states.{clock['name']}", "it is sampled without a law, by a function in Python", remedy,
                         code="EG-UNSUPPORTED") for clock in metadata.get("clocks", ())
                 if not reset_places.intersection(clock.get("states", reset_places))]  # fmt: skip
    if program.sizes.n_bodies > BODIES:
        problems.append(Problem("bodies", f"{program.sizes.n_bodies} are more than the {BODIES} that a page takes",
                                remedy, code="EG-UNSUPPORTED"))  # fmt: skip
    if problems:
        raise ModelError(problems)


@contextmanager
def _phase(what: str) -> Iterator[None]:
    """Say on a terminal what is being done, once it takes longer than a second."""
    timer = Timer(1.0, lambda: print(f"{what} ...", file=sys.stderr, flush=True))
    if sys.stderr.isatty():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


Arrow = tuple[str, bool, bool, Vec3, Vec3]  #: of what, whether a reaction, whether a moment; where, how much


def _loads(kinematics: Kinematics) -> list[Arrow]:
    """What the force elements exert on bodies, ground axes."""
    graph, poses, motion = kinematics.graph, kinematics.poses, kinematics.motion
    result: list[Arrow] = []
    for terms in kinematics.forces:
        for load in terms.marker_loads:
            if load.marker.body != GROUND:
                at = poses.marker(load.marker).position
                parts = enumerate((load.force, load.torque))
                result += [(terms.force.name, False, k == 1, at, part) for k, part in parts]
        for pushed in terms.coordinate_loads:
            spec = next((one for one in kinematics.mechanism.joints if one.coordinates == (pushed.coordinate,)), None)
            if spec is not None:
                marker, value = poses.marker(spec.successor), motion.coordinates[pushed.coordinate][0]
                angular, linear = spec.joint.subspace(graph, [value])[0]
                turns = not all(part.is_zero for part in angular)
                way = vec.scale(pushed.value, vec.times(marker.rotation, angular if turns else linear))
                result.append((terms.force.name, False, turns, marker.position, way))
    return result


def _reactions(module: Any, kinematics: Kinematics, mobility: Mobility, tree: TreeEquations) -> list[Arrow]:
    """What joints exert on their successors, ground axes, as far as rigid bodies determine it.

    The multipliers l of the independent rows follow from C_q^T l = -(M a + h) with the accelerations of the run.
    """
    graph, poses, constraints = kinematics.graph, kinematics.poses, kinematics.constraints
    if len(mobility.independent_rows) > ROWS or not tree.inverse_dynamics:
        return []
    try:
        open_ = module.undetermined_reactions(0.0, module.x0())
    except EomgenError:
        return []
    rows = [constraints.jacobian[i] for i in mobility.independent_rows]
    values = solve_multipliers(rows, tree.inverse_dynamics)
    wrenches = JointWrenches(kinematics)
    labels = [constraints.labels[i] for i in mobility.independent_rows]
    every = joint_reactions(wrenches, dict(zip(labels, values, strict=True)))
    result: list[Arrow] = []
    for spec, unknown in zip(wrenches.specs, open_, strict=True):
        if spec.name not in every:
            continue
        marker = poses.marker(spec.successor)
        for k, part in enumerate(force_and_moment(kinematics.motion, spec, every[spec.name])):
            known = [graph.zero if lost else x for x, lost in
                     zip(vec.times(marker.rotation, part), unknown[3 * k : 3 * k + 3], strict=True)]  # fmt: skip
            result.append((spec.name, True, k == 1, marker.position, (known[0], known[1], known[2])))
    return result


def with_arrows(
    module: Any, kinematics: Kinematics, mobility: Mobility, tree: TreeEquations
) -> tuple[Kinematics, list[tuple[str, bool, bool]]]:
    """The model whose outputs end with the places and parts (6 numbers) of arrows, and what these are."""
    every: list[Arrow] = []
    for result in (_loads(kinematics), _reactions(module, kinematics, mobility, tree)):
        result = [one for one in result if not all(x.is_zero for x in one[4])]
        every += result if len(result) <= ARROWS else []
    numbers = [x for *_, at, way in every for x in (*at, *way)]
    outputs = [Output(f"arrow[{k}]", x) for k, x in enumerate(numbers)]
    mechanism = replace(kinematics.mechanism, outputs=(*kinematics.mechanism.outputs, *outputs))
    return replace(kinematics, mechanism=mechanism), [one[:3] for one in every]


def compile_wasm(program: Program, method: str) -> bytes:
    """The model and the library as WebAssembly, or those of an earlier call.

    Raises ToolchainError (there is no compiler, it fails, or the model calls more of C than its functions of numbers).
    """
    command, layer = find_compiler(), read_layer()
    sources = {name: text for name, text in emit_c(program, lanes=False).items() if name.endswith((".c", ".h"))}
    sources |= {name: layer[name] for name in STEPPERS}
    face = read_template("web/web.c")
    sources["web.c"] = definitions(face) + face
    flags = [*FLAGS, f"-DWEB_METHOD=eomgen_{METHODS.get(method, 'dop853')}"]
    key = compute_key({"kind": "web", "sources": sources, "flags": flags, "command": command})

    def compiled(folder: Path) -> tuple[str, dict[str, Any]]:
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8")
        files, product = sorted(name for name in sources if name.endswith(".c")), f"{program.name}.wasm"
        run([*command, *flags, *files, "-o", product], folder, SECONDS, f"compiling {program.name} for a page")
        return product, {"flags": flags}

    made = Cache(cache_directory()).make(key, "web", program.name, compiled).product.read_bytes()
    if b"wasi_snapshot_preview1" in made:
        raise ToolchainError(
            f"the C functions of {program.name} call the system, which a page does not have; give them nothing of C "
            "but math.h, or show a run: traj.animate('run.html')"
        )
    return made


def describe_model(module: BoundModel, method: str) -> dict[str, Any]:
    """What the script of a page knows of a model."""
    info, layout = module.info, module.layout
    plan = plan_run(module, method, None, None, None, None, {}, {})
    events = Events(layout, None)
    coded = events.encode() or {"direction": [], "most": [], "action": []}
    rows = zip(events.names, coded["direction"], coded["most"], coded["action"], strict=True)
    x0, inputs = module.x0(), dict(zip(layout.u, map(float, module.u), strict=True))
    scene = build_scene(module, scene_position(module), quiet=True)
    size = float((scene.high - scene.low).max())
    independent = [int(i) for i in info.independent if int(i) < layout.moving]
    places = [layout.q.index(layout.velocity_labels[i]) for i in independent if layout.velocity_labels[i] in layout.q]
    ranges: dict[str, list[float]] = {}
    for name, value in zip(layout.p, map(float, module.p), strict=True):
        low, high = bounds_of(info).get(name, (-np.inf, np.inf))
        ends = sorted((0.5 * value, 2.0 * value)) if value else [-1.0, 1.0]
        ranges[name] = [float(np.clip(end, low, high)) for end in ends]
    weight = float(9.81 * read_picture(module.metadata, module.p).mass.sum()) or 10.0
    default_range = {"N": weight, "N*m": weight * size, "m": 0.5 * size, "rad": np.pi, "m/s": size, "Pa": 1e7}
    for name, value in inputs.items():  # of 0: what such a mechanism notices, of one digit
        most = 10.0 * abs(value) or float(f"{default_range.get(layout.unit(name), 10.0):.0e}")
        ranges[name] = [-most, most]
    for k in places:
        limits, reach = module.limits.get(layout.q[k], {}), 0.5 * size if layout.unit(layout.q[k]) == "m" else np.pi
        ends = [limits.get("lower", x0[k] - reach), limits.get("upper", x0[k] + reach)]
        ranges[layout.q[k]] = [float(min(ends[0], x0[k])), float(max(ends[1], x0[k]))]
    signals = {layout.u.index(name): ["as declared", *_tape(tape)] for name, tape in layout.signals.items()
               if name in layout.u}  # fmt: skip
    try:
        result = module.branches()[:BRANCHES] if layout.n_c and layout.n_v <= 24 else []
    except EomgenError:
        result = []
    settings, bounds = plan.settings, bounds_of(info)
    finite = {name: [float(np.clip(end, -1e300, 1e300)) for end in pair] for name, pair in bounds.items()}
    return {
        "q": list(layout.q), "v": list(layout.v), "x": list(layout.x), "u": list(layout.u), "p": list(layout.p),
        "y": list(layout.y), "docs": dict(info.docs), "pValues": [float(p) for p in module.p],
        "uValues": [inputs[name] for name in layout.u], "x0": [float(x) for x in x0], "rows": layout.n_c,
        "slots": [list(pair) for pair in layout.quaternion_slots], "independent": independent, "independentQ": places,
        "sizes": [float(info.length_scale or 1.0) if layout.unit(name) == "m" else 1.0 for name in layout.q],
        "ranges": ranges, "bounds": finite, "signals": signals, "branches": [[float(x) for x in q] for q in result],
        "events": [list(row) for row in rows], "resets": [list(row) for row in info.resets], "end": float(plan.end),
        "rtol": float(settings["rtol"]), "atol": np.broadcast_to(settings["atol"], layout.n_x).tolist(),
        "maxStep": settings.get("max_step"), "firstStep": settings.get("first_step"),
        "methods": [method, *FIXED], "operations": CODES,
    }  # fmt: skip


def _way(module: BoundModel) -> Array:
    """Positions of the declared run, so that all of it is in the picture; the start where it cannot be run."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = simulate(module)
        picked: Array = run.q[:, np.linspace(0, len(run.t) - 1, 60).astype(int)]
        return picked
    except EomgenError:
        return scene_position(module)


def _tape(tape: Any) -> list[Any]:
    """Code, numbers and the last instruction of a tape of one value."""
    code, numbers, out = tape
    return [[[CODES.index(op), *places] for op, *places in code], [float(x) for x in numbers], int(out[0])]


def page_text(module: BoundModel, trajectory: Any = None) -> str:
    """The page of a module, with a recorded run where one is given."""
    equations = module.equations
    if equations is None:
        raise cannot("a page is made from a model; this module comes of a generated package, which has no equations")
    plan = plan_run(module, None, None, None, None, None, {}, {})
    method = plan.title if plan.title in METHODS else "DOP853"
    kernels = (*KERNELS, *(("jacobian",) if method == "Radau" else ()))
    about = {"target": "web", "model_digest": module.info.model_digest, "eomgen": module.info.eomgen}
    with _phase("writing the model in C"):
        kinematics, mobility, tree = equations.fresh()
        kinematics, arrows = with_arrows(module, kinematics, mobility, tree)
        program = program_of(kinematics, mobility, tree, about, False, kernels)
        refuse(program)
    with _phase("compiling it to WebAssembly"):
        wasm = compile_wasm(program, method)
    motion = None
    if trajectory is not None:
        bound = module_of(trajectory, module, "a page")
        motion = sample(trajectory, partial(states_at, trajectory, bound), 25.0, None)
    with _phase("running it, for what the picture must hold"):
        scene = build_scene(module, _way(module) if motion is None else motion.x[: module.n_q])
    sizes = [(name, prod(shape)) for name, shape in program.metadata["kernels"].items()]
    model = describe_model(module, method) | {"arrows": arrows, "kernels": sizes}
    model |= {"method": int(plan.title == "RK4"), "step": plan.size or STEP}
    if motion is not None:
        model["x0"] = motion.x[:, 0].tolist()
        reached = {name: float(np.abs(trajectory[name]).max()) for name in module.layout.u}
        model["ranges"] |= {name: [-most, most] for name, most in reached.items() if 0.0 < most < np.inf}
    length = sum(count.total for count in equations.operations.values())
    with _phase("writing the equations"):
        text = f"<p>too long to be shown: {length} operations</p>"
        text = text if length > READ else getattr(equations, "_equations_html", "")
    with _phase("drawing it"):
        return page_html(module, scene, motion, (), model, wasm, text)


@overload
def page(module: BoundModel, /, file: None = None, trajectory: Any = None) -> InlinePage: ...
@overload
def page(module: BoundModel, /, file: Path | str, trajectory: Any = None) -> Path: ...
def page(module: BoundModel, /, file: Path | str | None = None, trajectory: Any = None) -> Path | InlinePage:
    """Write a page in which the mechanism runs: one HTML file that needs no network.

    The model runs as WebAssembly, with the steps of ``simulate``: sliders for parameters and inputs, bodies that can
    be dragged, loops that follow, curves, and the equations of motion.

    Parameters
    ----------
    file : Path or str, optional
        Name that ends in ``.html``; without one, something that a notebook shows.
    trajectory : Trajectory, optional
        A run that the page begins with.

    Returns
    -------
    Path or InlinePage

    Raises
    ------
    ToolchainError
        There is no compiler for WebAssembly (``pip install ziglang``), or it fails.
    ModelError
        The model cannot run in a page: it has impacts, rigid contacts or sampled states without a law.
    UsageError
        The model has no bodies, or the module comes of a generated package; the file does not end in ``.html``.
    """
    if isinstance(trajectory, str | os.PathLike):
        raise ill_typed("the file comes first: page(file, run)")
    path = None if file is None else as_path("file", file)
    if path is not None and path.suffix.lower() != ".html":
        raise bad_file(f"{path}: the name of a page must end in .html")
    text = page_text(module, trajectory)
    if path is None:
        return InlinePage(text)
    write_whole(path, text)
    return path


def generate_web(program: Program, module: BoundModel, directory: Path, version: str) -> Path:
    """Write ``<name>.html`` into a folder; see :func:`~..files.own_file`."""
    return page(module, own_file(directory, f"{program.name}.html", _is_ours))


def _is_ours(path: Path) -> bool:
    with open_plain(path, follow=False) as file:
        return GENERATOR in file.read(2000)
