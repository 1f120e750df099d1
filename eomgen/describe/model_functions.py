"""Stage describe, the builder's functions: one method for each type -> an entry of the functions section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any

from ..errors import ill_typed, incomplete
from .build_native import PythonTwin
from .described import Described
from .description import items
from .keywords import names_keywords
from .sympy_face import function


@names_keywords
class FunctionMethods(Described):
    """Methods of Model that declare functions for use in expressions: texts and SymPy."""

    def table(
        self,
        name: str,
        x: Any,
        y: Any,
        z: Any = None,
        kind: str | None = None,
        extrapolation: str | None = None,
    ) -> Any:
        """Declare a smooth function through the points of a table.

        Parameters
        ----------
        name : str
            Identifier.
        x : sequence of floats
            Points, strictly increasing.
        y : sequence of floats
            Values at the points; with ``z``, points along the second argument.
        z : (len(x), len(y)) array, optional
            Values of a function of two arguments on a grid.
        kind : {"cubic", "natural", "periodic", "monotone"}, optional
            ``cubic`` (default) and ``natural`` are splines with continuous curvature, with not-a-knot ends and with
            ends without curvature; ``periodic`` likewise, repeating with the period ``x[-1] - x[0]``, where the last
            value is the first; ``monotone`` (PCHIP) has a continuous slope and never overshoots.  A grid takes
            ``cubic`` or ``natural``.
        extrapolation : {"linear", "constant"}, optional
            Beyond the points: on with the slope of the end (default), or with its value (the slope then jumps).

        Returns
        -------
        sympy.Function
            Call it on SymPy expressions; in texts write ``name(...)``.
        """
        x, y, z = (list(points) if isinstance(points, range) else points for points in (x, y, z))
        given = {"x": x, "y": y, "z": z, "kind": kind, "extrapolation": extrapolation}
        return self._function("table", name, given)

    def native(
        self,
        name: str,
        source: str | PathLike[str],
        function: str | None = None,
        arguments: int | None = None,
        derivatives: Sequence[str | None] | None = None,
        second_derivatives: Sequence[str | None] | None = None,
        python: Callable[..., Any] | str | PathLike[str] | None = None,
        python_derivatives: Sequence[Callable[..., Any] | None] | None = None,
        python_second_derivatives: Sequence[Callable[..., Any] | None] | None = None,
    ) -> Any:
        """Declare a function written in C; its source is compiled with the model and goes into exported packages.

        Parameters
        ----------
        name : str
            Identifier.
        source : str or path
            C file that defines the functions named, each ``double f(double, ...)``; it includes nothing but system
            headers, and its other functions are static.
        function : str, optional
            C function of the value, ``name`` unless given.
        arguments : int, optional
            Their number; that of the derivatives unless given, or 1.
        derivatives : sequence of str or None, optional
            C functions of the derivative along each argument; a missing one is a central difference.
        second_derivatives : sequence of str or None, optional
            Those along arguments 1 1, 1 2, ..., 2 2, ...; a missing one is a central difference of a first one.
        python : callable or path, optional
            The same in Python, for what is evaluated without C: constraints, masses, target ``numpy``.  A callable
            takes floats, one point at a time (a NumPy ufunc: arrays); a file has functions of the same names as the C
            source.
        python_derivatives, python_second_derivatives : sequence of callable or None, optional
            As ``derivatives`` and ``second_derivatives``, if ``python`` is a callable.

        Returns
        -------
        sympy.Function
        """
        twin: Any = None if python is None else str(python) if isinstance(python, str | PathLike) else python
        further: list[Any] = [
            items(() if given is None else given) for given in (python_derivatives, python_second_derivatives)
        ]
        if None in further:
            raise ill_typed(f"native {name}: python_derivatives must be lists of functions")
        if twin is not None and not isinstance(twin, str):
            twin = PythonTwin(twin, *further)
        elif any(further):
            raise incomplete(
                "python_derivatives need a callable python=; a Python file holds derivatives under their C names"
            )
        given = {
            "source": str(source),
            "function": function,
            "arguments": arguments,
            "derivatives": derivatives,
            "second_derivatives": second_derivatives,
            "python": twin,
        }
        return self._function("native", name, given)

    def _function(self, type_name: str, name: str, keys: dict[str, Any]) -> Any:
        given = {key: value for key, value in keys.items() if value is not None}
        self._add("functions", name, {"type": type_name, **given})
        return function(name)
