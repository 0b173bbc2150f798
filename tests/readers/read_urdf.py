"""Where the pads of a robot model stand, by a reader of URDF files that shares no code with ours.

yourdfpy reads a file, or a model of the package airo-models. For each value of the joint: the pads' boxes in the base's
frame, centre and corners.
"""

import itertools
import json
import sys

import numpy
import yourdfpy

with open(sys.argv[1], encoding="utf-8") as file:
    asked = json.load(file)
path = asked.get("file")
if path is None:
    import airo_models

    path = airo_models.get_urdf_path(asked["model"])
model = yourdfpy.URDF.load(path, load_meshes=False, build_collision_scene_graph=False)


def box(link):
    """Centre and corners of the link's collision box, in the base's frame."""
    (shape,) = model.link_map[link].collisions
    half = numpy.asarray(shape.geometry.box.size) / 2
    place = numpy.asarray(model.get_transform(link, asked["base"])) @ shape.origin
    corners = [half * signs for signs in itertools.product((-1, 1), repeat=3)]
    return [(place[:3, :3] @ point + place[:3, 3]).tolist() for point in [0 * half, *corners]]


places = []
for value in asked["values"]:
    model.update_cfg({asked["joint"]: numpy.asarray(float(value))})
    places.append([box(link) for link in asked["links"]])
limit = model.joint_map[asked["joint"]].limit
json.dump({"places": places, "limits": [limit.lower, limit.upper], "file": str(path)}, sys.stdout)
