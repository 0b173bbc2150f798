"""Parts, grippers, loads, requests and results."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from . import _gripfast

if TYPE_CHECKING:
    import pandas
    import pyarrow

Path = Union[str, "os.PathLike[str]"]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.uint64]
#: ``progress(done, total, grips)``: candidates looked at, of how many, and grips so far.
Progress = Callable[[int, int, int], None]

#: Metres in a unit of length.
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}


class Part:
    """A part, read and checked: its mesh welded, repaired and oriented, its planar faces found.

    ``Part("bracket.stl")`` reads a file, ``Part(vertices, faces, unit="mm")`` takes arrays of shape
    (n, 3), and ``Part(mesh, unit="mm")`` anything with ``vertices`` and ``faces``, such as a mesh of
    trimesh. Without a unit a file has its own, else millimetres; arrays are in metres.
    """

    _native: _gripfast.Part

    def __init__(
        self,
        source: Any,
        faces: npt.ArrayLike | None = None,
        *,
        unit: str | None = None,
        name: str | None = None,
        max_memory: str | None = None,
        outside_buffers: bool = False,
    ) -> None:
        if faces is None and isinstance(source, (str, os.PathLike)):
            self._native = _gripfast.Part.read(
                os.fspath(source), unit, max_memory, outside_buffers
            )
            return
        if faces is None:
            if not (hasattr(source, "vertices") and hasattr(source, "faces")):
                raise TypeError(
                    "a part is a file, vertices and faces, or an object that has both; "
                    f"this is a {type(source).__name__}"
                )
            source, faces = source.vertices, source.faces
        if unit is not None and unit not in _UNITS:
            raise ValueError(f"unknown unit {unit!r}; use one of: {', '.join(_UNITS)}")
        self._native = _gripfast.Part.from_arrays(
            name or "part",
            np.ascontiguousarray(source, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.int64),
            _UNITS[unit or "m"],
        )

    @classmethod
    def _of(cls, native: _gripfast.Part) -> Part:
        part = cls.__new__(cls)
        part._native = native
        return part

    @property
    def name(self) -> str:
        """File name without folder and endings, or the name given."""
        return self._native.name

    @property
    def file(self) -> str:
        """The file it was read from; empty for a part of arrays."""
        return self._native.file

    @property
    def vertices(self) -> Floats:
        """(n, 3), after repair [m]."""
        return self._native.vertices

    @property
    def faces(self) -> npt.NDArray[np.uint32]:
        """Corners of the triangles, (m, 3), counter-clockwise from outside."""
        return self._native.triangles

    @property
    def health(self) -> dict[str, Any]:
        """What was wrong with the mesh, what was repaired, and what is left."""
        return _object(self._native.health)

    @property
    def warnings(self) -> list[str]:
        """What to look at before relying on the numbers."""
        return list(self.health["warnings"])

    @property
    def watertight(self) -> bool:
        """Whether the surface bounds material everywhere."""
        return bool(self.health["watertight"])

    def mass_properties(self, density: float = 1.0) -> dict[str, Any]:
        """Volume [m3], mass [kg], centre of mass (3) [m] and inertia about it (3, 3) [kg m2] at a
        density [kg/m3]."""
        found = _object(self._native.mass_properties(density))
        found["centre_of_mass"] = np.array(found["centre_of_mass"])
        found["inertia"] = np.array(found["inertia"]).reshape(3, 3)
        return found

    @property
    def planar_faces(self) -> dict[str, Floats]:
        """``area`` (k) [m2], outward ``normal`` (k, 3) and ``centroid`` (k, 3) [m] of the planar
        faces, by falling area; a face's number is its row."""
        area, normal, centroid = self._native.faces()
        return {"area": area, "normal": normal, "centroid": centroid}

    def __repr__(self) -> str:
        size = np.ptp(self.vertices, axis=0) * 1e3
        health = "" if self.watertight else ", not watertight"
        return (
            f"Part({self.name!r}, {size[0]:.1f} x {size[1]:.1f} x {size[2]:.1f} mm, "
            f"{len(self.faces)} triangles{health})"
        )


