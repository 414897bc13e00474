"""Results of a run. This module alone knows the layout of the file they lie in."""
from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union, cast

import h5py
import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from collections.abc import Sequence

Array = npt.NDArray[Any]
PathLike = Union[str, "os.PathLike[str]"]

TIP_COLUMNS = ("x", "y", "z", "length", "projection", "speed", "branches", "projection_mean",
               "projection_least", "projection_most")
_COMPONENT = re.compile(r"_(x|y|z|[xyz]{2}|[123])$")


class Quantity(np.ndarray[Any, np.dtype[Any]]):
    """An array with its name and its SI unit, `""` where it has none.

    Parts of it (`force[10:]`) keep both. What is computed from it is a plain array, since its unit
    may be another one.
    """

    name: str
    unit: str

    def __new__(cls, values: npt.ArrayLike, unit: str = "", name: str = "") -> Quantity:
        new = np.asarray(values).view(cls)
        new.unit, new.name = unit, name
        return new

    def __array_finalize__(self, source: Any) -> None:
        self.unit = getattr(source, "unit", "")
        self.name = getattr(source, "name", "")

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        plain = [np.asarray(x) if isinstance(x, Quantity) else x for x in inputs]
        if "out" in options:
            options["out"] = tuple(np.asarray(x) if isinstance(x, Quantity) else x
                                   for x in options["out"])
        return getattr(ufunc, method)(*plain, **options)

    def __reduce__(self) -> Any:
        return Quantity, (np.asarray(self), self.unit, self.name)

    def __repr__(self) -> str:
        return f"Quantity({self.name!r}, {np.asarray(self)!r}, unit={self.unit!r})"


class Columns(Mapping[str, Quantity]):
    """Columns of the history that belong together, by what stands behind their common name.

    Of a tip `length`, `speed`, ..., of a boundary `reaction_x`, ..., of a probe `displacement_x`,
    ...; each is an item, `columns["length"]`, and an attribute, `columns.length`. `time` and, of
    statics, `load_step` are those of the rows.
    """

    def __init__(self, name: str, columns: Mapping[str, Quantity]) -> None:
        self.name = name
        self._columns = dict(columns)

    def __getitem__(self, key: str) -> Quantity:
        if key not in self._columns:
            raise KeyError(
                f"'{self.name}' has no column '{key}'; it has {', '.join(self._columns)}")
        return self._columns[key]

    def __getattr__(self, key: str) -> Quantity:
        if key.startswith("_") or key not in self._columns:
            raise AttributeError(f"'{self.name}' has no column '{key}'")
        return self._columns[key]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._columns]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        return f"Columns({self.name!r}: {', '.join(self._columns)})"


class History(dict[str, Quantity]):
    """The columns of the history by name; an unknown name is answered with the nearest ones."""

    def __missing__(self, key: str) -> Quantity:
        from .reference import nearest
        raise KeyError(f"the history has no column '{key}'{nearest(key, self)}; "
                       f"it has {', '.join(self)}")


class Cells:
    """The elements of meshes in results that were written with `&output cells = .true.`.

    `nodes` (n, 3) are positions [m]; `types` (cells) are VTK's kinds of cells, `offsets` (cells + 1)
    says where the nodes of each begin in `connectivity`, which numbers nodes from 0, in VTK's order.
    `of_mesh` (points) tells which points belong to a mesh.
    """

    def __init__(self, root: h5py.Group, points: int) -> None:
        types = root["Types"][()]
        offsets = root["Offsets"][()]
        connectivity = root["Connectivity"][()]
        elements = int(np.sum(types != 1))
        # Vertices, which show all other points, stand last
        self.types: Array = types[:elements]
        self.offsets: Array = offsets[:elements + 1]
        self.connectivity: Array = connectivity[:offsets[elements]] - points
        self.nodes: Array = root["Points"][points:]
        self.of_mesh: Array = np.ones(points, dtype=bool)
        self.of_mesh[connectivity[offsets[elements]:]] = False

    def __len__(self) -> int:
        return len(self.types)

    def nodes_of(self, numbers: Array) -> Array:
        """The nodes (cells, nodes of one) of cells that have equally many."""
        count = int(self.offsets[numbers[0] + 1] - self.offsets[numbers[0]])
        return np.asarray(self.connectivity[self.offsets[numbers][:, None] + np.arange(count)])


