"""Public interface of results (to_dict, to_csv, figure ...), whose functions a module of the page
names.

A `Plan` thus writes itself as CSV although its module knows no files.
"""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import finite
from nutdamp.errors import MissingPandas

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame


Table = NDArray[
    np.void
]  # structured array: one row per pulse or sample, fields named as the columns of the CSV files
HOME = "nutdamp.page.results"
"""Module with the table of `view`, ``VIEWS``, loaded when it is needed first.

Its keys are the class of a result and a subject (``Trade.csv``). Its values are
``module:function`` of the package, which takes the result.
"""


Value = str | int | float | None
"""A value of a note; its name ends in the unit: ``_deg``, ``_s``, ``_Nms`` …"""


class Note(NamedTuple):
    """A statement about a result: the code of a sentence in ``guide/notes.md``, and its values."""

    code: str
    items: tuple[tuple[str, Value], ...] = ()

    @property
    def values(self) -> dict[str, Value]:
        """Values by their names."""
        return dict(self.items)

    def of(self, scheme: str) -> Note:
        """The note with the scheme that it is about."""
        return Note(
            self.code, (("scheme", scheme), *(item for item in self.items if item[0] != "scheme"))
        )


def note(code: str, **values: Value) -> Note:
    """A `Note` with ``values``."""
    return Note(code, tuple(values.items()))


def _entry(result: object, what: str) -> str | None:
    views: dict[str, str] = import_module(HOME).VIEWS
    keys = (f"{kind.__name__}.{what}" for kind in type(result).__mro__)
    return next((views[key] for key in keys if key in views), None)


def view(result: object, what: str, *arguments: Any, **options: Any) -> Any:
    """Value of the function for a result and a subject; TypeError for another class."""
    entry = _entry(result, what)
    if entry is None:
        raise TypeError(f"expected a result with {what}, got a {type(result).__qualname__}")
    module, _, function = entry.partition(":")
    return getattr(import_module(f"nutdamp.{module}"), function)(result, *arguments, **options)


def has(result: object, what: str) -> bool:
    """True if there is a `view` of a result."""
    return _entry(result, what) is not None


class Shown:
    """Mixin of results that show themselves at a prompt and in notebooks."""

    def __repr__(self) -> str:
        return str(view(self, "line"))

    def _repr_html_(self) -> str | None:
        shown: str | None = view(self, "html")
        return shown


class Data:
    """Mixin of results that are written as JSON."""

    def to_dict(self) -> dict[str, Any]:
        """Contents of the command's ``--json`` file, or the part that holds this result."""
        return finite(view(self, "data"))


class Drawn:
    """Mixin of results that are drawn."""

    def figure(self, name: str | None = None) -> Figure:
        """Matplotlib figure that the command of this result draws with ``--plot``, by its name if
        it has several.

        Of plans and flights that is ``overview`` (the default) or ``motion``, of plans also
        ``box``.
        Raises BadRequest for other names, MissingExtra without matplotlib, Infeasible for a plan
        without a schedule.
        """
        drawn: Figure = view(self, "figure", *([] if name is None else [name]))
        return drawn


class Written(Drawn):
    """Mixin of results that are written as CSV, too."""

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the rows as the command of this result does with ``--csv`` (a comparison:
        ``--table``).

        Raises CannotWrite, and Infeasible for a plan without a schedule.
        """
        view(self, "save", path)


class Rows(Shown, Written):
    """Mixin of results with rows, which ``numpy.asarray(result)`` gives with the columns of
    `to_csv` as fields.
    """

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(view(self, "table"), dtype, copy=copy is not False)


class Tabled(Rows):
    """Mixin of results with rows, as arrays and data frames."""

    def to_numpy(self) -> Table:
        """Rows with the columns of `to_csv` as fields: ``flight.to_numpy()["nutation_deg"]``."""
        rows: Table = view(self, "table")
        return rows

    def to_pandas(self) -> DataFrame:
        """`to_numpy` as a DataFrame; raises MissingPandas where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise MissingPandas from None
        rows = view(self, "table")
        return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
