"""Runs: plans, poses assessed, contacts of one's own scored."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _gripfast
from ._inputs import Floats, Gripper, Loads, Part, Path, Request, _object, _plain
from ._result import Assessment, Result

#: ``progress(done, total, grips)``: candidates looked at, of how many, and grips so far.
Progress = Callable[[int, int, int], None]


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