class Gripper:
    """A two-finger gripper: ``Gripper("robotiq-2f85")`` of the catalogue, or a gripper file."""

    _native: _gripfast.Gripper

    def __init__(self, name_or_path: Path) -> None:
        self._native = _gripfast.Gripper.find(os.fspath(name_or_path))
        #: The name or file that it was asked for by.
        self.source = os.fspath(name_or_path)

    @classmethod
    def _of(cls, native: _gripfast.Gripper) -> Gripper:
        gripper = cls.__new__(cls)
        gripper._native = native
        gripper.source = gripper.name
        return gripper

    @classmethod
    def from_toml(cls, text: str) -> Gripper:
        """The gripper of a gripper file's text."""
        return cls._of(_gripfast.Gripper.from_toml(text))

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Gripper:
        """One as :meth:`to_dict` gives it."""
        return cls._of(_gripfast.Gripper.from_json(json.dumps(fields)))

    def to_dict(self) -> dict[str, Any]:
        """The gripper in SI units, as result files hold it."""
        return _object(self._native.json())

    @staticmethod
    def catalogue() -> list[str]:
        """Names of the grippers that come with gripfast."""
        return _gripfast.Gripper.catalogue()

    @property
    def name(self) -> str:
        """Display name."""
        return str(self.to_dict()["name"])

    @property
    def stroke(self) -> tuple[float, float]:
        """Smallest and largest distance of the pads [m]."""
        least, most = self.to_dict()["stroke"]
        return least, most

    @property
    def force(self) -> tuple[float, float]:
        """Smallest and largest gripping force of one jaw [N]."""
        least, most = self.to_dict()["force"]
        return least, most

    def __repr__(self) -> str:
        least, most = self.stroke
        return f"Gripper({self.name!r}, {least * 1e3:.1f} to {most * 1e3:.1f} mm)"


