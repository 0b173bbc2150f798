"""As ACRONYM's tools load their files."""

import sys

import h5py
import numpy

from common import grip, report

data = h5py.File(sys.argv[1], "r")
transforms = numpy.array(data["grasps/transforms"])
success = numpy.array(data["grasps/qualities/flex/object_in_gripper"])
own = data["grasps/qualities/gripfast"]
friction = [None if numpy.isnan(value) else value for value in own["min_friction"][()]]
rows = zip(own["id"][()], transforms, own["width"][()], friction)
grips = [grip(id, matrix[:3, 3], matrix[:3, :3], width, mu_s) for id, matrix, width, mu_s in rows]
report(
    grips,
    held=[bool(value) for value in success],
    object={"file": data["object/file"][()].decode("utf-8"), "scale": float(data["object/scale"][()])},
    com=data["object/com"][()].tolist(),
    inertia=data["object/inertia"][()].tolist(),
    mass=float(data["object/mass"][()]),
    frame=data["grasps/transforms"].attrs["tool_frame"].decode("utf-8"),
)
