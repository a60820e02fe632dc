"""Which cameras a file of keys and values holds, flat or nested, and which keys belong to each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from circlepose.errors import CalibrationError
from circlepose.io.calibration.keys import (
    DISTORTION_ROLES,
    FOCAL_ROLES,
    MODEL_ROLES,
    SIZE_ROLES,
    Field,
    field_of,
    is_aside,
    is_matrix,
)
from circlepose.io.text.validation import some_keys

_DEPTH = 6
_MOST_KEYS = 10_000
_MOST_KINDS = 20
_MOST_COMPARED = 20
_NAMES = ("name", "camera_name", "camera", "id", "serial", "serial_number", "camera_id")
_ALL_CAMERAS = ("cameras", "cams", "calibrations", "calibration", "intrinsics")
"""groups whose name says nothing about which camera stands in them"""


@dataclass(frozen=True, slots=True)
class Found:
    """One camera of a file."""

    name: str
    """the group of keys that it stands in, or the key of its matrix; empty if the file holds no other"""
    aliases: tuple[str, ...]
    """what else it may be asked for by"""
    fields: tuple[Field, ...]
    """its own, and those that hold for all cameras of the file"""


def cameras_of(entries: Mapping[str, object], where: str) -> list[Found]:
    """Return the cameras of a file in the order in which they stand there; those numbered by key, by number.

    Raises `CalibrationError` on more keys than a calibration has.
    """
    counter = _Counter()
    top = _group(entries, "", 0, counter)
    if counter.keys > _MOST_KEYS:
        raise CalibrationError(
            f"{where}: holds more than {_MOST_KEYS} keys; give the calibration of one camera alone, without the "
            "points that it was made from."
        )
    return [each for found in top.cameras for each in _by_end(found)]


def fields_of(entries: Mapping[str, object]) -> tuple[Field, ...]:
    """Return all keys of a file, whatever camera they are of; of one with very many, the first."""
    return tuple(_group(entries, "", 0, _Counter()).all_fields)


def pick(cameras: Sequence[Found], camera_name: str | None, where: str) -> tuple[Found, tuple[str, ...]]:
    """Return the camera that is asked for, or the first with a remark that names all of several."""
    names = [each.name for each in cameras]
    if camera_name is None:
        first = next((each for each in cameras if not _is_template(each, cameras)), cameras[0])
        several = len(cameras) > 1
        note = f"{first.name} taken, of the {len(names)} cameras {some_keys(names)}"
        return first, (note,) if several else ()
    for each in cameras:
        if camera_name.lower() in {alias.lower() for alias in (each.name, *each.aliases)}:
            return each, ()
    known = [_shown_name(each) for each in cameras]
    if not any(known):
        raise CalibrationError(f"{where}: holds one camera, without a name; leave out the name {camera_name!r}.")
    raise CalibrationError(f"{where}: holds no camera {camera_name!r}; its cameras are {some_keys(known)}.")


def _is_template(camera: Found, cameras: Sequence[Found]) -> bool:
    """Whether another camera has all keys of this one, and more: as YAML's `<<: *base` repeats them."""
    own = _items(camera)
    return any(own < _items(other) for other in cameras[:_MOST_COMPARED] if other is not camera)


def _items(camera: Found) -> set[tuple[str, str]]:
    return {(field.name, repr(field.value)) for field in camera.fields}


def _shown_name(camera: Found) -> str:
    names = [name for name in (camera.name, *camera.aliases) if name]
    return next((name for name in names if name.lower() not in _ALL_CAMERAS), next(iter(names), ""))


@dataclass(slots=True)
class _Counter:
    """How many keys were looked at; from some number on no more are."""

    keys: int = 0


@dataclass(frozen=True)
class _Group:
    """A mapping of keys, with those in it."""

    path: str
    own: tuple[Field, ...]
    inner: Mapping[str, _Group]
    names: tuple[str, ...]
    is_listed: bool

    @cached_property
    def cameras(self) -> list[Found]:
        """The cameras in this group: itself, or those of the groups in it."""
        holding = {key: group for key, group in self.inner.items() if group.cameras}
        # Of sensors that are no cameras, nuScenes has an empty matrix.
        is_camera = any(field.role in FOCAL_ROLES and field.value != [] for field in self.own)
        if is_camera or [len(group.cameras) for group in holding.values()] == [1]:
            names = self.names
            for key, group in holding.items():
                names += (key, *(alias for each in group.cameras for alias in each.aliases))
            fields = (each for each in self.all_fields if each.role not in FOCAL_ROLES or each.value != [])
            return [Found("", names, tuple(fields))]
        outer = [*self.own]
        for key, group in self.inner.items():
            outer += [] if key in holding else group.all_fields
        return [
            Found(
                ".".join(part for part in (key if len(holding) > 1 else "", each.name) if part),
                (key, *each.aliases),
                _with_outer(each.fields, outer),
            )
            for key, group in holding.items()
            for each in group.cameras
        ]

    @cached_property
    def all_fields(self) -> list[Field]:
        """The keys of this group and those in it; a list of groups without a camera is one value."""
        fields = [*self.own]
        for group in self.inner.values():
            is_value = group.is_listed and not group.cameras
            fields += [Field(group.path.rstrip("."), "", "", [])] if is_value else group.all_fields
        return fields


