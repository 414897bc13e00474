"""Scenes: the text files of groups that perifort runs, built, read, changed and written."""
from __future__ import annotations

import copy
import math
import os
import re
from collections.abc import Iterator, MutableMapping
from pathlib import Path
from typing import Any, Union

import numpy as np

from .reference import Key, Reference, known_reference, nearest

Scalar = Union[bool, int, float, str]
Value = Union[Scalar, list[Scalar]]
PathLike = Union[str, "os.PathLike[str]"]

_WORD_ENDS = " \t,/!=&'\""
_KEY = re.compile(r"([^\s,/!=&'\"(]+)[ \t]*(\([^)]*\))?[ \t]*=")
_INTEGER = re.compile(r"[+-]?\d+$")
_REAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([edED][+-]?\d+)?$")


class SceneError(ValueError):
    """A scene that cannot be, with the line where it is read from a text."""


class Group(MutableMapping[str, Value]):
    """One group of a scene, `&material ... /`: a mapping from keys to values in SI units.

    Values are numbers, texts, truth values or lists of these; arrays and tuples become lists. A key
    with a subscript, `displacement(2)`, is a key of its own. Setting None removes a key.
    """

    def __init__(self, name: str, check: Reference | None = None, /, **keys: Any) -> None:
        self.name = name.lower().lstrip("&")
        self._check = check
        self._values: dict[str, Value] = {}
        if check is not None and self.name not in check.groups:
            raise SceneError(check_message(check, self.name))
        for key, value in keys.items():
            self[key.rstrip("_")] = value

    def __getitem__(self, key: str) -> Value:
        key = _key_name(key)
        if key not in self._values:
            raise KeyError(f"&{self.name} has no value for '{key}'"
                           f"{nearest(key, self._values)}; it has {', '.join(self._values)}")
        return self._values[key]

    def __setitem__(self, key: str, value: Any) -> None:
        key = _key_name(key)
        if value is None:
            self._values.pop(key, None)
            return
        plain = _plain(value, f"&{self.name} {key}")
        if self._check is not None:
            self._values[key] = _checked(self._check, self.name, key, plain)
        else:
            self._values[key] = plain

    def __delitem__(self, key: str) -> None:
        del self._values[_key_name(key)]

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str) and _key_name(key) in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Group):
            return NotImplemented
        return self.name == other.name and self._values == other._values

    def __str__(self) -> str:
        lines = [f"  {key} = {text_of(value)}" for key, value in self._values.items()]
        return "\n".join([f"&{self.name}", *lines, "/"])

    def __repr__(self) -> str:
        return f"Group({self.name!r}, {self._values!r})"


