"""A spacecraft as a file, a text or a dict describes it, and variants of it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nutdamp import arguments
from nutdamp.errors import Fault
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:
    from nutdamp.files.settings import Setting


class Source(NamedTuple):
    """What a spacecraft was read from: the text of the file, its name in messages, and the keys set beside it."""

    text: str
    name: str
    settings: tuple[Setting, ...] = ()

    def changed(self, keys: Mapping[str, object]) -> Spacecraft:
        """See `Spacecraft.with_`."""
        from nutdamp.files.settings import settings_within

        return _read(self._replace(settings=(*self.settings, *settings_within(keys))), above=4)


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


def example(name: str = "example") -> Spacecraft:
    """The built-in example, or the one of that ``name`` among those of ``nutdamp init --list``.

    Raises BadRequest for any other name.
    """
    from nutdamp.files.examples import example_names, example_text

    known = arguments.one_of("name", name, example_names())
    return _read(Source(example_text(known), f"{known}.yaml"))


def _read(source: Source, above: int = 3) -> Spacecraft:
    """The spacecraft; warns of numbers that are hardly meant, ``above`` calls up: where the library is used."""
    from nutdamp.files.spacecraft_file import read_spacecraft

    doubts: list[Fault] = []
    body = read_spacecraft(source.text, source.name, source.settings, doubts.append)
    for doubt in doubts:
        warnings.warn(doubt.as_warning, stacklevel=above)
    object.__setattr__(body, "source", source)  # which its fields are not made of: `replace` drops it
    return body


def expected(spacecraft: Spacecraft) -> Spacecraft:
    """A spacecraft; raises BadRequest for anything else."""
    return arguments.instance("spacecraft", spacecraft, Spacecraft, "a Spacecraft, as nutdamp.load gives it")
