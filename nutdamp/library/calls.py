"""Plan schemes, compare them, and read schedules."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from os import PathLike

from nutdamp import arguments, comparison, planning, schemes
from nutdamp.arguments import shown
from nutdamp.comparison import Comparison
from nutdamp.errors import BadRequest, nearest
from nutdamp.library.craft import expected
from nutdamp.planning import Plan
from nutdamp.schemes import Choice, Options, SchemeOptions
from nutdamp.spacecraft import Spacecraft


def plan(spacecraft: Spacecraft, scheme: str, options: Choice = None) -> Plan:
    """Plan one scheme and judge it by flying it; an infeasible plan says why.

    Raises BadRequest for a scheme that there is not, or an option that makes no sense.
    """
    (name,) = _names([scheme])
    return planning.plan(expected(spacecraft), name, _options(options))


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
) -> Comparison:
    """Plan the schemes named and recommend one, as ``nutdamp plan`` does; raises as `plan` does.

    Default: the classic three and optimal, or those that point where the file has a target axis. ``samples``: dispersed
    cases of each plan where the file has dispersions, 0 to judge nominal values alone; ``timed``: recommend pulses that
    no command block can fire, too.
    """
    body, chosen = expected(spacecraft), _names(names)
    count = samples if samples in (None, 0) else arguments.count("samples", samples)
    return comparison.compare(body, chosen, _options(options), samples=count, timed=timed)


def load_schedule(path: str | PathLike[str], spacecraft: Spacecraft) -> Plan:
    """The pulses of a CSV file as ``plan --csv`` writes it, as a plan of that name.

    Warns where columns contradict each other or a limit is broken. Raises CannotRead, or FaultyFile.
    """
    from nutdamp.files.schedule_file import read_plan

    body, name = expected(spacecraft), arguments.path("path", path)
    made, remarks = read_plan(name, body)
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    return made


def _names(values: Iterable[str]) -> tuple[str, ...]:
    """Names of schemes that there are; raises BadRequest."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise BadRequest(f"names: expected a list of schemes, such as ['two-pulse'], got {shown(values)}")
    names = tuple(values)
    for name in names:
        if not isinstance(name, str) or name not in schemes.NAMES:
            close = nearest(name, schemes.NAMES) if isinstance(name, str) else None
            cure = f"there are {', '.join(schemes.NAMES)}" if close is None else f"did you mean {close!r}?"
            raise BadRequest(f"there is no scheme {shown(name)}; {cure}")
    return names


def _options(value: Choice) -> Choice:
    """The options of one scheme or several; raises BadRequest for what is none."""
    if value is None or isinstance(value, Options | SchemeOptions):
        return value
    raise BadRequest(f"options: expected nutdamp.Options(…), got {shown(value)}")