class Loads:
    """What pulls at the part.

    ``Loads("gravity,ball:60:5N", accel="2g")`` names sources as a request does;
    ``Loads(forces=(n, 3), moments=(n, 3))`` gives wrenches on the part in its frame [N, N m], the
    moments about its centre of mass.
    """

    def __init__(
        self,
        sources: str | Sequence[str] | None = None,
        *,
        accel: str | None = None,
        forces: npt.ArrayLike | None = None,
        moments: npt.ArrayLike | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        self.sources: list[str] | None = None
        self.accel = accel
        self.wrenches: Floats | None = None
        self.names: list[str] = []
        arrays = forces is not None or moments is not None
        if (sources is None) == (not arrays):
            raise TypeError("loads are sources, or forces and moments: give one of them")
        if sources is not None:
            given = sources.split(",") if isinstance(sources, str) else sources
            self.sources = [str(source).strip() for source in given]
            return
        if accel is not None:
            raise TypeError("an acceleration acts on gravity, not on forces and moments")
        given_forces = None if forces is None else np.asarray(forces, dtype=np.float64)
        given_moments = None if moments is None else np.asarray(moments, dtype=np.float64)
        if given_forces is None:
            assert given_moments is not None
            given_forces = np.zeros_like(given_moments)
        if given_moments is None:
            given_moments = np.zeros_like(given_forces)
        if given_forces.shape != given_moments.shape or given_forces.ndim != 2:
            raise ValueError(
                "forces and moments are (n, 3); these are "
                f"{given_forces.shape} and {given_moments.shape}"
            )
        self.wrenches = np.ascontiguousarray(np.hstack([given_forces, given_moments]))
        self.names = [f"load {i}" for i in range(len(self.wrenches))]
        if names is not None:
            self.names = [str(name) for name in names]

    def __repr__(self) -> str:
        if self.sources is None:
            return f"Loads({len(self.names)} wrenches)"
        accel = "" if self.accel is None else f", accel={self.accel!r}"
        return f"Loads({','.join(self.sources)!r}{accel})"


class Request:
    """Every option of a run, the same as a request file and the flags of ``gripfast plan``.

    ``Request(part="a.stl", gripper="generic", mass="350g", spacing="4mm")``: fields are named as the
    flags, whichever table of the file they are in. An unknown one, or a number without a unit, is
    refused at once.
    """

    _json: str

    def __init__(self, **fields: Any) -> None:
        self._json = _gripfast.request_default()
        self.update(**fields)

    @classmethod
    def _of(cls, text: str) -> Request:
        request = cls.__new__(cls)
        request._json = text
        return request

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Request:
        """One as :meth:`to_dict` gives it."""
        return cls._of(_gripfast.request_check(json.dumps(fields)))

    @classmethod
    def from_toml(cls, text: str) -> Request:
        """That of a request file's text."""
        return cls._of(_gripfast.request_from_toml(text))

    @classmethod
    def read(cls, path: Path) -> Request:
        """Reads a request file: JSON where its name ends in ``.json``, else TOML."""
        with open(path, encoding="utf-8") as file:
            text = file.read()
        if os.fspath(path).lower().endswith(".json"):
            return cls.from_dict(json.loads(text))
        return cls.from_toml(text)

    def update(self, **fields: Any) -> None:
        """Sets fields; None takes one back to its default."""
        text = self._json
        for name, value in fields.items():
            if isinstance(value, os.PathLike):
                value = os.fspath(value)
            text = _gripfast.request_set(text, name, json.dumps(value, default=_plain))
        self._json = text

    def to_dict(self) -> dict[str, Any]:
        """All fields with their values, in the tables of the request file."""
        return _object(self._json)

    def to_toml(self) -> str:
        """As a file that ``gripfast plan --request`` reads."""
        return _gripfast.request_to_toml(self._json)

    def check(self) -> None:
        """Refuses values that no part and no gripper could make right."""
        _gripfast.request_check(self._json)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Request) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, name: str) -> Any:
        fields = self.to_dict()
        for table in (fields, *(fields[k] for k in ("candidates", "scoring", "selection", "output"))):
            if name in table:
                return table[name]
        raise KeyError(name)

    def __repr__(self) -> str:
        default = json.loads(_gripfast.request_default())
        changed = [
            f"{name}={value!r}"
            for table, values in [("", self.to_dict()), *self.to_dict().items()]
            if isinstance(values, dict)
            for name, value in values.items()
            if not isinstance(value, dict)
            and (default.get(table, {}) if table else default).get(name) != value
        ]
        return f"Request({', '.join(changed)})"


