"""Public interface of results (to_dict, to_csv, figure ...), whose functions `nutdamp.api` names in `VIEWS`.

A `Plan` thus writes itself as CSV although its module knows no files. The functions are there as soon as a public name
of `nutdamp` is used; without them these methods raise TypeError.
"""

from __future__ import annotations

from importlib import import_module
from operator import attrgetter
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import finite
from nutdamp.errors import MissingPandas

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure
    from pandas import DataFrame


Table = NDArray[np.void]
"""Structured array: one row per pulse or sample, fields named as the columns of the CSV files."""

VIEWS: dict[str, dict[str, str]] = {}
"""Functions by the class of a result and by their subject, loaded when they are called first.

``module:function`` of the package takes the result, ``module:function name key=name`` these attributes of it.
"""


def view(result: object, what: str, *arguments: Any, **options: Any) -> Any:
    """Value of the function of `VIEWS` for a result; TypeError where its class and its bases have none."""
    for kind in type(result).__mro__:
        if what in VIEWS.get(kind.__name__, ()):
            place, *names = VIEWS[kind.__name__][what].split()
            module, _, function = place.partition(":")
            keyed = [name.split("=") for name in names if "=" in name]
            parts = [attrgetter(name)(result) for name in names if "=" not in name]
            named = {key: attrgetter(name)(result) for key, name in keyed}
            call = getattr(import_module(f"nutdamp.{module}"), function)
            return call(*(parts if names else [result]), *arguments, **named, **options)
    raise TypeError(f"expected a result with {what}, got a {type(result).__qualname__}")


def has(result: object, what: str) -> bool:
    """True if there is a `view` of a result."""
    return any(what in VIEWS.get(kind.__name__, ()) for kind in type(result).__mro__)


class Shown:
    """Mixin of results that show themselves at a prompt and in notebooks."""

    def __repr__(self) -> str:
        return str(view(self, "line")) if VIEWS else object.__repr__(self)

    def _repr_html_(self) -> str | None:
        shown: str | None = view(self, "html")
        return shown


class Data:
    """Mixin of results that are written as JSON."""

    def to_dict(self) -> dict[str, Any]:
        """Contents of the file that the command of this result writes with ``--json``, or the part that holds it."""
        return finite(view(self, "data"))


class Written:
    """Mixin of results that are written as CSV and drawn."""

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the rows as the command of this result does with ``--csv`` (a comparison: ``--table``).

        Raises CannotWrite, and Infeasible for a plan without a schedule.
        """
        view(self, "save", path)

    def figure(self, name: str | None = None) -> Figure:
        """Matplotlib figure that the command of this result draws with ``--plot``, by its name if it has several.

        Of a comparison that is ``schemes``; of plans and flights ``overview`` (the default), ``motion``, ``sphere``,
        ``history`` or ``timeline``. Raises BadRequest for other names, MissingExtra without matplotlib, Infeasible for
        a plan without a schedule.
        """
        drawn: Figure = view(self, "figure", *([] if name is None else [name]))
        return drawn


class Tabled(Shown, Written):
    """Mixin of results with rows."""

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
        rows = self.to_numpy()
        return pandas.DataFrame({name: rows[name] for name in rows.dtype.names or ()})
