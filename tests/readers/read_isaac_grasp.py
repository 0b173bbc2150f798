import sys

import yaml

from common import grip, report, rotation

with open(sys.argv[1], encoding="utf-8") as file:
    data = yaml.safe_load(file)
assert data["format"] == "isaac_grasp"
assert abs(data["format_version"] - 1.0) < 1e-10
grips, joints, opened, confidence = [], [], [], []
for name, grasp in data["grasps"].items():
    q = grasp["orientation"]
    (joint, position), = grasp["cspace_position"].items()
    assert all(isinstance(value, float) for value in [q["w"], *q["xyz"], *grasp["position"], position])
    grips.append(grip(name.removeprefix("grasp_"), grasp["position"], rotation(q["w"], *q["xyz"]), position))
    joints.append(joint)
    opened.append(grasp["pregrasp_cspace_position"][joint])
    confidence.append(grasp["confidence"])
report(grips, joints=joints, opened=opened, quality=confidence, frames=[data["object_frame"], data["gripper_frame"]])
