"""One scene for several values of its keys."""
from __future__ import annotations

import csv
import itertools
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from .program import RunError, run
from .results import Results
from .scene import Scene

PathLike = Union[str, "os.PathLike[str]"]


class Table:
    """The runs of a sweep: a column for each varied key and each measured number, a row for each
    run.

    `table["horizon%ratio"]` is a column as an array, `table.results[3]` the results of a run, None
    if it failed; `table.errors[3]` is then the reason.
    """

    def __init__(self, columns: Mapping[str, list[Any]], results: list[Results | None],
                 errors: list[str]) -> None:
        self._columns = dict(columns)
        self.results = results
        self.errors = errors

    @property
    def columns(self) -> list[str]:
        """The names of the columns."""
        return list(self._columns)

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        if name not in self._columns:
            raise KeyError(f"the table has no column '{name}'; it has {', '.join(self._columns)}")
        return np.array(self._columns[name])

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for row in range(len(self)):
            yield {name: values[row] for name, values in self._columns.items()}

    def write(self, path: PathLike) -> Path:
        """Write the table as CSV."""
        path = Path(path)
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self._columns)
            writer.writerows(zip(*self._columns.values()))
        return path

    def __str__(self) -> str:
        cells = [[name, *(f"{value:.6g}" if isinstance(value, float) else str(value)
                          for value in values)] for name, values in self._columns.items()]
        widths = [max(map(len, column)) for column in cells]
        return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(row, widths))
                         for row in zip(*cells))


def sweep(scene: Scene | PathLike, values: Mapping[str, Iterable[Any]] | None = None, *,
          measure: Callable[[Results], Any] | None = None, folder: PathLike | None = None,
          threads: int | None = None, progress: bool = True, overwrite: bool = False,
          keep_going: bool = False, program: PathLike | None = None,
          **keys: Iterable[Any]) -> Table:
    """Run a scene for all combinations of values of its keys, and return a table.

        table = sweep(scene, {"horizon%ratio": [2, 3, 4]}, measure=lambda r: r.history["time"][-1])
        table = sweep(scene, horizon__ratio=[2, 3, 4], boundary__velocity_y=[10.0, 20.0])

    Keys are named `group%key` or `group(2)%key`, as a keyword `group__key`. `measure` takes the
    results of a run to a number, or to a mapping of several. Results go to folders in `folder`, by
    default out/NAME_sweep. A run that fails ends the sweep, or with `keep_going` leaves NaN.
    """
    base = scene if isinstance(scene, Scene) else Scene.read(scene)
    varied = {**(values or {}), **{key.replace("__", "%", 1): given for key, given in keys.items()}}
    lists = {key: list(given) for key, given in varied.items()}
    if not lists or not all(lists.values()):
        raise ValueError("a sweep needs at least one key with values: sweep(scene, "
                         "horizon__ratio=[2, 3])")
    where = Path("out") / f"{base.name}_sweep" if folder is None else Path(folder)
    # All scenes before the first run: a wrong key or value costs no computing
    plans = []
    for number, combination in enumerate(itertools.product(*lists.values()), 1):
        one = base.copy()
        for key, value in zip(lists, combination):
            one.set(key, value)
        plans.append((combination, one, where / f"{number:03d}"))
    columns: dict[str, list[Any]] = {key: [] for key in lists}
    found: list[Results | None] = []
    errors: list[str] = []
    measured: list[dict[str, Any]] = []
    for combination, one, output in plans:
        if progress:
            print(
    ", ".join(
        f"{key} = {value}" for key,
        value in zip(
            lists,
            combination)),
             flush=True)
        for key, value in zip(lists, combination):
            columns[key].append(value)
        try:
            results = run(one, output, threads=threads, progress=progress, overwrite=overwrite,
                          program=program)
        except RunError as fault:
            if not keep_going:
                raise
            found.append(None)
            errors.append(str(fault))
            measured.append({})
            continue
        found.append(results)
        errors.append("")
        number_or_several = measure(results) if measure else {}
        measured.append(dict(number_or_several) if isinstance(number_or_several, Mapping)
                        else {"value": number_or_several})
    for name in dict.fromkeys(name for row in measured for name in row):
        columns[re.sub(r"\s+", "_", name)] = [row.get(name, float("nan")) for row in measured]
    return Table(columns, found, errors)
