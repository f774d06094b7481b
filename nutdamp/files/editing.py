"""Values of a spacecraft file replaced: keys set beside it, such as ``limits.horizon=300s``, and
values in its text.

A key set beside the file changes its tree before anything in it is checked, so that settings are
checked exactly as the file is. In the text, comments, the order of the keys and units stay as they
were; it must have been read by `yaml.read_tree`, and so is neither a bomb nor of other than core
values. A goal beside the file is for one command or call. `motion_edits` are the values of a later
moment, by which a file is carried on.
"""

from __future__ import annotations

import ast
import datetime
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeVar

import numpy as np

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile, SenselessOption, cure_of
from nutdamp.files.yaml import MAX_DEPTH, KeyPath, Node, Place, dotted, read_tree, read_value
from nutdamp.physics import attitude, frames
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.units import FASTEST, KINDS, Angles, Bare, angles, parse, reading, shown, word

_QUOTED = r"""'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*\""""
_STEP = re.compile(
    rf"\.?(?P<word>[^.\[\]='\"]+|{_QUOTED})|\[(?P<entry>[0-9]{{1,6}}|[^.\[\]='\"]+|{_QUOTED})\]"
)

Argument = TypeVar("Argument")


class Setting(NamedTuple):
    """A key and its new value (a text is YAML), given in a ``call``; entries of lists go by
    position or ``name``.
    """

    call: str
    path: KeyPath
    value: object

    @property
    def label(self) -> str:
        """Its name in messages."""
        text = self.value if isinstance(self.value, str) else shown(self.value)
        brief = text if len(text) <= 40 and text.isprintable() else shown(text)
        return f"{self.call} {dotted(self.path)}={brief}"

    def node(self) -> tuple[Node, list[Fault]]:
        """The value as part of a tree, and its faults; raises `FaultyFile` for a text that is not
        YAML.
        """
        place = Place(setting=self.label)
        if not isinstance(self.value, str):
            return _of_python(self.value, place), []
        if not self.value.strip():
            return Node(None, place), []
        node, faults = read_value(self.value, self.label)
        return _of_python(node.plain(), place), faults


def parse_setting(text: str) -> Setting:
    """The setting in ``KEY=VALUE``, as command lines give it; raises ValueError with the form
    expected.
    """
    path, end = _parse_path(text)
    if not path or text[end : end + 1] != "=":
        raise ValueError(
            f"{shown(text)} is not KEY=VALUE, such as limits.horizon=300s or thrusters.T1.force=12N"
        )
    return Setting("--set", path, text[end + 1 :])


def settings_of(values: Mapping[str, object]) -> tuple[Setting, ...]:
    """The settings in a mapping of keys, such as ``limits.horizon``, to values;
    raises BadRequest.
    """
    settings = []
    for key, value in values.items():
        path, end = _parse_path(key)
        if not path or end < len(key):
            raise BadRequest(
                f"{shown(key)} is not a key of a spacecraft file, such as limits.horizon"
            )
        settings.append(Setting("set", path, value))
    return tuple(settings)


def settings_within(values: Mapping[str, object], behind: KeyPath = ()) -> Iterator[Setting]:
    """The settings in nested mappings at ``behind``, key by key, so that others stay; raises
    BadRequest.
    """
    if len(behind) >= MAX_DEPTH:
        raise BadRequest(f"with_ {dotted(behind[:1])}: nested more than {MAX_DEPTH} levels deep")
    for key, value in values.items():
        if not isinstance(key, str):
            raise BadRequest(
                f"with_ {dotted(behind)}: expected the name of a key, got {shown(key)}"
            )
        path = (*behind, key)
        if isinstance(value, Mapping):
            yield from settings_within(value, path)
        else:
            yield Setting("with_", path, value)


def text_of(values: Mapping[str, object], name: str) -> str:
    """The text of a spacecraft file with these keys and values, as JSON; raises BadRequest."""
    plain = _of_python(values, Place(setting=name)).plain()
    return json.dumps(plain, indent=2, ensure_ascii=False) + "\n"


def overlay(root: Node, settings: Iterable[Setting]) -> tuple[Node, list[Fault]]:
    """The tree with the settings in it, one after the other,
    and the faults of impossible settings.
    """
    faults: list[Fault] = []
    for setting in settings:
        place = Place(setting=setting.label)
        try:
            if len(setting.path) > MAX_DEPTH:
                raise _NoPlaceError(f"nested more than {MAX_DEPTH} levels deep")
            node, problems = setting.node()
            root = _put(root, setting.path, (), node, place)
        except FaultyFile as wrong:
            problems = wrong.faults
        except _NoPlaceError as wrong:
            problems = [place.fault("", "", str(wrong))]
        # Lines and columns within a setting would be taken for those of the file.
        faults += [
            Fault(setting.label, 0, 0, dotted(setting.path), fault.problem) for fault in problems
        ]
    return root, faults


