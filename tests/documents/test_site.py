"""The documentation site builds without a warning; links lead somewhere, no network is asked, pages have pictures."""

from __future__ import annotations

import fcntl
import html
import inspect
import posixpath
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import click
import pytest
from browser import Browser
from site_pages import Page, Site
from sphinx.util.inventory import InventoryFile

import eomgen
from eomgen.cli.command import VERBS
from eomgen.cli.command import eomgen as eomgen_command
from eomgen.constraints import CONSTRAINTS
from eomgen.describe.fields import BODY, COMPONENT, MODEL, SIMULATION, joint_fields
from eomgen.forces import FORCES
from eomgen.joints import JOINTS

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
#: Pages that Sphinx makes, without words of ours.
LISTS = {"genindex", "search", "py-modindex"}

PUBLIC = set(eomgen.__all__) - {"__version__", "errors", "Equations", "Model", "Module", "Signal", "Trajectory"}
#: What users hold: all their public names are documented.
CLASSES = (
    "eomgen.Model",
    "eomgen.api.equations.Equations",
    "eomgen.api.module.Module",
    "eomgen.runtime.trajectory.Trajectory",
    "eomgen.runtime.signals.Signal",
    "eomgen.ensembles.ensemble.Ensemble",
    "eomgen.simulation.impact_trajectory.ImpactRun",
    "eomgen.simulation.integrator.Integrator",
    "eomgen.simulation.sensitivity_result.Sensitivities",
    "eomgen.runtime.minimal.Minimal",
    "eomgen.runtime.canonical.Canonical",
    "eomgen.simulation.dae_solution.Dae",
    "eomgen.kinematics.report.MechanismReport",
    "eomgen.analysis.kinematic_motion.KinematicAnalysis",
    "eomgen.analysis.workspace.Workspace",
    "eomgen.analysis.linearization.Linearization",
    "eomgen.analysis.modes.Modes",
    "eomgen.analysis.balanced.Equilibrium",
    "eomgen.analysis.impact.Impact",
    "eomgen.analysis.drive.ActuatorForces",
    "eomgen.verification.finding.Verification",
    "eomgen.identification.fit_result.Fit",
    "eomgen.describe.handles.BodyHandle",
    "eomgen.describe.handles.SeenMotion",
    "eomgen.describe.element_handles.ForceHandle",
    "eomgen.describe.handles.MarkerHandle",
    "eomgen.describe.handles.JointHandle",
    "eomgen.describe.element_handles.JointReaction",
    "eomgen.describe.element_handles.ConstraintHandle",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Site:
    """The site, built once by whichever process of the tests comes first."""
    base = tmp_path_factory.getbasetemp()
    folder = (base if worker_id == "master" else base.parent) / "site"
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "result").exists():
            words = ["-b", "html", "-W", "-n", "-q", "--keep-going", ROOT / "docs", folder / "html"]
            built = subprocess.run([sys.executable, "-m", "sphinx", *words], capture_output=True, text=True)
            (folder / "result").write_text(
                f"{built.stdout}{built.stderr}" if built.returncode else "", encoding="utf-8"
            )
    said = (folder / "result").read_text(encoding="utf-8")
    assert said == "", said
    return Site(folder / "html")


def test_all_links_within_the_site_lead_somewhere(site: Site) -> None:
    assert len(site.pages) > 40
    assert site.broken_links() == []


def test_no_page_asks_a_network_for_anything(site: Site) -> None:
    assert site.remote_sources() == []
    formulas = [page for page in site.pages.values() if any(x.endswith("mathjax/tex-svg-full.js") for x in page.loaded)]
    assert formulas, "no page draws formulas"


@pytest.mark.needs("chromium")
def test_a_browser_draws_all_formulas_without_a_network(site: Site, tmp_path: Path) -> None:
    with Browser(tmp_path) as browser:
        for name in ("theory/index.html", "theory/special_topics.html"):
            browser.open((site.root / name).as_uri())
            browser.wait_for(
                "document.readyState == 'complete' && document.querySelectorAll('mjx-container').length > 0"
            )
            drawn = browser.evaluate("document.querySelectorAll('mjx-container svg').length")
            assert drawn >= browser.evaluate("document.querySelectorAll('.math').length") > 10
            assert browser.evaluate("document.querySelectorAll('mjx-merror, [data-mml-node=merror]').length") == 0
        browser.open((site.root / "search.html").as_uri() + "?q=spring")
        browser.wait_for("document.querySelectorAll('#search-results li').length > 10")
        assert (browser.requests, browser.complaints) == ([], [])