class Page:
    """The page of a result: shown by a notebook, or written to a file."""

    def __init__(self, html: str) -> None:
        self.html = html

    def save(self, path: Path) -> None:
        """Writes the page, which needs no network."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.html)

    def _repr_html_(self) -> str:
        # In a frame of its own: its styles and scripts do not meet those of the notebook.
        page = self.html.replace("&", "&amp;").replace('"', "&quot;")
        return (
            f'<iframe srcdoc="{page}" width="100%" height="720" style="border:1px solid #ccc" '
            'sandbox="allow-scripts"></iframe>'
        )


class Result:
    """Ranked grips, best first, as arrays of n grips.

    Grip frame: origin midway between the pads, ``x1`` the approach, ``x3`` the closing axis.
    """

    _native: _gripfast.Result

    def __init__(self, native: _gripfast.Result, part: Part | None = None) -> None:
        self._native = native
        self._part = part
        self._head: dict[str, Any] | None = None

    @classmethod
    def read(cls, path: Path, part: Part | Path | None = None) -> Result:
        """Reads a native result file (``.json``, ``.jsonl``), and later the part that it names."""
        native = _gripfast.Result.read(os.fspath(path))
        if part is not None and not isinstance(part, Part):
            part = Part._of(native.read_part(os.fspath(part)))
        return cls(native, part)

    def __len__(self) -> int:
        return len(self._native)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """Everything about one grip, as in the result file."""
        return _object(self._native.grip_json(self._index(index)))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[index] for index in range(len(self)))

    def _index(self, index: int) -> int:
        if not -len(self) <= index < len(self):
            raise IndexError(f"grip {index} of {len(self)}")
        return index % len(self)

    def index(self, id: int) -> int:
        """Where the grip of this id stands in the list."""
        found = np.flatnonzero(self.ids == id)
        if len(found) == 0:
            raise KeyError(f"no grip of the list has the id {id}")
        return int(found[0])

    # What the run was.

    @property
    def part(self) -> Part:
        """The part; read again where the result was read from a file."""
        if self._part is None:
            self._part = Part._of(self._native.read_part(None))
        return self._part

    @property
    def gripper(self) -> Gripper:
        """The gripper."""
        return Gripper._of(_gripfast.Gripper.from_json(self._native.gripper_json()))

    def _heads(self) -> dict[str, Any]:
        if self._head is None:
            self._head = _object(self._native.head())
        return self._head

    @property
    def provenance(self) -> dict[str, Any]:
        """Version, backend, request, and the values that the request left open."""
        return dict(self._heads()["provenance"])

    @property
    def request(self) -> Request:
        """What was asked for."""
        return Request.from_dict(self.provenance["request"])

    @property
    def summary(self) -> dict[str, Any]:
        """Candidates, grips ranked, and rejections by reason."""
        return dict(self._heads()["summary"])

    @property
    def loads(self) -> list[dict[str, Any]]:
        """The load cases, in the part frame about the centre of mass."""
        return list(self._heads()["loads"])

    @property
    def warnings(self) -> list[str]:
        """What to know of the part before relying on the numbers."""
        return list(self.provenance["warnings"])

    @property
    def complete(self) -> bool:
        """Whether every candidate was looked at."""
        return bool(self.provenance["complete"])

    @property
    def shown(self) -> list[int]:
        """Ids of the grips to show: the first ones, or with ``diverse`` those that differ."""
        return list(self._native.shown)

    # Arrays.

    @property
    def ids(self) -> Integers:
        """Numbers of the candidates, (n)."""
        return self._native.integers("id")

    @property
    def ranks(self) -> Integers:
        """Places, 1 is the best, (n)."""
        return self._native.integers("rank")

    @property
    def families(self) -> Integers:
        """Id of the first grip that a symmetry of the part maps to each, (n)."""
        return self._native.integers("family")

    @property
    def poses(self) -> Floats:
        """Grip frames in the part frame, (n, 4, 4) [m]: the columns are x1, x2, x3, origin."""
        return self._native.poses()

    def tool_poses(self, convention: str = "standard", origin: str = "pads") -> Floats:
        """Tool frames (TCP) in the part frame, (n, 4, 4) [m], as ``gripfast export`` has them:
        ``standard`` (z approach, y closing), ``moveit``, ``graspgen``, ``flange``, ..; ``origin`` is
        ``pads``, ``flange``, ``tool`` or a distance behind the pads, ``"103.4mm"``."""
        return self._native.poses(convention, origin)

    @property
    def widths(self) -> Floats:
        """Distance of the gripped faces, (n) [m]."""
        return self._native.numbers("width")

    @property
    def mu_s(self) -> Floats:
        """Smallest friction coefficient that holds the worst load, (n)."""
        return self._native.numbers("mu_s")

    @property
    def mu_bounds(self) -> Floats:
        """Lower and upper bound of ``mu_s`` for its pressure, (n, 2); nan where none is known."""
        lower, upper = self._native.numbers("mu_lower"), self._native.numbers("mu_upper")
        return np.stack([lower, upper], axis=1)

    @property
    def safety(self) -> Floats:
        """Pad friction over ``mu_s``, (n); nan where the pad friction is not known."""
        return self._native.numbers("safety")

    @property
    def scores(self) -> Floats:
        """What the order goes by, larger is better, (n)."""
        return self._native.numbers("score")

    @property
    def alphas(self) -> Floats:
        """Tilt that closing jaws still right, (n) [rad]."""
        return self._native.numbers("alpha")

    @property
    def contact_areas(self) -> Floats:
        """Nominal contact areas of face I and II, (n, 2) [m2]."""
        return self._native.contact_areas()

    @property
    def contact_shares(self) -> Floats:
        """Share of the contact that still touches under the worst load, (n)."""
        return self._native.numbers("contact_share")

    @property
    def forces_needed(self) -> Floats:
        """Gripping force at which the pad friction just holds, (n) [N]; nan where not known."""
        return self._native.numbers("force_needed")

    @property
    def worst_loads(self) -> Floats:
        """The worst loads in the grip frames about their origins, (n, 6) [N, N m]."""
        return self._native.worst_loads()

    @property
    def worst_load_names(self) -> list[str]:
        """Their names, n."""
        names = [load["name"] for load in self.loads]
        return [names[int(load)] for load in self._native.integers("load")]

    @property
    def statuses(self) -> list[str]:
        """Kinds of answer under the worst load, n: ``ok``, ``ambiguous``."""
        return self._native.statuses()

    @property
    def negatives(self) -> list[dict[str, Any]]:
        """Candidates that are no grips, with the reason, where the request asks for some."""
        return list(self._heads()["negatives"])

    # One grip.

    def contact(self, index: int) -> dict[str, list[dict[str, Any]]]:
        """Contact areas of a grip in its pad plane (x1, x2) [m]: polygons of face I and II, each
        with its ``outer`` ring (k, 2) and its ``holes``."""
        contact = self[index]["contact"]
        return {
            side: [
                {
                    "outer": np.array(polygon["outer"]),
                    "holes": [np.array(hole) for hole in polygon.get("holes", [])],
                }
                for polygon in contact[name]
            ]
            for side, name in [("face_i", "A_I"), ("face_ii", "A_II")]
        }

    def why(self, index: int) -> dict[str, Any]:
        """Every test of a grip with body and place, and its worst load."""
        index = self._index(index)
        found = _object(self._native.why(index, self.part._native))
        found["worst"] = self[index]["worst"]
        return found

    def assess(self, poses: npt.ArrayLike | Path, **axes: Any) -> Assessment:
        """Poses from outside on the same part, with the gripper, loads and options of this result;
        see :func:`assess`."""
        wrenches = [case["wrench"] for case in self.loads]
        loads = Loads(
            forces=np.array([wrench["force"] for wrench in wrenches]),
            moments=np.array([wrench["moment"] for wrench in wrenches]),
            names=[case["name"] for case in self.loads],
        )
        return assess(self.part, self.gripper, poses, loads, request=self.request, **axes)

    def pick(
        self, scene: Path | str, world_from_part: npt.ArrayLike | None = None
    ) -> tuple[int | None, list[str]]:
        """The first grip that is free in a scene file (or its text): its place in the list, or None,
        and why each one before it is not. ``world_from_part`` (4, 4) takes the place of the scene's
        pose of the part."""
        text, folder = os.fspath(scene), "."
        if "\n" not in text and os.path.exists(text):
            folder = os.path.dirname(text) or "."
            with open(text, encoding="utf-8") as file:
                text = file.read()
        pose = None
        if world_from_part is not None:
            pose = np.ascontiguousarray(world_from_part, dtype=np.float64)
        return self._native.pick(text, folder, pose)

    # Other forms.

    def to_arrow(self, negatives: bool = False, **options: Any) -> pyarrow.Table:
        """The columns of the CSV and Parquet files as an Arrow table, without a copy; options as
        those of :meth:`export`."""
        import pyarrow

        columns = self._native.columns(negatives, json.dumps(options))
        arrays = [_arrow(column) for column in columns]
        fields = [
            pyarrow.field(column["name"], array.type, nullable="valid" in column)
            for column, array in zip(columns, arrays)
        ]
        return pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields))

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """For polars, DuckDB and whatever else speaks Arrow."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def to_pandas(self, negatives: bool = False, **options: Any) -> pandas.DataFrame:
        """The same as a data frame."""
        return self.to_arrow(negatives, **options).to_pandas()

    def to_dict(self) -> dict[str, Any]:
        """The whole native result file."""
        return _object(self._native.json())

    def save(self, path: Path) -> None:
        """Writes the native result file, or another format by the ending of the name."""
        self.export(path)

    def export(self, path: Path, format: str | None = None, **options: Any) -> None:
        """Writes another format, by the file's ending or its name: ``csv``, ``parquet``, ``moveit``,
        ``isaac_grasp``, ..; options are named as the flags of ``gripfast export``, lengths in metres:
        ``convention``, ``origin``, ``top``, ``opening``, ``joint`` (a list), ``pad_friction``,
        ``approach``, ``part_frame``, ``dialect``, ``spreadsheet``."""
        part = None
        ending = os.fspath(path).lower().rsplit(".", 1)[-1] if format is None else format
        if ending in ("glb", "usd", "usda"):
            part = self.part._native
        if ending == "glb":
            options.setdefault("top", 10)
        self._native.export(os.fspath(path), format, part, json.dumps(options))

    def report(self, path: Path | None = None) -> Page:
        """The page to look at: part, grips, jaws, pressure, friction over all loads. A notebook
        shows it; with a path it is written too."""
        page = Page(self._native.report(self.part._native))
        if path is not None:
            page.save(path)
        return page

    def __repr__(self) -> str:
        best = f", best mu_s {self.mu_s[0]:.5f}" if len(self) else ""
        return f"Result({len(self)} grips of {self.summary['ranked']}{best})"

    def _repr_html_(self) -> str:
        rows = []
        for place in range(min(len(self), 10)):
            x, y, z = self.poses[place, :3, 3] * 1e3
            rows.append(
                f"<tr><td>{self.ranks[place]}</td><td>{self.ids[place]}</td>"
                f"<td>{self.mu_s[place]:.5f}</td><td>{self.safety[place]:.2f}</td>"
                f"<td>{self.widths[place] * 1e3:.2f}</td><td>({x:.2f}, {y:.2f}, {z:.2f})</td>"
                f"<td>{_markup(self.worst_load_names[place])}</td></tr>"
            )
        head = "".join(
            f"<th>{name}</th>"
            for name in ["rank", "id", "mu_s", "safety", "width mm", "position mm", "worst load"]
        )
        return (
            f"<p>{_markup(repr(self))}</p><table><thead><tr>{head}</tr></thead>"
            f"<tbody>{''.join(rows)}</tbody></table>"
        )


