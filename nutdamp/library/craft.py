"""A spacecraft as a file, a text or a dict describes it, and variants of it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import arguments
from nutdamp import spacecraft as craft
from nutdamp.errors import BadRequest, Fault
from nutdamp.library.notebook import block
from nutdamp.presentation.text import degrees
from nutdamp.spacecraft import Inertia

if TYPE_CHECKING:
    from nutdamp.files.settings import Setting


class Source(NamedTuple):
    """What a spacecraft was read from: the text of the file, its name in messages, and the keys set beside it."""

    text: str
    name: str
    settings: tuple[Setting, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Spacecraft:
    """A spacecraft as a file describes it; ``core`` holds it in principal axes, for the modules below."""

    core: craft.Spacecraft
    source: Source | None = None

    def with_(self, **keys: object) -> Spacecraft:
        """The spacecraft with keys of its file changed: ``with_(limits={"horizon": "300 s"}, mass=210.0)``.

        Of a mapping only the keys that are in it change, so that the other limits keep their values; entries of a list
        are named by their ``name``: ``thrusters={"T1": {"force": "12 N"}}``. All is checked as the file is. Raises
        FaultyFile with everything wrong, BadRequest for what no file can hold or where no file was read.
        """
        from nutdamp.files.settings import settings_within

        if self.source is None:
            raise BadRequest("with_: expected a spacecraft from nutdamp.load, read or example")
        text, name, before = self.source
        return _read(Source(text, name, (*before, *settings_within(keys))))

    @property
    def name(self) -> str:
        """Its name."""
        return self.core.name

    @property
    def inertia(self) -> Inertia:
        """Principal moments (kg m²), the inertia ratio ``a`` and the shape."""
        return self.core.inertia

    @property
    def rates(self) -> NDArray[np.float64]:
        """Body rates at t = 0, (3,) rad/s, in the axes of the file."""
        return self.core.inertia.in_file(self.core.omega0)

    @property
    def nutation(self) -> float:
        """Nutation angle at t = 0, rad."""
        return self.core.nutation

    @property
    def body_period(self) -> float:
        """Nutation period seen in the body, s; infinite for a sphere."""
        return self.core.body_period

    @property
    def inertial_period(self) -> float:
        """Nutation period seen inertially, s."""
        return self.core.inertial_period

    @property
    def least_impulse(self) -> float:
        """A|ω0| in N m s: no schedule of a symmetric body removes the nutation with less."""
        return self.core.least_impulse

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that can be fired."""
        return tuple(channel.name for channel in self.core.channels)

    def to_dict(self) -> dict[str, Any]:
        """What the JSON files say of a spacecraft."""
        from nutdamp.files.output import finite
        from nutdamp.files.plan_json import spacecraft_json

        return finite(spacecraft_json(self.core))

    def __repr__(self) -> str:
        inertia = self.inertia
        return f"<Spacecraft {self.name}: {inertia.shape}, a = {inertia.a:.4g}, nutation {degrees(self.nutation)}>"

    def _repr_html_(self) -> str:
        from nutdamp.presentation.page.sheets import spacecraft_facts

        return block(spacecraft_facts(self.core, title=self.name))


def load(
    path: str | PathLike[str] | Mapping[str, object],
    *,
    set: Mapping[str, object] | None = None,  # noqa: A002 - as --set
) -> Spacecraft:
    """The spacecraft in a file (YAML or JSON), or in a dict of the keys of such a file.

    ``set`` changes keys of the file as ``--set`` does: ``{"limits.horizon": "300 s", "thrusters.T1.force": 12.0}``.
    Raises CannotRead, BadRequest, or FaultyFile with everything wrong: in a dict, lines count in its JSON.
    """
    from nutdamp.files.settings import settings_of, text_of
    from nutdamp.files.yaml_tree import read_text

    if isinstance(path, Mapping):
        return _read(Source(text_of(path, "dict"), "dict", settings_of(arguments.changes(set))))
    name = arguments.path("path", path, "the name of a file or a dict of its keys")
    settings = settings_of(arguments.changes(set))
    return _read(Source(read_text(Path(name)), name, settings))


def read(text: str, name: str = "text") -> Spacecraft:
    """The spacecraft in the ``text`` of a file; raises FaultyFile, whose faults call the file ``name``."""
    arguments.instance("text", text, str, "the text of a spacecraft file (nutdamp.load reads files)")
    return _read(Source(text, arguments.instance("name", name, str, "a text")))


def example() -> Spacecraft:
    """The built-in example, which ``nutdamp init`` writes."""
    from nutdamp.files.spacecraft_file import built_in_example_text

    return _read(Source(built_in_example_text(), "example.yaml"))


def _read(source: Source) -> Spacecraft:
    """The spacecraft; warns of numbers that are hardly what was meant, where the library was called."""
    from nutdamp.files.spacecraft_file import read_spacecraft

    doubts: list[Fault] = []
    body = read_spacecraft(source.text, source.name, source.settings, doubts.append)
    for doubt in doubts:
        warnings.warn(doubt.as_warning, stacklevel=3)
    return Spacecraft(body, source)


def core_of(spacecraft: Spacecraft) -> craft.Spacecraft:
    """What the modules below take; raises BadRequest for what is no `Spacecraft`."""
    return arguments.instance("spacecraft", spacecraft, Spacecraft, "a Spacecraft, as nutdamp.load gives it").core
