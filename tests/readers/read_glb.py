"""Node poses, the part's volume, and where the pads lie, through trimesh."""

import sys

import numpy
import trimesh

from common import grip, report

scene = trimesh.load(sys.argv[1], process=False)
grips, gaps, fingers = [], [], []
nodes = [name for name in scene.graph.nodes if name.startswith("grip_") and "/" not in name]
for name in sorted(nodes, key=lambda name: int(name.removeprefix("grip_"))):
    matrix, _ = scene.graph.get(name)
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
report(grips, gaps=gaps, fingers=fingers, volume=float(mesh.volume), watertight=bool(mesh.is_watertight), bounds=mesh.bounds.tolist())
