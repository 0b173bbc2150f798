"""Node poses, the part's volume, and where the pads lie, through trimesh."""

import json
import struct
import sys

import numpy
import trimesh

from common import grip, report

with open(sys.argv[1], "rb") as file:
    (length,) = struct.unpack_from("<I", file.read(20), 12)
    document = json.loads(file.read(length))
poses = {node["name"]: node["extras"]["pose"] for node in document["nodes"] if "extras" in node}
scene = trimesh.load(sys.argv[1], process=False)
grips, gaps, fingers, rounded = [], [], [], []
nodes = [name for name in scene.graph.nodes if name.startswith("grip_") and "/" not in name]
for name in sorted(nodes, key=lambda name: int(name.removeprefix("grip_"))):
    single, _ = scene.graph.get(name)
    matrix = numpy.array(poses[name])
    rounded.append(float(abs(single - matrix).max()))
    faces = []
    for jaw in ("jaw_i", "jaw_ii"):
        place, geometry = scene.graph.get(f"{name}/{jaw}/pad")
        points = trimesh.transform_points(scene.geometry[geometry].vertices, place)
        # Tool frame: z approach, y closing.
        local = trimesh.transform_points(points, numpy.linalg.inv(matrix))
        faces.append(local[:, 1].min() if jaw == "jaw_i" else local[:, 1].max())
        place, geometry = scene.graph.get(f"{name}/{jaw}/finger")
        points = trimesh.transform_points(scene.geometry[geometry].vertices, place)
        local = trimesh.transform_points(points, numpy.linalg.inv(matrix))
        fingers.append([local.min(axis=0).tolist(), local.max(axis=0).tolist()])
    grips.append(grip(name.removeprefix("grip_"), matrix[:3, 3], matrix[:3, :3], faces[0] - faces[1]))
    gaps.append([float(face) for face in faces])
_, part = scene.graph.get("part")
mesh = scene.geometry[part]
mesh.merge_vertices()
report(grips, rounded=rounded, gaps=gaps, fingers=fingers, volume=float(mesh.volume), watertight=bool(mesh.is_watertight), bounds=mesh.bounds.tolist())