class _NoPlaceError(Exception):
    """The tree has no place for a setting; the text is the reason."""


def _parse_path(text: str) -> tuple[KeyPath, int]:
    """The steps at the beginning of a text, as `dotted` writes them, and where they end."""
    path: list[str | int] = []
    end = 0
    while match := _STEP.match(text, end):
        if match["word"] and bool(path) != (match[0][0] == "."):
            break
        step = match["word"] or match["entry"]
        if match["entry"] and step.isdecimal():
            path.append(int(step))
        else:
            try:
                path.append(ast.literal_eval(step) if step[0] in "'\"" else step.strip())
            except (SyntaxError, ValueError):  # such as a broken escape
                break
        end = match.end()
    return tuple(path), end


def _put(node: Node, path: KeyPath, behind: KeyPath, value: Node, place: Place) -> Node:
    """``node``, at ``behind``, with ``value`` at ``path`` below it; copied, since aliases may share
    it.
    """
    if not path:
        return value
    step, rest = path[0], path[1:]
    held = {} if node.value is None else node.value
    at = f"at {dotted(behind) or 'the root'}"
    if isinstance(held, dict):
        if isinstance(step, int):
            raise _NoPlaceError(f"there is no list {at}; give all of it, as [value, …]")
        child = _put(held.get(step) or Node(None, place), rest, (*behind, step), value, place)
        keys = node.keys if rest and step in node.keys else {**node.keys, step: place}
        return replace(node, value={**held, step: child}, keys=keys)
    if isinstance(held, list):
        index = _entry(held, step, behind)
        child = _put(held[index], rest, (*behind, index), value, place)
        return replace(node, value=[*held[:index], child, *held[index + 1 :]])
    raise _NoPlaceError(f"there are no keys {at}, which holds {shown(node.plain())}")


def _entry(entries: list[Node], step: str | int, behind: KeyPath) -> int:
    """The position in a list that ``step`` means, itself a position or the name of an entry."""
    if isinstance(step, int):
        if step < len(entries):
            return step
        last = len(entries) - 1
        raise _NoPlaceError(
            f"{dotted(behind)} has " + (f"entries 0 to {last} only" if entries else "no entries")
        )
    nodes = [entry.get("name") for entry in entries]
    names = [node.value if node is not None else None for node in nodes]
    if step in names:
        return names.index(step)
    texts = [name for name in names if isinstance(name, str)]
    if not texts:
        raise _NoPlaceError(
            f"expected a position, such as {dotted((*behind, 0))}: the entries have no names"
        )
    raise _NoPlaceError(
        f"no entry of {dotted(behind)} has the name {shown(step)}; {cure_of(step, texts)}"
    )


def _of_python(value: object, place: Place, path: KeyPath = ()) -> Node:
    """A Python value, at ``path``, as part of a tree; raises BadRequest for one that a file cannot
    hold.

    Dates and times are the texts that ``yaml.safe_load`` made them of.
    """
    if len(path) > MAX_DEPTH:
        raise BadRequest(f"{place}: {dotted(path[:1])}: nested more than {MAX_DEPTH} levels deep")
    if value is None or isinstance(value, str | bool | int | float):
        return Node(value, place)
    if isinstance(value, datetime.date):
        return Node(value.isoformat(), place)
    if isinstance(value, Integral):
        return Node(int(value), place)
    if isinstance(value, Real):
        return Node(float(value), place)
    if isinstance(value, Mapping):
        below = {
            str(key): _of_python(child, place, (*path, str(key))) for key, child in value.items()
        }
        return Node(below, place, dict.fromkeys(below, place))
    if isinstance(value, Iterable):
        entries = [_of_python(child, place, (*path, row)) for row, child in enumerate(value)]
        return Node(entries, place)
    where = ": ".join(filter(None, (str(place), dotted(path))))
    raise BadRequest(
        f"{where}: expected a number, a text, a date, a list or a mapping, got "
        f"{type(value).__name__}"
    )


