"""Exceptions, one class for each kind of error."""

from __future__ import annotations


class GripfastError(Exception):
    """Something that could not be done: what is wrong, where, and what to do about it.

    ``kind`` is the name of the kind, ``place`` the file, line or field, ``options`` the fields of
    the request that cause or cure it.
    """

    kind: str = ""
    place: str = ""
    problem: str = ""
    remedy: str = ""
    options: tuple[str, ...] = ()


class FileError(GripfastError, OSError):
    """The operating system refused a file operation."""


class FormatError(GripfastError, ValueError):
    """A file or text is not what its format asks for."""


class GeometryError(GripfastError, ValueError):
    """Readable geometry that cannot be worked with."""


class OptionError(GripfastError, ValueError):
    """A value out of its range, or none of those accepted."""


class UnsupportedError(GripfastError, NotImplementedError):
    """Valid, but this build or version does not do it."""


class NotFoundError(GripfastError, LookupError):
    """Something named is not there: a file, gripper, grip."""


class MismatchError(GripfastError, ValueError):
    """Two inputs that do not belong together."""


class LimitError(GripfastError, MemoryError):
    """A limit of memory, time or number is exceeded."""


class BusyError(GripfastError):
    """Another run holds the output."""


class DeviceError(GripfastError):
    """The graphics processor is not there or failed."""


class CancelledError(GripfastError):
    """Stopped by the caller."""


class PanicError(GripfastError):
    """A fault of the library: please report it."""


BY_KIND: dict[str, type[GripfastError]] = {
    "file": FileError,
    "format": FormatError,
    "geometry": GeometryError,
    "value": OptionError,
    "unsupported": UnsupportedError,
    "not_found": NotFoundError,
    "mismatch": MismatchError,
    "limit": LimitError,
    "busy": BusyError,
    "device": DeviceError,
    "cancelled": CancelledError,
    "panic": PanicError,
}


def make(
    kind: str, text: str, place: str, problem: str, remedy: str, options: list[str]
) -> GripfastError:
    """The exception for an error; called by the extension module."""
    error = BY_KIND.get(kind, GripfastError)(text)
    error.kind, error.place, error.problem, error.remedy = kind, place, problem, remedy
    error.options = tuple(options)
    return error