def plan(
    part: Part | Path | Any = None,
    gripper: Gripper | Path | None = None,
    loads: Loads | str | Sequence[str] | None = None,
    *,
    request: Request | None = None,
    progress: bool | Progress | None = None,
    notes: Callable[[str, str], None] | None = None,
    **options: Any,
) -> Result:
    """Finds and ranks the grips on a part.

    ``part`` and ``gripper`` are objects, or files and names; ``options`` are fields of a
    :class:`Request` over those of ``request``. ``progress=True`` shows a bar of tqdm, a function is
    called with (done, total, grips). ``notes`` is called with ``("note" or "warning", text)``. Other
    threads of Python run meanwhile; Ctrl-C stops the run.

    >>> import gripfast
    >>> nut = gripfast.Part("data/parts/hex_nut.stl")
    >>> found = gripfast.plan(nut, "generic", density="7850kg/m3", spacing="6mm", top=3)
    >>> len(found.shown)
    3
    """
    job = _Job(part, gripper, loads, request, options)
    with _Listener(progress, notes) as listener:
        native, planned = _gripfast.plan(job.request._json, *job.natives(), listener)
    return Result(native, job.part or Part._of(planned))


class Assessment(Sequence[dict[str, Any]]):
    """What became of poses, in their order: for each ``name``, ``verdict`` in words, ``free``,
    ``faces``, ``failed`` (the tests that it fails), ``turned_rad`` and ``shifted_m`` (what closing
    jaws right), ``grip`` (its numbers, None where the pads touch nothing). ``result`` holds those
    that are grips, ranked; their ids are the places in the list."""

    def __init__(self, rows: list[dict[str, Any]], result: Result) -> None:
        self.rows, self.result = rows, result

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, index: Any) -> Any:
        return self.rows[index]

    @property
    def verdicts(self) -> list[str]:
        """Of each pose."""
        return [row["verdict"] for row in self.rows]

    @property
    def mu_s(self) -> Floats:
        """Of each pose; nan where it is no grip or no friction holds it."""
        grips = [row["grip"] if row["free"] else None for row in self.rows]
        found = [grip and grip["worst"]["mu_s"] for grip in grips]
        return np.array([np.nan if mu is None else mu for mu in found], dtype=np.float64)

    def __repr__(self) -> str:
        return f"Assessment({len(self)} poses, {len(self.result)} are grips)"


