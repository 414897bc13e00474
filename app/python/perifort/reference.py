"""The groups and keys that a scene may have, as `perifort reference` prints them."""
from __future__ import annotations

import difflib
import re
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path


@dataclass(frozen=True)
class Key:
    """One key: its type ('real', 'real(3)', 'text list', ...), unit, default and meaning, as
    printed.
    """

    name: str
    kind: str
    unit: str
    default: str
    meaning: str

    @property
    def base(self) -> str:
        """The type without its number of values: text, integer, real or logical."""
        return re.split(r"[ (]", self.kind)[0]

    @property
    def most(self) -> int | None:
        """How many values it may have, None without a limit that is known."""
        if self.kind.endswith("list"):
            return None
        match = re.search(r"\(([\d, x]+)\)", self.kind)
        if not match:
            return 1
        count = 1
        for number in re.findall(r"\d+", match.group(1)):
            count *= int(number)
        return count


@dataclass(frozen=True)
class GroupReference:
    """One group with its keys."""

    name: str
    meaning: str
    repeatable: bool
    keys: dict[str, Key] = field(default_factory=dict)


@dataclass(frozen=True)
class Reference:
    """All groups."""

    groups: dict[str, GroupReference]

    @classmethod
    def parse(cls, text: str) -> Reference:
        """From the page that `perifort reference` prints: a heading `## &group`, text, and a table
        with the columns key, type, unit, default, meaning. A text that is no such page is a
        ValueError.
        """
        groups: dict[str, GroupReference] = {}
        for part in re.split(r"^## &", text, flags=re.M)[1:]:
            name, _, rest = part.partition("\n")
            lines = [line.strip() for line in rest.splitlines()]
            prose = " ".join(line for line in lines if line and not line.startswith("|"))
            group = GroupReference(name.strip().lower(), prose, "Given at most once" not in prose)
            for line in lines:
                # A `|` inside of a meaning (|xi|) does not part cells: those have blanks around
                cells = re.split(r" \| |^\| | \|$", line)[1:6]
                match = re.fullmatch(
    r"`(\w+)(\(.*\))?`",
     cells[0].strip()) if len(cells) == 5 else None
                if line.startswith("|") and match:
                    kind, unit, default, meaning = (cell.strip() for cell in cells[1:])
                    group.keys[match.group(1)] = Key(match.group(1), kind, unit, default, meaning)
            groups[group.name] = group
        if not groups or not any(group.keys for group in groups.values()):
            raise ValueError("this is no input reference: no `## &group` with a table of keys")
        return cls(groups)

    def group(self, name: str) -> GroupReference:
        """A group; a KeyError with the nearest name if there is none."""
        if name not in self.groups:
            raise KeyError(f"unknown group &{name}{nearest(name, self.groups)}; known: "
                           f"{', '.join(self.groups)}")
        return self.groups[name]

    def key(self, group: str, name: str) -> Key:
        """A key of a group; a KeyError with the nearest name if there is none."""
        keys = self.group(group).keys
        if name not in keys:
            raise KeyError(f"unknown key '{name}' in group &{group}{nearest(name, keys)}; known: "
                           f"{', '.join(keys)}")
        return keys[name]


def nearest(name: str, known: Iterable[str]) -> str:
    """` (did you mean 'steps'?)` if a known name is near, else nothing."""
    found = difflib.get_close_matches(name, list(known), 1, 0.6)
    return f" (did you mean '{found[0]}'?)" if found else ""


def reference(program: str | Path | None = None) -> Reference:
    """The reference of the program that `run` would start; FileNotFoundError without one."""
    from .program import find_program
    path = find_program(program)
    return _ask(str(path), path.stat().st_mtime)


@lru_cache(maxsize=8)
def _ask(program: str, changed: float) -> Reference:
    """Ask a program once; `changed` tells a program that was built anew."""
    del changed
    told = subprocess.run([program, "reference"], capture_output=True, text=True, check=True)
    return Reference.parse(told.stdout)


def known_reference() -> Reference | None:
    """The reference, or None where no program is found: keys are then checked by the run alone."""
    try:
        return reference()
    except (OSError, ValueError, subprocess.SubprocessError):
        page = Path(__file__).resolve().parents[3] / "doc" / "input-reference.md"
        try:
            return Reference.parse(page.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
