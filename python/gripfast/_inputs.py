"""Parts, grippers, loads and requests: what a run is about."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _gripfast

Path = Union[str, "os.PathLike[str]"]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.uint64]

#: Metres in a unit of length.
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "um": 1e-6, "in": 0.0254, "ft": 0.3048}


class Part:
    """A part, read and checked: its mesh welded, repaired and oriented, its planar faces found.

    ``Part("bracket.stl")`` reads a file, ``Part(vertices, faces, unit="mm")`` takes arrays of shape
    (n, 3), and ``Part(mesh, unit="mm")`` anything with ``vertices`` and ``faces``, such as a mesh of
    trimesh. Without a unit a file has its own, else millimetres; arrays are in metres. ``fit="0.2mm"``
    fits planes and round faces to a noisy or scanned part within that distance; ``faceted=True``
    takes every facet for a plane.
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
        faceted: bool = False,
        fit: str | None = None,
    ) -> None:
        if faces is None and isinstance(source, (str, os.PathLike)):
            self._native = _gripfast.Part.read(
                os.fspath(source), unit, max_memory, outside_buffers, faceted, fit
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
            faceted,
            fit,
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