def assess(
    part: Part | Path | Any,
    gripper: Gripper | Path | None,
    poses: npt.ArrayLike | Path,
    loads: Loads | str | Sequence[str] | None = None,
    *,
    format: str | None = None,
    convention: str | None = None,
    origin: str | None = None,
    tilt: str = "3deg",
    request: Request | None = None,
    notes: Callable[[str, str], None] | None = None,
    **options: Any,
) -> Assessment:
    """Tests and scores poses from outside as the grips of a plan are.

    ``poses`` are (n, 4, 4) in the part frame, as :attr:`Result.poses` has them, or tool frames where
    ``convention`` and ``origin`` are named as in :meth:`Result.tool_poses`; or a file that
    ``gripfast assess`` reads, of this ``format`` or that of its ending. They may be off the faces'
    normal by ``tilt``. Everything else is as in :func:`plan`.

    >>> import gripfast
    >>> nut = gripfast.Part("data/parts/hex_nut.stl")
    >>> job = dict(density="7850kg/m3", spacing="6mm")
    >>> found = gripfast.plan(nut, "generic", **job)
    >>> again = gripfast.assess(nut, "generic", found.poses, **job)
    >>> len(again) == len(found) and all(row["free"] for row in again)
    True
    """
    if not isinstance(poses, (str, os.PathLike)):
        poses = np.ascontiguousarray(poses, dtype=np.float64)
    job = _Job(part, gripper, loads, request, options)
    with _Listener(None, notes) as listener:
        rows, native, planned = _gripfast.assess(
            job.request._json, poses, (format, convention, origin), tilt, *job.natives(), listener
        )
    return Assessment([_object(row) for row in rows], Result(native, job.part or Part._of(planned)))