class Results:
    """The results of one run: points, volumes, fields of every output and the history.

    `folder` is the folder of the results, or the .vtkhdf file itself. Arrays are numpy arrays in SI
    units; positions and vectors have three components whatever the dimension.
    """

    def __init__(self, folder: PathLike) -> None:
        self.path: Path = _find_file(Path(folder))
        with h5py.File(self.path, "r") as file:
            root = file["VTKHDF"]
            self.volume: Array = file["points/volume"][()]
            # With cells their nodes stand behind the points
            self.points: Array = root["Points"][:len(self.volume)]
            self._rows = len(root["Points"])
            self.cells: Cells | None = (Cells(root, len(self.volume)) if "Types" in root else None)
            steps = root["Steps"]
            self.outputs: int = int(steps.attrs["NSteps"])
            times = np.asarray(steps["Values"][:self.outputs])
            data = root["PointData"]
            self.fields: list[str] = sorted(data)
            self.field_units: dict[str, str] = {name: _text(data[name].attrs.get("units", ""))
                                                for name in data}
            # Names of the components; of scalars none
            self.components: dict[str, list[str]] = {
                name: _text(data[name].attrs.get("components", "")).split() for name in data}
            self.layer: Array = file["points/layer"][()]
            # Bodies, materials, regions and levels of refinement, where there are any
            self.marks: dict[str, Array] = {name: file["points"][name][()]
                                            for name in file["points"]
                                            if name not in ("volume", "layer")}
            columns = file["history"]
            rows = int(columns.attrs.get("rows", -1))
            read = {name: columns[name][:rows] if rows >= 0 else columns[name][()]
                    for name in columns}
            self.units: dict[str, str] = {name: _text(columns[name].attrs.get("units", ""))
                                          for name in columns}
            # 'run', 'boundary', 'probe', ...: what a column belongs to
            self.origins: dict[str, str] = {name: _text(columns[name].attrs.get("origin", ""))
                                            for name in columns}
            self.scene: str = _text(file["scene/text"][()])
            self.warnings: str = (_text(file["scene/warnings"][()])
                                  if "warnings" in file["scene"] else "")
            self.version: str = _text(file["scene"].attrs.get("version", ""))
        self.history: History = History((name, Quantity(values, self.units[name], name))
                                        for name, values in read.items())
        # In statics the part of the load, from 0 to 1, not seconds
        self.static: bool = "residual" in self.history
        self.times: Quantity = Quantity(times, "" if self.static else "s",
                                        "load factor" if self.static else "time")

    def __repr__(self) -> str:
        return (f"Results({str(self.path)!r}: {len(self.points)} points, {self.outputs} outputs of "
                f"{', '.join(self.fields)})")

    @property
    def name(self) -> str:
        """The name of the scene: that of the file without its ending."""
        return self.path.stem

    @property
    def folder(self) -> Path:
        """The folder in which the results lie."""
        return self.path.parent

    @property
    def body(self) -> npt.NDArray[np.bool_]:
        """Which points belong to bodies and not to the layers of boundaries."""
        return np.asarray(self.layer == 0)

    @property
    def dimension(self) -> int:
        """1, 2 or 3: directions in which the points differ."""
        extent = np.ptp(self.points, axis=0)
        used = extent > 1e-9 * extent.max()
        return 3 if used[2] else 2 if used[1] else 1

    def number(self, output: int | None = -1, time: float | None = None) -> int:
        """The number of an output from 0: a negative one counts from the last, a time means the
        nearest output. Times of statics are load factors.
        """
        if time is not None:
            if not self.outputs:
                raise IndexError(f"{self.path.name} has no outputs yet")
            low, high = float(self.times.min()), float(self.times.max())
            if not low - 1e-9 * abs(high) <= time <= high + 1e-9 * abs(high):
                raise ValueError(f"no output at {time:g}: those of {self.path.name} lie between "
                                 f"{low:.6g} and {high:.6g}{' s' if not self.static else ''}")
            return int(np.argmin(np.abs(self.times - time)))
        output = -1 if output is None else int(output)
        if not -self.outputs <= output < self.outputs:
            raise IndexError(f"{self.path.name} has no output {output}: it has {self.outputs}, "
                             "numbered from 0")
        return range(self.outputs)[output]

    def field(self, name: str, output: int | float | None = None, *,
              time: float | None = None, of: str = "points") -> Quantity:
        """Values of a field, or of one component of it (`stress_xy`), at an output: (n) or (n,
        components). `of` are "points" or, of results with `cells`, "nodes" or "cells".

        `output` is its number, a negative one counting from the last, which is the default; a float
        is a time [s] (in statics a load factor), as `time` is, and means the nearest output.
        """
        k = (self.number(time=float(output)) if isinstance(output, (float, np.floating))
             else self.number(output, time))
        base, component = self.split(name)
        if of not in ("points", "nodes", "cells"):
            raise ValueError(f"there are values of points, nodes and cells, not of '{of}'")
        if of != "points" and self.cells is None:
            raise KeyError(f"{self.path.name} has no {of}: its scene lacks cells = .true. in &output")
        n, rows = len(self.points), self._rows
        with h5py.File(self.path, "r") as file:
            if of == "cells":
                data = file["VTKHDF/CellData"][base]
                total = len(file["VTKHDF/Types"])
                values = data[k * total:k * total + len(cast(Cells, self.cells))]
            else:
                first, last = (0, n) if of == "points" else (n, rows)
                values = file["VTKHDF/PointData"][base][k * rows + first:k * rows + last]
        if component is not None:
            values = values[:, component]
        return Quantity(values, self.field_units[base], name)

    def split(self, name: str) -> tuple[str, int | None]:
        """The field that `stress` or `stress_xy` means, and the number of the component or None."""
        if name in self.fields:
            return name, None
        base, _, component = name.rpartition("_")
        if base in self.fields and component in self.components[base]:
            return base, self.components[base].index(component)
        from .reference import nearest
        known = self.fields + [f"{field}_{part}" for field in self.fields
                               for part in self.components[field]]
        raise KeyError(f"{self.path.name} has no field '{name}'{nearest(name, known)}; "
                       f"it has {', '.join(self.fields)} (a vector's component: displacement_x)")

    def output_at(self, step: int, step_size: float) -> int:
        """The number of the output after so many steps of that size."""
        k = int(np.argmin(np.abs(self.times - step * step_size)))
        if abs(self.times[k] - step * step_size) > 1e-6 * step_size * max(step, 1):
            raise KeyError(f"{self.path.name} has no output after step {step}")
        return k

    def nearest(self, point: Sequence[float]) -> int:
        """The number of the body point nearest to a position; ties go to the lowest number."""
        position = np.zeros(3)
        position[:len(point)] = point
        distance = np.linalg.norm(self.points - position, axis=1) + np.where(self.layer > 0, np.inf,
                                                                             0.0)
        return int(np.flatnonzero(distance <= distance.min() * (1 + 1e-9) + 1e-15)[0])

    def balance(self) -> float:
        """Largest gap of the energy balance over the history, as a part of the largest energy in
        it.
        """
        h = self.history
        stored = h["kinetic_energy"] + h["strain_energy"] + h["dissipated_energy"]
        gap = stored - stored[0] - (h["external_work"] - h["external_work"][0])
        return float(np.abs(gap).max() / max(np.abs(stored).max(),
                     np.abs(h["external_work"]).max()))

    # Columns that belong together

    @property
    def boundaries(self) -> list[str]:
        """The names of the boundaries whose reactions are in the history."""
        found = [match.group(1) for name in self.history if self.origins[name] != "probe"
                 and (match := re.match(r"(.+)_reaction_[xyz]$", name))]
        return list(dict.fromkeys(found))

    @property
    def tips(self) -> list[str]:
        """The names of the crack tips that the history follows."""
        return [name[:-len("_projection")] for name in self.history
                if name.endswith("_projection") and name[:-len("_projection")] + "_length"
                in self.history]

    @property
    def probes(self) -> list[str]:
        """The names of the probes."""
        from .scene import Scene
        named = [str(group.get("name", "")) for group in
                 Scene.parse(self.scene, check=False).all("probe")]
        return [name for name in named if name and self._columns(name, named, "probe")]

    def probe(self, name: str) -> Columns:
        """What a probe recorded: `results.probe("end").displacement_x`."""
        return self._group(name, self.probes, "probe")

    def boundary(self, name: str) -> Columns:
        """Reaction and mean displacement of a named boundary: `reaction_x`, `displacement_x`."""
        return self._group(name, self.boundaries, "boundary")

    def tip(self, name: str) -> Columns:
        """The way of a crack tip: x, y, z [m], length [m], projection [m], speed [m/s], branches.
        """
        return self._group(name, self.tips, "tip", TIP_COLUMNS)

    def _columns(self, name: str, names: Sequence[str], kind: str,
                 only: Sequence[str] = ()) -> dict[str, Quantity]:
        """The columns that begin with a name and no longer one of the same kind, by their rest."""
        found = {}
        for column, values in self.history.items():
            owner = max((other for other in names if column.startswith(other + "_")), key=len,
                        default=None)
            rest = column[len(name) + 1:]
            if owner == name and self.origins[column] in (kind, "") and (not only or rest in only):
                found[rest] = values
        return {rest: found[rest] for rest in only if rest in found} if only else found

    def _group(self, name: str, names: Sequence[str], kind: str,
               only: Sequence[str] = ()) -> Columns:
        """The columns of a probe, boundary or tip, with those that all rows have."""
        self._must_have(kind, name, names)
        shared = {key: self.history[key] for key in ("time", "load_step") if key in self.history}
        return Columns(name, {**shared, **self._columns(name, names, kind, only)})

    def _must_have(self, kind: str, name: str, names: Sequence[str]) -> None:
        """A name that is not among those of its kind is an error."""
        if name in names:
            return
        from .reference import nearest
        what = "are " + ", ".join(names) if names else "is none"
        raise KeyError(f"{self.path.name} has no {kind} '{name}'{nearest(name, names)}; "
                       f"there {what}")

    @property
    def lines(self) -> list[str]:
        """The names of the lines along which outputs have profiles."""
        with h5py.File(self.path, "r") as file:
            return sorted(file["lines"]) if "lines" in file else []

    def line(self, name: str, output: int | float | None = None, *,
             time: float | None = None) -> Columns:
        """Profiles along a line at an output, which is named as in `field`: `position` (n, dimension)
        and `distance` from the first position [m], and the line's fields, (n) or (n, components).
        """
        self._must_have("line", name, self.lines)
        k = (self.number(time=float(output)) if isinstance(output, (float, np.floating))
             else self.number(output, time))
        with h5py.File(self.path, "r") as file:
            group = file["lines"][name]
            position = group["position"][()]
            fields = {field: (group[field][k], _text(group[field].attrs.get("units", "")))
                      for field in group if field != "position"}
        profiles = {"position": Quantity(position, "m", "position"),
                    "distance": Quantity(np.linalg.norm(position - position[0], axis=1), "m",
                                         "distance")}
        for field, (values, unit) in fields.items():
            profiles[field] = Quantity(values[:, 0] if values.shape[1] == 1 else values, unit, field)
        return Columns(name, profiles)

    # Elsewhere

    def plot(self, **options: Any) -> list[Path]:
        """Draw the results as `./pf plot` does, and return the pictures' paths. The options are
        those of `perifort.pictures.plot_results`: field, component, time, deform, clip, film, ...
        """
        from .pictures import plot_results
        return plot_results(self, **options)

    def to_pyvista(self, output: int | None = None, *, time: float | None = None,
                   deform: float = 0.0) -> Any:
        """The points at an output, with all fields, as a pyvista.PolyData; moved by `deform` times
        their displacement. Of results with cells the elements on their nodes, as a
        pyvista.UnstructuredGrid with the fields of both.
        """
        try:
            import pyvista
        except ImportError as fault:
            raise ImportError(
                "to_pyvista needs the package pyvista: pip install pyvista") from fault
        k = self.number(output, time)
        if self.cells is not None:
            return self._grid(pyvista, self.cells, k, deform)
        points = self.points
        if deform and "displacement" in self.fields:
            points = points + deform * self.field("displacement", k)
        mesh = pyvista.PolyData(np.array(points, dtype=float))
        for name in self.fields:
            mesh.point_data[name] = np.asarray(self.field(name, k))
        for name, values in {"volume": self.volume, "layer": self.layer, **self.marks}.items():
            mesh.point_data[name] = values
        mesh.field_data["TimeValue"] = [float(self.times[k])]
        return mesh

    def _grid(self, pyvista: Any, cells: Cells, k: int, deform: float) -> Any:
        """The elements at output `k` as a pyvista.UnstructuredGrid."""
        nodes = cells.nodes
        if deform and "displacement" in self.fields:
            nodes = nodes + deform * self.field("displacement", k, of="nodes")
        count = np.diff(cells.offsets)
        listed = np.insert(cells.connectivity, cells.offsets[:-1], count)
        grid = pyvista.UnstructuredGrid(listed, cells.types, np.array(nodes, dtype=float))
        for name in self.fields:
            grid.point_data[name] = np.asarray(self.field(name, k, of="nodes"))
            grid.cell_data[name] = np.asarray(self.field(name, k, of="cells"))
        grid.field_data["TimeValue"] = [float(self.times[k])]
        return grid


def open_results(folder: PathLike) -> Results:
    """The results in a folder, or in one .vtkhdf file."""
    return Results(folder)


def split_component(name: str) -> tuple[str, str]:
    """`reaction_x` as ("reaction", "x"); without a component the second is ""."""
    match = _COMPONENT.search(name)
    return (name[:match.start()], match.group(1)) if match else (name, "")


def _find_file(folder: Path) -> Path:
    """The one file of results in a folder, or the file itself."""
    if not folder.exists():
        raise FileNotFoundError(f"there is no folder or file {folder}")
    files = [folder] if folder.is_file() else sorted(folder.glob("*.vtkhdf"))
    if not files:
        raise FileNotFoundError(f"{folder} holds no results: no file *.vtkhdf")
    if len(files) > 1:
        raise FileNotFoundError(f"{folder} holds {len(files)} files *.vtkhdf; name one of them: "
                                f"{', '.join(file.name for file in files)}")
    return files[0]


def _text(value: Any) -> str:
    """A text of the file as str."""
    return value.decode() if isinstance(value, bytes) else str(cast(object, value))
