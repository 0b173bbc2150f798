"""Finds and ranks every two-finger grip (grasp) on a CAD part by the smallest friction coefficient
that holds it.

>>> import gripfast
>>> result = gripfast.plan("data/parts/hex_nut.stl", "generic", density="7850kg/m3", spacing="6mm")
>>> result.poses.shape[1:], bool(result.mu_s[0] > 0)
((4, 4), True)

Arrays are in SI units, in the part's frame where nothing else is said. Options are the fields of a
request file, the same as the flags of ``gripfast plan`` with underscores; quantities are texts with
a unit. The same input gives the same numbers as the program, bit for bit.
"""

from __future__ import annotations

import os as _os
import sys as _sys

# Without a desktop, the layer of Mesa's Vulkan that asks the display server for the preferred adapter
# prints an error for every look at the adapters; gripfast ranks them itself.
if _sys.platform == "linux" and "XDG_RUNTIME_DIR" not in _os.environ:
    _os.environ.setdefault("NODEVICE_SELECT", "1")

from ._batch import Batch, Job, Report, Store, gather_job, run_job, run_share
from ._errors import (
    BusyError,
    CancelledError,
    DeviceError,
    FileError,
    FormatError,
    GeometryError,
    GripfastError,
    LimitError,
    MismatchError,
    NotFoundError,
    OptionError,
    PanicError,
    UnsupportedError,
)
from ._gripfast import __version__
from ._inputs import Gripper, Loads, Part, Request
from ._result import Assessment, Page, Result
from ._run import assess, plan, read, score

__all__ = [
    "Assessment",
    "Batch",
    "BusyError",
    "CancelledError",
    "DeviceError",
    "FileError",
    "FormatError",
    "GeometryError",
    "GripfastError",
    "Gripper",
    "Job",
    "LimitError",
    "Loads",
    "MismatchError",
    "NotFoundError",
    "OptionError",
    "Page",
    "PanicError",
    "Part",
    "Report",
    "Request",
    "Result",
    "Store",
    "UnsupportedError",
    "__version__",
    "assess",
    "plan",
    "read",
    "run_job",
    "run_share",
    "gather_job",
    "score",
]