class _Job:
    """What a run is about, as the extension module takes it."""

    def __init__(
        self,
        part: Part | Path | Any,
        gripper: Gripper | Path | None,
        loads: Loads | str | Sequence[str] | None,
        request: Request | None,
        options: Mapping[str, Any],
    ) -> None:
        wanted = Request._of(request._json) if request is not None else Request()
        self.request = wanted
        self.part: Part | None = None
        self.gripper: Gripper | None = None
        self.wrenches: tuple[list[str], Floats] | None = None
        if isinstance(part, Part):
            self.part = part
            wanted.update(part=part.file)
        elif isinstance(part, (str, os.PathLike)):
            wanted.update(part=part)
        elif part is not None:
            self.part = Part(part)
        if isinstance(gripper, Gripper):
            self.gripper = gripper
            wanted.update(gripper=gripper.source)
        elif gripper is not None:
            wanted.update(gripper=gripper)
        if loads is not None and not isinstance(loads, Loads):
            loads = Loads(loads)
        if loads is not None and loads.sources is not None:
            wanted.update(loads=loads.sources)
            if loads.accel is not None:
                wanted.update(accel=loads.accel)
        elif loads is not None and loads.wrenches is not None:
            self.wrenches = (loads.names, loads.wrenches)
        wanted.update(**options)

    def natives(self) -> tuple[Any, Any, Any]:
        part = None if self.part is None else self.part._native
        gripper = None if self.gripper is None else self.gripper._native
        return part, gripper, self.wrenches


def read(path: Path, part: Part | Path | None = None) -> Result:
    """Reads a native result file; see :meth:`Result.read`."""
    return Result.read(path, part)