def aimed(
    spacecraft: Spacecraft,
    doubt: Callable[[str], object],
    *,
    target: object = None,
    spin: object = None,
    sun: object = None,
    sun_angle: float | None = None,
) -> Spacecraft:
    """Spacecraft with a goal given beside its file, for one command or call.

    ``target``, ``sun``: `nutdamp.units.angles`, right ascension and declination where the file has
    an attitude, else tilt and azimuth in the frame N; ``spin``: a rate or ``keep``;
    ``sun_angle``: rad, of a target from the Sun. ``doubt`` is called with the readings of numbers
    that are hardly meant. Raises SenselessOption.
    """
    goal = spacecraft.goal
    if target is not None:
        axis = _direction(spacecraft, "target", target, doubt)
        goal = replace(goal, axis=axis, sun_angle=None)
    if sun_angle is not None:
        problem = ""
        if target is not None:
            problem = "given together with --target; keep one of the two"
        elif not 0.0 <= sun_angle <= math.pi:
            readings = Angles(sun_angle, 0.0).readings
            problem = "; ".join(("expected an angle of 0 to 180 deg", *readings))
        elif spacecraft.sun is None:
            problem = "needs the key sun of the file: [right ascension, declination], or sun: epoch"
        if problem:
            raise SenselessOption("sun_angle", shown(sun_angle), problem)
        axis = directions.at_sun_angle(spacecraft, sun_angle)
        goal = replace(goal, axis=axis, sun_angle=float(sun_angle))
    if sun is not None:
        goal = replace(goal, sun=_direction(spacecraft, "sun", sun, doubt))
    if spin is not None:
        rate = spacecraft.spin
        if not isinstance(spin, str) or spin != "keep":
            rate = _argument("spin", spin, word, "rate")
        if rate * spacecraft.spin <= 0.0:
            problem = f"expected a rate with the sign of the spin ({spacecraft.spin:.4g} rad/s)"
            raise SenselessOption("spin", shown(spin), problem)
        if isinstance(rate, Bare) and (rate.is_integer() or abs(rate) > FASTEST):
            doubt(f"spin: {reading(rate, 'rate', 'rpm')}")
        goal = replace(goal, spin=rate)
    result = replace(spacecraft, goal=goal)
    object.__setattr__(result, "source", spacecraft.source)
    return result


def _direction(
    spacecraft: Spacecraft, name: str, value: object, doubt: Callable[[str], object]
) -> Vector:
    """The unit vector (3,) that two angles name, inertial; raises SenselessOption where they name
    none.
    """
    pair = _argument(name, value, angles, "right ascension")
    in_sky = spacecraft.attitude is not None
    if abs(pair.second) <= 0.5 * math.pi if in_sky else 0.0 <= pair.first < math.pi:
        for text in pair.readings:
            doubt(f"{name}: {text}")
        return frames.on_sphere(*pair) if in_sky else directions.direction_in_n(spacecraft, *pair)
    problem = "expected a declination of -90 deg to 90 deg"
    if not in_sky:
        problem = "expected a tilt of at least 0 and below 180 deg"
    raise SenselessOption(name, shown(value), "; ".join((problem, *pair.readings)))


def _argument(
    name: str, value: object, read: Callable[[object, str], Argument], kind: str
) -> Argument:
    """The value as ``read``; raises SenselessOption."""
    try:
        return read(value, kind)
    except ValueError as wrong:
        raise SenselessOption(name, shown(value), str(wrong)) from None


def edited(text: str, values: Mapping[KeyPath, str]) -> str:
    """The text with ``values``, each a flow value by its path.

    A key that is not there is added, at the end of the mapping it belongs to, which must be there
    but for the first level. Raises BadRequest for an alias, and for what has one: a change would
    show in the other place too.
    """
    for path, value in values.items():
        held = read_tree(text, "edited")[0]
        indent = ""
        for depth, step in enumerate(path):
            node = held.get(step)
            if node is None:
                text = _added(text, held, path[depth:], value)
                break
            where = dotted(path[: depth + 1])
            key = held.keys.get(str(step))
            if key is not None and node.place.offset < key.offset:
                raise BadRequest(f"{where} is an alias: write its value out, for it to be changed")
            anchor = re.match(r"&(\S+)", text[node.place.offset :])
            if anchor and f"*{anchor[1]}" in text:
                raise BadRequest(
                    f"{where} has the alias *{anchor[1]}: write that out, for it to be changed"
                )
            # The entries of a block may stand as far left as its key; a flow value may not.
            left = (
                key is not None and node.place.line > key.line and node.place.column <= key.column
            )
            indent = "  " * left
            held = node
        else:
            text = text[: held.place.offset] + indent + value + text[held.end :]
    return text