def _group(
    entries: Mapping[str, object], path: str, depth: int, counter: _Counter, *, is_listed: bool = False
) -> _Group:
    own: list[Field] = []
    inner: dict[str, _Group] = {}
    for key, value in unfolded(entries).items():
        here = f"{path}{key}"
        counter.keys += 1
        if counter.keys > _MOST_KEYS:
            break
        groups = None if depth == _DEPTH else _groups(value)
        if groups is None or is_aside(key) or (isinstance(value, list) and not _may_be_cameras(value, depth)):
            own.append(field_of(key, value, here, path.rstrip(".").rpartition(".")[2]))
        else:
            inner[key] = _group(groups, f"{here}.", depth + 1, counter, is_listed=isinstance(value, list))
    names = tuple(str(entries[key]) for key in _NAMES if isinstance(entries.get(key), str | int))
    return _Group(path, tuple(own), inner, names, is_listed)


def _may_be_cameras(groups: Sequence[Mapping[str, object]], depth: int) -> bool:
    """Whether one of the groups in a list holds a camera: lists of points and of views are long, and alike."""
    kinds = {tuple(group): group for group in groups}
    return any(
        _group(group, "", depth + 1, _Counter(), is_listed=True).cameras
        for group in list(kinds.values())[:_MOST_KINDS]
    )


def unfolded(entries: Mapping[str, object]) -> dict[str, object]:
    """Return keys with groups before them, `LEFT.K`, as groups of keys."""
    kept: dict[str, object] = {}
    grouped: dict[str, dict[str, object]] = {}
    for name, value in entries.items():
        # YAML has keys that are numbers.
        key = str(name)
        group, dot, rest = key.partition(".")
        if dot and group and rest and group not in entries:
            grouped.setdefault(group, {})[rest] = value
        else:
            kept[key] = value
    return {**kept, **grouped}


def _groups(value: object) -> dict[str, object] | None:
    """Return a value that is a group of keys, or a list of them under their names or numbers; None for others."""
    if isinstance(value, Mapping) and not is_matrix(value):
        return {str(key): each for key, each in value.items()}
    if isinstance(value, list) and value and all(isinstance(each, Mapping) for each in value):
        return listed(value)
    return None


def listed(groups: Sequence[Mapping[str, object]]) -> dict[str, object]:
    """Return groups that stand in a list under their names, or numbers."""
    named: dict[str, object] = {}
    for number, group in enumerate(groups):
        own = next((str(group[key]) for key in _NAMES if isinstance(group.get(key), str | int)), str(number))
        named[own if own not in named else f"{own} {number}"] = group
    return named


def _by_end(found: Found) -> Iterator[Found]:
    """Yield the cameras of keys that are numbered, or left and right: `M1 D1 M2 D2`."""
    focal = [field for field in found.fields if field.role in FOCAL_ROLES]
    ends = sorted({field.end for field in focal}, key=lambda end: (len(end) if end.isdigit() else 0, end))
    for end in ends or [""]:
        fields = found.fields
        if len(ends) > 1:
            # What is numbered for another of the cameras is that one's.
            fields = tuple(each for each in fields if each.end == end or not (each.end or each in focal))
        kept = tuple(_of_end(field, end, is_one_of_several=len(ends) > 1) for field in fields)
        if len(ends) <= 1:
            yield replace(found, fields=kept)
            continue
        key = next(field.path for field in focal if field.end == end)
        yield Found(".".join(part for part in (found.name, key) if part), (end,) if end else (), kept)


def _of_end(field: Field, end: str, *, is_one_of_several: bool) -> Field:
    """Return a field as it is, or with the role that it has for the camera `end` of a file."""
    if field.end == end or (not field.end and not is_one_of_several):
        return field
    if field.role in DISTORTION_ROLES:
        return replace(field, role="stray")
    return replace(field, role="") if field.end else field


def _with_outer(own: tuple[Field, ...], outer: Sequence[Field]) -> tuple[Field, ...]:
    """Return the fields of a camera with those that several share: the size and the model, if it has none itself."""
    roles = {field.role for field in own}
    added: list[Field] = []
    for field in outer:
        if field.role in DISTORTION_ROLES:
            added.append(replace(field, role="stray"))
        elif not field.role or any(field.role in kind and not roles & {*kind} for kind in (SIZE_ROLES, MODEL_ROLES)):
            added.append(field)
    return (*own, *added)