def score(
    contacts: Sequence[Any],
    wrenches: npt.ArrayLike,
    *,
    distance: npt.ArrayLike,
    force: npt.ArrayLike,
    backend: str = "auto",
) -> tuple[Floats, list[list[str]]]:
    """The smallest friction coefficient that holds contacts of one's own, (n, m), and the statuses.

    Each of the n contacts is a pair of areas of face I and II, or one area for both; an area is a
    ring (k, 2), a list of rings, or polygons as :meth:`Result.contact` has them [m]. ``wrenches``
    (m, 6) or (n, m, 6): loads on the part in the grip frame about its origin [N, N m]. ``distance``
    of the faces [m] and ``force`` of one jaw [N]: one for all, or (n). nan: no friction holds.

    >>> import numpy as np, gripfast
    >>> pad = 0.01 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    >>> mu, status = gripfast.score([pad], [[0, 0, 0, 0, 0, 0.2]], distance=0.02, force=50)
    >>> round(float(mu[0, 0]), 6), status
    (0.261371, [['ok']])
    """
    areas = [_contact(contact) for contact in contacts]
    rows = np.asarray(wrenches, dtype=np.float64)
    if rows.ndim == 2:
        rows = np.broadcast_to(rows, (len(areas), *rows.shape))
    each = [
        np.ascontiguousarray(np.broadcast_to(np.asarray(value, dtype=np.float64), (len(areas),)))
        for value in (distance, force)
    ]
    return _gripfast.score(
        json.dumps(areas, default=_plain), each[0], each[1], np.ascontiguousarray(rows), backend
    )


class _Listener:
    """Passes the news of a run on to a bar or a function."""

    def __init__(
        self,
        progress: bool | Callable[..., None] | None,
        notes: Callable[[str, str], None] | None,
        unit: str = "candidate",
    ) -> None:
        self.progress, self.notes, self.unit = progress, notes, unit
        self.bar: Any = None

    def __enter__(self) -> Callable[..., None]:
        return self.hear

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()

    def hear(self, kind: str, *news: Any) -> None:
        if kind in ("note", "warning"):
            if self.notes is not None:
                self.notes(kind, news[0])
        elif kind == "job":
            entry, ended, jobs = json.loads(news[0]), news[1], news[2]
            if callable(self.progress):
                self.progress(entry, ended, jobs)
            elif self.progress:
                self.show(ended, jobs, entry["part"])
        elif callable(self.progress):
            self.progress(*news)
        elif self.progress:
            done, total, grips = news
            self.show(done, total, f"{grips} grips")

    def show(self, done: int, total: int, text: str) -> None:
        if self.bar is None:
            from tqdm.auto import tqdm

            self.bar = tqdm(total=total, unit=self.unit, file=sys.stderr)
        self.bar.n = done
        self.bar.set_postfix_str(text)


def _contact(contact: Any) -> dict[str, Any]:
    """A contact as the result file has it."""
    if isinstance(contact, Mapping):
        first, second = contact["face_i"], contact["face_ii"]
    elif isinstance(contact, tuple) and len(contact) == 2:
        first, second = contact
    else:
        first = second = contact
    return {"A_I": _patch(first), "A_II": _patch(second)}


def _patch(area: Any) -> list[dict[str, Any]]:
    if isinstance(area, np.ndarray) or (len(area) and np.ndim(area[0]) == 1):
        area = [area]
    polygons = []
    for polygon in area:
        if not isinstance(polygon, Mapping):
            polygon = {"outer": polygon}
        holes = [np.asarray(hole, dtype=np.float64).tolist() for hole in polygon.get("holes", [])]
        outer = np.asarray(polygon["outer"], dtype=np.float64).tolist()
        polygons.append({"outer": outer, "holes": holes})
    return polygons


def _arrow(column: dict[str, Any]) -> pyarrow.Array:
    """A column from its buffers, which Arrow shares."""
    import pyarrow

    rows, data = column["rows"], pyarrow.py_buffer(column["data"])
    if column["type"] == "string":
        offsets = pyarrow.py_buffer(column["offsets"])
        return pyarrow.StringArray.from_buffers(rows, offsets, data)
    valid = pyarrow.py_buffer(column["valid"]) if column.get("missing") else None
    kind = getattr(pyarrow, column["type"])()
    return pyarrow.Array.from_buffers(kind, rows, [valid, data], column.get("missing", 0))


def _object(text: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(text)
    return found


def _plain(value: Any) -> Any:
    """Numbers and arrays of NumPy as JSON has them."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a {type(value).__name__} is no value of a request")


def _markup(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