def _added(text: str, parent: Node, path: KeyPath, value: str) -> str:
    """The text with a new key in a mapping; further steps of the path become flow mappings."""
    for step in reversed(path[1:]):
        value = flow({step: value})
    entry = f"{key_text(path[0])}: {value}"
    if not isinstance(parent.value, dict):
        raise BadRequest(f"{dotted(path)}: its parent holds no keys")
    if parent.flow:
        last = parent.end - 1
        comma = "" if not parent.value or text[:last].rstrip().endswith(",") else ", "
        at = len(text[:last].rstrip()) if comma else last
        return text[:at] + comma + entry + text[at:]
    line_end = text.find("\n", parent.end)
    at = len(text) if line_end < 0 else line_end
    indent = " " * (next(iter(parent.keys.values())).column - 1)
    return f"{text[:at]}\n{indent}{entry}{text[at:]}"


def key_text(step: str | int) -> str:
    """A key as a mapping has it, in quotes unless it is plain words."""
    word = str(step)
    return (
        word
        if re.fullmatch(r"[+-]?[A-Za-z_][\w+-]*( [\w+-]+)*", word)
        else "'" + word.replace("'", "''") + "'"
    )


NOISE = 1e-13  # nutation, rad, that is rounding


class Edit(NamedTuple):
    """A value at a path, as `flow` has it, or a number of a ``kind`` of quantity, in SI, for the
    unit that the file has.
    """

    path: KeyPath
    value: Any
    kind: str = ""


Edits = Iterator[Edit]


class Later(NamedTuple):
    """The spacecraft ``before`` of a file, and ``after``: as it is to be at t = 0 from now on.

    ``quaternion`` is that of the principal axes of ``after``, in the frame of ``before``.
    """

    before: Spacecraft
    after: Spacecraft
    quaternion: np.ndarray


def motion_edits(tree: Node, later: Later) -> Edits:
    """Moments, motion, attitude, epoch, and the target where it counts from the motion."""
    yield from inertia_edits(tree, later)
    yield from rate_edits(tree, later)
    yield from attitude_edits(tree, later)
    # Tilt and azimuth count from the motion at t = 0, which is another one now.
    target = later.before.goal.axis
    if target is None or tree.get("goal", "tilt") is None:
        return
    in_body = attitude.rotate(attitude.conjugate(later.quaternion), target)
    to_n = replace(later.after, attitude=None).initial.quaternion
    x, y, z = attitude.rotate(to_n, in_body).tolist()
    yield Edit(("goal", "tilt"), math.atan2(math.hypot(x, y), z), "angle")
    yield Edit(("goal", "azimuth"), math.atan2(y, x), "angle")


def inertia_edits(tree: Node, later: Later) -> Edits:
    """Moments of inertia, and the momentum of a wheel."""
    inertia = later.after.inertia
    if inertia.wheel != later.before.inertia.wheel:
        yield Edit(("wheel", "momentum"), inertia.wheel, "momentum")
    if tree.get("inertia", "tensor") is None and inertia.symmetric:
        yield Edit(("inertia", "A"), inertia.A, "inertia")
        yield Edit(("inertia", "C"), inertia.C, "inertia")
        return
    tensor = inertia.axes @ np.diag(inertia.moments) @ inertia.axes.T
    tensor = 0.5 * (tensor + tensor.T)
    if tree.get("inertia", "tensor") is None:
        yield Edit(("inertia",), {"tensor": tensor})
    else:
        yield Edit(("inertia", "tensor"), tensor)


def rate_edits(tree: Node, later: Later) -> Edits:
    """Rates at t = 0, as the file gives them."""
    inertia, rates = later.after.inertia, later.after.rates
    if tree.get("state") is None:
        for index, rate in enumerate(rates.tolist()):
            yield Edit(("omega0", index), rate, "rate")
    elif inertia.symmetric and inertia.aligned:
        first, second, spin = later.after.omega0.tolist()
        angle = rigid_body.nutation_angle(
            inertia.A, inertia.C, math.hypot(first, second), inertia.equivalent(spin)
        )
        phase = math.atan2(second, first)
        if angle < NOISE:
            angle = phase = 0.0
        yield Edit(("state", "spin"), spin, "rate")
        yield Edit(("state", "nutation"), angle, "angle")
        yield Edit(("state", "phase"), phase, "angle")
    else:
        yield Edit(("state",), rates)


def epoch_after(epoch: str, time: float) -> str:
    """Epoch in UTC ``time`` s after another; raises BadRequest past the year 9999."""
    try:
        whole, _, part = Epoch.parse(epoch).plus(time).text.partition(".")
    except ValueError:
        raise BadRequest(f"attitude.epoch: {time:.4g} s after it the year 9999 is over") from None
    return f"{whole}.{part}".rstrip("0").rstrip(".") + "Z"


