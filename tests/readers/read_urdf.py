"""Where the links of a public robot model stand, by a reader of URDF files: airo-models ships the model, yourdfpy reads it."""

import json
import sys

import airo_models
import numpy
import yourdfpy

with open(sys.argv[1], encoding="utf-8") as file:
    asked = json.load(file)
path = airo_models.get_urdf_path(asked["model"])
model = yourdfpy.URDF.load(path, load_meshes=False, build_collision_scene_graph=False)
places = []
for value in asked["values"]:
    model.update_cfg({asked["joint"]: value})
    places.append([numpy.asarray(model.get_transform(link, asked["base"]))[:3, 3].tolist() for link in asked["links"]])
limit = model.joint_map[asked["joint"]].limit
json.dump({"places": places, "limits": [limit.lower, limit.upper], "file": str(path)}, sys.stdout)
