"""The documentation site: pages in Markdown, notebooks with their stored outputs, references made from the package."""

from __future__ import annotations

import importlib.util
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpydoc.xref

import eomgen

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

from public_methods import documented_classes  # noqa: E402
from tutorial_list import notebooks  # noqa: E402

project, author = "eomgen", "the authors of eomgen"
version = release = eomgen.__version__
copyright = "the authors of eomgen, BSD 3-clause licence"
language = "en"
smartquotes = False  # they make a dash of --option

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "generated_references",
    "glossary_links",
    "links_to_sources",
    "public_methods",
    "tutorial_list",
]
exclude_patterns = ["_build", "_extensions", "**.ipynb_checkpoints"]
nitpicky = True

# Pages and notebooks.  Notebooks are stored with their outputs, and executed by tests of their own.
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline", "attrs_block"]
myst_heading_anchors = 4
nb_execution_mode = "off"
nb_ipywidgets_js: dict[str, Any] = {}  # by default scripts of a network: stored outputs show pictures instead
nb_merge_streams = True

# Documentation from docstrings.
autodoc_typehints = "none"
autodoc_member_order = "groupwise"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = True  # types that have a place in the reference are links, other words are words
numpydoc_xref_ignore = "all"
numpydoc.xref.DEFAULT_LINKS.clear()  # Python's and NumPy's own, whose pages would be requested
numpydoc_xref_aliases = documented_classes()

# What a reader sees.  Formulas are drawn by a MathJax that lies beside the pages, in one file without fonts.
html_theme = "furo"
html_title = "eomgen"
html_static_path = ["_static"]
html_css_files = ["eomgen.css"]
html_show_sourcelink = False
html_copy_source = False
html_show_search_summary = False  # it would fetch pages, which a browser refuses to pages that are files
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5394", "color-brand-content": "#0b5394"},
    "dark_css_variables": {"color-brand-primary": "#7db8f0", "color-brand-content": "#7db8f0"},
}
mathjax_path = "mathjax/tex-svg-full.js"
mathjax3_config = {"options": {"enableMenu": False}}
copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True


def copy_notebooks(app: Any) -> None:
    """Put the notebooks among the pages, where Sphinx looks for them; those that are gone go here too."""
    folder = HERE / "tutorials"
    sources = {path.name: path for path in sorted((HERE.parent / "notebooks").glob("*.ipynb"))}
    for old in folder.glob("*.ipynb"):
        if old.name not in sources:
            old.unlink()
    for name, path in sources.items():
        if not (folder / name).exists() or (folder / name).read_bytes() != path.read_bytes():
            shutil.copyfile(path, folder / name)


def fill_contents(app: Any, name: str, source: list[str]) -> None:
    """Put the notebooks into their table of contents, by their numbers."""
    if name == "tutorials/index":
        source[0] = source[0].replace("NOTEBOOKS", "\n".join(path.stem for path in notebooks()))


def copy_mathjax(app: Any, failure: Exception | None) -> None:
    """Put MathJax beside the pages."""
    if failure is None and app.builder.format == "html":
        found = importlib.util.find_spec("sphinx-mathjax-offline")
        if found is None or found.origin is None:
            raise ModuleNotFoundError("pip install sphinx-mathjax-offline")
        folder = Path(app.outdir) / "_static" / "mathjax"
        folder.mkdir(parents=True, exist_ok=True)
        name = Path(mathjax_path).name
        shutil.copyfile(Path(found.origin).parent / "static" / "mathjax" / name, folder / name)


def make_pages(app: Any, failure: Exception | None) -> None:
    """Pages in which mechanisms run, beside the others that link to them."""
    if failure is None and app.builder.format == "html":
        texts = [(HERE / name).read_text(encoding="utf-8") for name in ("gallery.md", "pictures.md")]
        for name in re.findall(r'<a\s+href="(\w+)\.html">', "".join(texts)):
            eomgen.load_example(name).compile(target="numpy").page(Path(app.outdir) / f"{name}.html")


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("builder-inited", copy_notebooks)
    app.connect("source-read", fill_contents)
    app.connect("build-finished", copy_mathjax)
    app.connect("build-finished", make_pages)
