"""What the readers share: quaternions to matrices, and the form in which the test compares.

Each reader prints one JSON object: {"grips": [{"id", "position", "rotation" (rows), "width", "mu_s"}, ..]} and, where
the format holds more, further keys. Nothing here is taken from the exporter.
"""

import json
import sys


def rotation(w, x, y, z):
    """Rows of the rotation matrix of a unit quaternion."""
    assert abs(w * w + x * x + y * y + z * z - 1) < 1e-12, "not a unit quaternion"
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def grip(id, position, rotation, width=None, mu_s=None):
    return {
        "id": int(id),
        "position": [float(value) for value in position],
        "rotation": [[float(value) for value in row] for row in rotation],
        "width": None if width is None else float(width),
        "mu_s": None if mu_s is None else float(mu_s),
    }


def report(grips, **more):
    json.dump({"grips": grips, **more}, sys.stdout)
