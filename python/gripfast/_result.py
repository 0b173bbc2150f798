"""What a run found: ranked grips, assessed poses, and the page that shows them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _gripfast
from ._inputs import Floats, Gripper, Integers, Loads, Part, Path, Request, _object

if TYPE_CHECKING:
    import pandas
    import pyarrow


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
        from ._run import assess

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


def _markup(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
