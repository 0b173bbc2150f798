"""As GraspGen's documentation loads its dataset."""

import json
import sys

import numpy

from common import grip, report

with open(sys.argv[1], encoding="utf-8") as file:
    data = json.load(file)
transforms = numpy.array(data["grasps"]["transforms"], dtype=float).reshape(-1, 4, 4)
mask = numpy.array(data["grasps"]["object_in_gripper"], dtype=bool)
assert len(transforms[mask]) + len(transforms[~mask]) == len(transforms)
assert (transforms[:, 3] == [0, 0, 0, 1]).all()
rows = zip(data["grasps"]["id"], transforms, data["grasps"]["width"], data["grasps"]["min_friction"])
grips = [grip(id, matrix[:3, 3], matrix[:3, :3], width, mu_s) for id, matrix, width, mu_s in rows]
report(grips, held=mask.tolist(), object=data["object"])