class Scene:
    """A scene: its groups in order.

        scene = Scene.read("strip.nml")
        scene["material"]["youngs_modulus"] = 72.0e9      # the only &material
        scene["boundary", "grip"]["displacement_x"] = 0   # the &boundary of that name
        scene.add("probe", name="end", point=[0.1, 0.02])
        scene.write("other.nml")

    Groups and keys are checked against the program's input reference as they are set; where no
    program is found, and with `check=False`, they are left to the run. Comments of a text that is
    read are not kept, values are exactly.
    """

    def __init__(self, name: str = "scene", *, check: bool | Reference = True) -> None:
        self.name = name
        # Where files are looked for that the scene names
        self.folder: Path | None = None
        self._groups: list[Group] = []
        self._check = known_reference() if check is True else check or None

    # Reading and writing

    @classmethod
    def read(cls, path: PathLike, *, check: bool | Reference = True) -> Scene:
        """The scene in a file."""
        path = Path(path)
        scene = cls.parse(path.read_text(encoding="utf-8"), name=path.stem, check=check,
                          file=str(path))
        scene.folder = path.resolve().parent
        return scene

    @classmethod
    def parse(cls, text: str, *, name: str = "scene", check: bool | Reference = True,
              file: str = "scene") -> Scene:
        """The scene in a text; a SceneError tells the line of what is wrong."""
        scene = cls(name, check=check)
        group: Group | None = None
        key = ""
        values: list[Scalar] = []
        comma = False

        def close_key(number: int) -> None:
            nonlocal key, values, comma
            if key and not values:
                raise SceneError(f"{file}:{number}: key '{key}' in group "
                                 f"&{'' if group is None else group.name} has no value")
            if key and group is not None:
                try:
                    group[key] = values[0] if len(values) == 1 else values
                except SceneError as fault:
                    raise SceneError(f"{file}:{number}: {fault}") from None
            key, values, comma = "", [], False

        number = 0
        for number, line in enumerate(text.splitlines(), 1):
            at = 0
            while at < len(line):
                letter = line[at]
                if letter in " \t":
                    at += 1
                elif letter == "!":
                    break
                elif group is None:
                    match = re.compile(r"&(\w+)").match(line, at)
                    if not match:
                        raise SceneError(f"{file}:{number}: text outside of any group; groups are "
                                         "written &name ... /")
                    try:
                        group = Group(match.group(1), scene._check)
                    except SceneError as fault:
                        raise SceneError(f"{file}:{number}: {fault}") from None
                    scene._groups.append(group)
                    at = match.end()
                elif letter == "/":
                    close_key(number)
                    group, at = None, at + 1
                elif letter == ",":
                    if not values or comma:
                        raise SceneError(f"{file}:{number}: empty value")
                    comma, at = True, at + 1
                elif match := _KEY.match(line, at):
                    close_key(number)
                    key = _key_name(match.group(1) + (match.group(2) or ""))
                    if key in group:
                        raise SceneError(
                            f"{file}:{number}: '{key}' is given twice in &{group.name}")
                    at = match.end()
                elif not key or letter in "&=":
                    raise SceneError(f"{file}:{number}: expected key = value in group "
                                     f"&{group.name}, found {line[at:].strip()!r}")
                else:
                    more, at = _scan_value(line, at, f"{file}:{number}")
                    values += more
                    comma = False
        if group is not None:
            raise SceneError(f"{file}:{number}: group &{group.name} is not closed by a '/'")
        return scene

    def write(self, path: PathLike) -> Path:
        """Write the scene to a file and return its path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(str(self) + "\n", encoding="utf-8")
        return path

    def __str__(self) -> str:
        return "\n\n".join(str(group) for group in self._groups)

    def __repr__(self) -> str:
        return f"Scene({self.name!r}: {', '.join('&' + group.name for group in self._groups)})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self._groups == other._groups

    # Building and changing

    @property
    def groups(self) -> list[Group]:
        """All groups in order."""
        return list(self._groups)

    def all(self, name: str) -> list[Group]:
        """The groups of a name."""
        return [group for group in self._groups if group.name == name.lower().lstrip("&")]

    def __getitem__(self, which: str | tuple[str, int | str]) -> Group:
        name, mark = (which, None) if isinstance(which, str) else which
        found = self.all(name)
        if not found:
            names = dict.fromkeys(group.name for group in self._groups)
            raise KeyError(f"the scene has no &{name}{nearest(name, names)}; it has "
                           f"{', '.join(names)}")
        if isinstance(mark, str):
            named = [group for group in found if group.get("name") == mark]
            if not named:
                names = dict.fromkeys(str(group["name"]) for group in found if "name" in group)
                raise KeyError(f"no &{name} is called '{mark}'{nearest(mark, names)}; there are "
                               f"{', '.join(names) or 'none with a name'}")
            return named[0]
        if mark is None and len(found) > 1:
            raise KeyError(f"the scene has {len(found)} groups &{name}: ask for one by its number "
                           f"from 1 or its name, scene['{name}', 2]")
        number = 1 if mark is None else mark
        if not 1 <= number <= len(found):
            raise KeyError(f"the scene has {len(found)} groups &{name}, no number {number}")
        return found[number - 1]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and bool(self.all(name))

    def __iter__(self) -> Iterator[Group]:
        return iter(self._groups)

    def __len__(self) -> int:
        return len(self._groups)

    def add(self, group: str, /, **keys: Any) -> Group:
        """Add a group behind the others and return it. A key that python has a meaning for is
        written with an underscore: scene.add("crack", from_=[0, 0], to=[0.01, 0]).
        """
        new = Group(group, self._check, **keys)
        given_once = self._check is not None and not self._check.group(new.name).repeatable
        if given_once and self.all(new.name):
            raise SceneError(f"&{new.name} is given at most once: change scene['{new.name}']")
        self._groups.append(new)
        return new

    def remove(self, group: Group) -> None:
        """Take a group out."""
        self._groups = [other for other in self._groups if other is not group]

    def set(self, target: str, value: Any) -> None:
        """Set one key as `--set` of the program does: `horizon%ratio`, `boundary(2)%velocity_y`; a
        group that is missing is added if it is given at most once.
        """
        match = re.fullmatch(r"&?(\w+)\s*(?:\(\s*(\d+)\s*\))?\s*[%.]\s*(.+)", target.strip())
        if not match:
            raise KeyError(f"'{target}' is no key: expected group%key or group(2)%key")
        name, number, key = match.group(1).lower(), match.group(2), match.group(3)
        once = (self._check is not None and name in self._check.groups
                and not self._check.groups[name].repeatable)
        if name not in self and once and number in (None, "1"):
            self.add(name)
        self[(name, int(number)) if number else name][key] = value

    def copy(self, name: str | None = None) -> Scene:
        """A copy that shares nothing; changing it leaves this scene as it is."""
        new = copy.copy(self)
        new.name = name or self.name
        new._groups = []
        for group in self._groups:
            twin = Group(group.name, group._check)
            twin._values = copy.deepcopy(group._values)
            new._groups.append(twin)
        return new

    def files_from(self, folder: Path | None) -> Scene:
        """A copy whose values of keys `file` are whole paths if such files lie in that folder."""
        new = self.copy()
        for group in new:
            value = group.get("file")
            if folder is not None and isinstance(value, str) and (folder / value).is_file():
                group._values["file"] = str((folder / value).resolve())
        return new


def check_message(check: Reference, name: str) -> str:
    """That a group is unknown, with the nearest name."""
    return (f"unknown group &{name}{nearest(name, check.groups)}; known: "
            f"{', '.join(check.groups)}")


def text_of(value: Value) -> str:
    """A value as a scene has it; real numbers keep every bit."""
    if isinstance(value, list):
        return ", ".join(text_of(part) for part in value)
    if isinstance(value, bool):
        return ".true." if value else ".false."
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    if isinstance(value, float):
        return repr(value)
    return str(value)


def _scan_value(line: str, at: int, place: str) -> tuple[list[Scalar], int]:
    """The value that begins at a column, repeated as `3*0.0` asks, and the column behind it."""
    count = re.compile(r"(\d+)\*").match(line, at)
    times = 1
    if count:
        times, at = int(count.group(1)), count.end()
        if times < 1:
            raise SceneError(f"{place}: bad repeat count 0")
    if at < len(line) and line[at] in "'\"":
        quote = line[at]
        match = re.compile(f"{quote}((?:[^{quote}]|{quote}{quote})*){quote}").match(line, at)
        if not match:
            raise SceneError(f"{place}: unclosed quote {line[at:]}")
        return [match.group(1).replace(quote * 2, quote)] * times, match.end()
    end = at
    while end < len(line) and line[end] not in _WORD_ENDS:
        end += 1
    word = line[at:end]
    lower = word.lower()
    if _INTEGER.match(word):
        return [int(word)] * times, end
    if _REAL.match(word):
        return [float(lower.replace("d", "e"))] * times, end
    if lower in (".true.", ".t.", "t", "true"):
        return [True] * times, end
    if lower in (".false.", ".f.", "f", "false"):
        return [False] * times, end
    raise SceneError(f"{place}: bad value '{word}': texts stand in quotes")


def _key_name(key: str) -> str:
    """A key in small letters, without blanks around a subscript."""
    return re.sub(r"\s", "", key).lower()


def _plain(value: Any, where: str) -> Value:
    """A value of python's own types, or a list of them; SceneError if it is none a scene can hold.
    """
    if isinstance(value, np.ndarray):
        # A matrix is read column by column
        value = value.ravel(order="F").tolist() if value.ndim else value.item()
    if isinstance(value, (list, tuple)):
        flat = [_plain(part, where) for part in value]
        if not flat or any(isinstance(part, list) for part in flat):
            raise SceneError(f"{where}: expected a value or a list of values, found {value!r}")
        return [part for part in flat if not isinstance(part, list)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (bool, int)):
        return value
    if isinstance(value, float):
        if not math.isfinite(value):
            raise SceneError(f"{where}: {value} is no finite number")
        return value
    if isinstance(value, (str, os.PathLike)):
        text = os.fspath(value)
        if any(ord(letter) < 32 and letter != "\t" for letter in text):
            raise SceneError(f"{where}: a text has no line breaks or control characters")
        return text
    raise SceneError(f"{where}: {value!r} is no number, text, truth value or list of these")


def _checked(check: Reference, group: str, key: str, value: Value) -> Value:
    """The value if the group has such a key and it can hold it; else a SceneError. A whole number
    for a real key stays one, which a scene may have.
    """
    name, _, subscript = key.partition("(")
    try:
        known = check.key(group, name)
    except KeyError as fault:
        raise SceneError(str(fault.args[0])) from None
    parts = value if isinstance(value, list) else [value]
    most = 1 if subscript else known.most
    if most is not None and len(parts) > most:
        raise SceneError(f"too many values for '{key}' in group &{group}: {len(parts)}, expected "
                         f"at most {most}")
    for part in parts:
        if not _fits(known, part):
            raise SceneError(f"bad value {text_of(part)} for key '{key}' in group &{group}: "
                             f"expected {known.kind}{f' [{known.unit}]' if known.unit else ''}; "
                             f"{known.meaning}")
    return value


def _fits(key: Key, part: Scalar) -> bool:
    """Whether a key of this type can hold the value. Types that are not known hold any."""
    if key.base == "text":
        return isinstance(part, str)
    if key.base == "logical":
        return isinstance(part, bool)
    if key.base == "integer":
        return isinstance(part, int) and not isinstance(part, bool)
    if key.base == "real":
        # A text may be an expression of place and time
        return not isinstance(part, bool)
    return True