def test_every_page_has_a_picture_or_says_why_not(site: Site) -> None:
    reasons = tomllib.loads((ROOT / "docs" / "without_pictures.toml").read_text(encoding="utf-8"))["pages"]
    without = {name.removesuffix(".html") for name, page in site.pages.items() if not page.pictures} - LISTS
    assert without - set(reasons) == set(), "each needs a picture, or a reason in docs/without_pictures.toml"
    assert set(reasons) - without == set(), "these pages have a picture now, or are gone: take out their reasons"
    assert all(len(reason) > 15 for reason in reasons.values())


def test_everything_public_is_documented(site: Site) -> None:
    with (site.root / "objects.inv").open("rb") as file:
        shown = {name for kind in InventoryFile.load(file, "", posixpath.join).values() for name in kind}
    missing = [name for name in PUBLIC if f"eomgen.{name}" not in shown and f"eomgen.errors.{name}" not in shown]
    silent = []
    for path in CLASSES:
        module, _, name = path.rpartition(".")
        found = getattr(import_module(module), name)
        own = {word for base in found.__mro__ for word in parameters_in(inspect.getdoc(base) or "")}
        for word in dir(found):
            if word.startswith("_") or word in own or hasattr(tuple, word):
                continue
            homes = {path, *(f"{base.__module__}.{base.__qualname__}" for base in found.__mro__)}
            missing += [f"{path}.{word}"] * (not any(f"{home}.{word}" in shown for home in homes))
            silent += [f"{path}.{word}"] * (not inspect.getdoc(getattr(found, word)))
    assert missing == [], "a page in docs/reference lacks these"
    assert silent == [], "these have no docstring, and the docstring of their class does not tell of them"
    limits = {path.stem for path in (ROOT / "eomgen" / "limits").glob("*.py")} - {"__init__"}
    assert limits - {name.split(".")[2] for name in shown if name.startswith("eomgen.limits.")} == set()


def test_references_hold_every_key_and_every_option(site: Site) -> None:
    keys = {key for kinds in (FORCES, CONSTRAINTS) for kind in kinds.values() for key in kind.keys}
    keys |= {
        *JOINTS,
        *FORCES,
        *CONSTRAINTS,
        *MODEL,
        *BODY,
        *SIMULATION,
        *COMPONENT,
        *(key for j in JOINTS for key in joint_fields(j)),
    }
    text = (site.root / "reference" / "model_file.html").read_text(encoding="utf-8")
    assert {key for key in keys - {"type"} if f">{key}<" not in text} == set()
    text = html.unescape((site.root / "reference" / "command_line.html").read_text(encoding="utf-8"))
    words = {f"eomgen {verb}<" for verb in VERBS}
    for verb in VERBS:
        command = eomgen_command.get_command(click.Context(eomgen_command), verb)
        assert command is not None
        words |= {word for option in command.params for word in option.opts if word.startswith("-")}
    assert {word for word in words if word not in text} == set()


def test_terms_lead_to_the_glossary(site: Site) -> None:
    pages = [name for name, page in site.pages.items() if any("glossary.html#term-" in link for link in page.links)]
    assert len(pages) > 25
    assert any(link == "#term-projection" for link in site.pages["glossary.html"].links)
    twice = [link for link in site.pages["mobility.html"].links if link == "glossary.html#term-change-point"]
    assert len(twice) == 1  # only the first use


def parameters_in(doc: str) -> set[str]:
    """Names that a docstring lists, as attributes or parameters."""
    return {name for line in re.findall(r"^([a-z_, A-Z]+) : ", doc, re.MULTILINE) for name in line.split(", ")}


def test_the_check_finds_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "_static").mkdir()
    (tmp_path / "_static" / "s.css").write_text(
        '@import "//example.org/a.css"; p {background: url( "https://b.org/x" )}'
    )
    (tmp_path / "a.html").write_text(
        '<article id="top"><a href="b.html#there">b</a><a href="b.html#gone">b</a><a href="c.html">c</a>'
        '<a href="https://example.org">far</a><img src="none.png"></article><a href="#top">up</a>'
        '<script src="https://cdn.example.org/x.js"></script><style>p {background: url(https://d.org/y)}</style>'
    )
    (tmp_path / "b.html").write_text('<h1 id="there">b</h1><link rel="canonical" href="https://example.org/b">')
    found = Site(tmp_path)
    assert found.broken_links() == [
        "a.html: b.html#gone has no such anchor",
        "a.html: c.html",
        "a.html: none.png",
    ]
    remote = ["a.html: https://cdn.example.org/x.js", "a.html: https://d.org/y"]
    assert sorted(found.remote_sources()) == [*remote, "s.css: //example.org/a.css", "s.css: https://b.org/x"]
    assert Page(tmp_path / "a.html").pictures == ["none.png"]
    assert Page(tmp_path / "b.html").pictures == []
