"""Equations -> the worked solution, in sections, and its HTML, Markdown and LaTeX."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.files import write_whole
from ..contact.pairs import opaque_names
from ..errors import EomgenError, MissingDependencyError, bad_file, no_such
from ..expr.notation import Notation
from ..reading.document import DrawnPicture, Folded, Piece, Section, write_html, write_markdown, write_tex

if TYPE_CHECKING:
    from .author import Author

SUFFIXES = (".html", ".md", ".tex", ".pdf")
LEVELS = ("full", "short")


class Explanation:
    """A worked solution: how the equations of motion follow from the mechanism, with numbers.

    Attributes
    ----------
    html : str
        A page that stands alone and needs no network; formulas are MathML.
    markdown : str
        Text with formulas between dollars.
    latex : str
        A document for pdflatex.
    difference : float or None
        Largest difference between the shown formulas, evaluated through SymPy at random consistent states, and the
        compiled module, as a share of the largest entry or term; None where parameters have no values.
    sections : tuple of Section
    """

    def __init__(self, title: str, sections: Sequence[Section], names: Notation, difference: float | None) -> None:
        self.title, self.sections, self.difference = title, tuple(sections), difference
        self._names = names

    @cached_property
    def html(self) -> str:
        """A page that stands alone."""
        return write_html(self.title, self.sections, self._names)

    @cached_property
    def markdown(self) -> str:
        """Text with formulas between dollars."""
        return write_markdown(self.title, self.sections, self._names)

    @cached_property
    def latex(self) -> str:
        """A document for pdflatex; the picture is the file that :meth:`save` writes beside it."""
        return write_tex(self.title, self.sections, self._names)

    def save(self, file: str | Path) -> Path:
        """Write the document; the ending of the name says in which form.

        Parameters
        ----------
        file : str or Path
            ``.html``, ``.md``, ``.tex`` or ``.pdf``.  Beside a ``.tex`` file its picture is written too, under the
            same name with ``.png``.

        Returns
        -------
        Path

        Raises
        ------
        UsageError
            Another ending.
        MissingDependencyError
            A ``.pdf`` without pdflatex, or one that fails.
        """
        path = Path(file)
        if path.suffix == ".html":
            write_whole(path, self.html)
        elif path.suffix == ".md":
            write_whole(path, self.markdown)
        elif path.suffix == ".tex":
            self._save_tex(path)
        elif path.suffix == ".pdf":
            self._save_pdf(path)
        else:
            raise bad_file(f"{path.name!r} must end in one of {', '.join(SUFFIXES)}")
        return path

    def _save_tex(self, path: Path) -> None:
        picture = next(_pictures(self.sections), None)
        name = f"{path.stem}.png"
        text = write_tex(self.title, self.sections, self._names, None if picture is None else name)
        if picture is not None:
            write_whole(path.with_name(name), picture.png)
        write_whole(path, text)

    def _save_pdf(self, path: Path) -> None:
        program = shutil.which("pdflatex")
        if program is None:
            raise MissingDependencyError(
                "a .pdf needs pdflatex: install TeX Live (Debian: apt install texlive-latex-extra), or save "
                ".html and print it"
            )
        with tempfile.TemporaryDirectory() as folder:
            self._save_tex(Path(folder) / "document.tex")
            command = [program, "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "document.tex"]
            done = subprocess.run(command, cwd=folder, capture_output=True, check=False, errors="replace", text=True)
            made = Path(folder) / "document.pdf"
            if done.returncode or not made.is_file():
                wrong = next((line for line in done.stdout.splitlines() if line.startswith("!")), "no reason given")
                raise MissingDependencyError(f"pdflatex failed: {wrong}; save .tex and compile it to see more")
            write_whole(path, made.read_bytes())

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        verdict = "not compared" if self.difference is None else f"difference {self.difference:.1e}"
        return f"<{self.title}: {len(self.sections)} sections, {verdict}>"


def _pictures(sections: Sequence[Section]) -> Any:
    """All pictures of a document."""
    pending: list[Piece] = [piece for section in sections for piece in section.pieces]
    for piece in pending:
        if isinstance(piece, Folded):
            pending += piece.pieces
        if isinstance(piece, DrawnPicture):
            yield piece


def explain(equations: Any, level: str = "full") -> Explanation:
    """See :meth:`eomgen.api.equations.Equations.explain`."""
    from . import about_methods
    from . import sections as about
    from .author import Author
    from .comparison import compare, moving_state, state_numbers

    if level not in LEVELS:
        raise no_such(f"no level {level!r}; there are {', '.join(LEVELS)}")
    full = level == "full"
    author = Author(equations, full)
    module, reason = _module(author)
    sections: list[Section | None] = [about.mechanism(author, module), about.bodies(author), about.coordinates(author)]
    details: list[Section | None] = []
    if full:
        details += [*about.motion(author), about.constraints(author), *about.forces(author)]
        details += [about_methods.energies(author), about_methods.steps(author)]
    final = about_methods.final(author)
    numbers: list[Section | None] = [about.states(author), about.counts(author)]
    if full:
        state, moved = {}, False
        if module is not None:
            x, moved = moving_state(module, author.independent_velocities)
            state = state_numbers(module, x)
        numbers.append(about.calculation(author, state, reason, moved))
    result = None if module is None else compare(author, module)
    sections += [*map(_folded, details), final, *map(_folded, numbers), about.difference(result, reason)]
    title = f"Equations of motion of `{equations.name}`, method `{equations.method}`"
    if author.substituted:
        values = ("open" if x is None else f"{x:.6g}" for x in author.substituted.values())
        title += f", with {', '.join(f'`{n}` = {x}' for n, x in zip(author.substituted, values, strict=True))}"
    kept = [section for section in sections if section is not None]
    return Explanation(title, kept, author.names, None if result is None else result.largest)


def _folded(section: Section | None) -> Section | None:
    """A section that a page shows on request."""
    return section._replace(folded=True) if section is not None and section.level == 1 else section


def _module(author: Author) -> tuple[Any, str]:
    """The module of the equations on NumPy, with the values that were put in, or None and why it has no state."""
    equations = author.source
    functions = opaque_names(equations.kinematics.graph)
    if functions:
        return None, f"The formulas hold tables or functions, which SymPy cannot evaluate: {', '.join(functions)}."
    from ..pipeline import compile_core
    from ..runtime.bound_model import BoundModel

    k = equations.kinematics
    try:
        values = {name: value for name, value in author.substituted.items() if value is not None}
        p, u = ({n: values[n] for n in names if n in values} for names in (k.parameter_names, k.input_names))
        module = BoundModel(compile_core(equations, "numpy"), p or None, u or None)
        module.x0()
    except EomgenError as error:
        return None, str(error)
    return module, ""