def attitude_edits(tree: Node, later: Later) -> Edits:
    """Attitude, epoch and frame; nothing for a body without attitude."""
    after, old = later.after, later.before.attitude
    turned = start = after.attitude
    if turned is None or start is None:
        return
    if old is not None:  # the other directions of the file stay in its frame
        start = replace(start, epoch=old.epoch)
        turned = start.seen_in(old.frame, turned.epoch)
    of = tree.get("attitude", "of")
    vector = None if of is None else str(of.value)
    keys: dict[str, Any] = {"quaternion": turned.quaternion}
    if tree.get("attitude", "spin_axis") is not None:
        axis = attitude.unit(after.momentum) if vector == "momentum" else after.axis
        axis = turned.axes.T @ start.axes @ axis
        first = attitude.rotate(turned.quaternion, np.array([1.0, 0.0, 0.0]))
        places: dict[KeyPath, float] = {
            ("spin_axis", 0): attitude.full_turn(math.atan2(axis[1], axis[0])),
            ("spin_axis", 1): math.atan2(axis[2], math.hypot(axis[0], axis[1])),
            ("phase",): frames.phase_about(first, axis, frames.ascending_node(axis)),
        }
        ascension, declination, phase = (
            as_before(tree.get("attitude", *path), angle, "angle") for path, angle in places.items()
        )
        keys = {"spin_axis": [ascension, declination], "phase": phase}
    for key in ("epoch", "frame"):
        value = getattr(turned, key)
        if value is not None and (old is None or value != getattr(old, key)):
            keys[key] = value
    # No attitude before, or from the side of the Sun, which may be elsewhere by now.
    if tree.get("attitude") is None or tree.get("attitude", "sun_phase") is not None:
        others = {"of": vector, "epoch": turned.epoch, "frame": turned.frame}
        yield Edit(("attitude",), keys | {key: value for key, value in others.items() if value})
        return
    for key, value in keys.items():
        yield Edit(("attitude", key), value)


def carry_text(
    text: str, name: str, settings: Sequence[Setting], edits: Callable[[Node], Edits]
) -> str:
    """The text of a file ``name`` with ``settings`` and the ``edits`` of its tree; raises
    BadRequest for aliases.
    """
    text = text.removeprefix("\ufeff")
    for setting in settings:
        tree = read_tree(text, name)[0]
        value = setting.value
        if not isinstance(value, str):
            value = json.dumps(setting.node()[0].plain(), ensure_ascii=False)
        positions: KeyPath = ()  # of entries of lists, which may be named instead
        for step in setting.path:
            node = tree.get(*positions)
            held = None if node is None else node.value
            positions += (_entry(held, step, positions) if isinstance(held, list) else step,)
        text = edited(text, {positions: value or "null"})
    tree = read_tree(text, name)[0]
    values = {
        path: as_before(tree.get(*path), value, kind) if kind else flow(value)
        for path, value, kind in edits(tree)
    }
    text = edited(text, values)
    if ("state",) in values:  # rates, in place of spin and nutation
        begin = read_tree(text, name)[0].keys["state"].offset
        text = text[:begin] + re.sub(r"""^(['"]?)state\1""", "omega0", text[begin:])
    return text


def as_before(node: Node | None, value: float, kind: str) -> str:
    """A value in SI as text in the unit that the file has for it; a new one in SI,
    angles in deg.
    """
    before = None if node is None else node.value
    if before is not None and not isinstance(before, str):
        return number(value)
    suffix = re.search(r"[^\d.eE+\s-].*$", (before or "").strip())
    unit = "deg" if kind == "angle" else KINDS[kind].si
    if suffix is not None:
        with suppress(ValueError):  # hours, minutes and seconds are no unit
            return f"{number(value / parse(f'1 {suffix.group()}', kind))} {suffix.group()}"
    return f"{number(value / parse(f'1 {unit}', kind))} {unit}"


def number(value: float) -> str:
    """A number as text, to 12 digits."""
    text = f"{value + 0.0:.12g}"
    # Without a point YAML 1.1 readers take 1e-05 for a text.
    return text if "e" not in text or "." in text else text.replace("e", ".0e")


def flow(value: object) -> str:
    """A value as YAML on one line; a text stands as it is, keys in quotes where they need some."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        entries = (f"{key_text(key)}: {flow(part)}" for key, part in value.items())
        return f"{{{', '.join(entries)}}}"
    if isinstance(value, Iterable):
        return f"[{', '.join(map(flow, value))}]"
    return number(float(value))  # type: ignore[arg-type]
