"""OpenUSD's own library opens the file; each grasp identifier is a line through the part."""

import sys

import numpy
from pxr import Usd, UsdGeom

from common import grip, report

stage = Usd.Stage.Open(sys.argv[1])
assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1
root = stage.GetDefaultPrim()
assert root.GetName() == "part" and root.IsA(UsdGeom.Xform)
grips, lines, safety = [], [], []
for prim in root.GetChildren():
    if not prim.GetName().startswith("grasp_identifier_"):
        continue
    curves = UsdGeom.BasisCurves(prim)
    assert curves and list(curves.GetCurveVertexCountsAttr().Get()) == [2]
    assert curves.GetTypeAttr().Get() == "linear"
    lines.append(numpy.array(curves.GetPointsAttr().Get(), dtype=float).tolist())
    # Vectors are rows in USD.
    matrix = numpy.array(prim.GetAttribute("gripfast:tool").Get()).T
    value = lambda name: prim.GetAttribute(f"gripfast:{name}").Get()
    grips.append(grip(value("id"), matrix[:3, 3], matrix[:3, :3], value("width"), value("mu_s")))
    safety.append(value("safety"))
mesh = UsdGeom.Mesh(root.GetChild("mesh"))
points = numpy.array(mesh.GetPointsAttr().Get(), dtype=float)
corners = points[numpy.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)]
volume = numpy.einsum("ij,ij->i", corners[:, 0], numpy.cross(corners[:, 1], corners[:, 2])).sum() / 6
report(
    grips,
    lines=lines,
    names=[prim.GetName() for prim in root.GetChildren()],
    volume=float(volume),
    part=root.GetAttribute("gripfast:part_file").Get(),
    gripper=root.GetAttribute("gripfast:gripper").Get(),
)
