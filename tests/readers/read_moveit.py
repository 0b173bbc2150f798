import sys

import yaml

from common import grip, report, rotation

FIELDS = [
    "id",
    "pre_grasp_posture",
    "grasp_posture",
    "grasp_pose",
    "grasp_quality",
    "pre_grasp_approach",
    "post_grasp_retreat",
    "post_place_retreat",
    "max_contact_force",
    "allowed_touch_objects",
]

with open(sys.argv[1], encoding="utf-8") as file:
    data = yaml.safe_load(file)
grips, joints, opened, quality, approaches, forces = [], [], [], [], [], []
for message in data:
    assert list(message) == FIELDS, list(message)
    assert message["grasp_pose"]["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "part"}
    pose = message["grasp_pose"]["pose"]
    position = [pose["position"][axis] for axis in "xyz"]
    matrix = rotation(*[pose["orientation"][axis] for axis in "wxyz"])
    point, = message["grasp_posture"]["points"]
    grips.append(grip(message["id"], position, matrix, point["positions"][0]))
    joints.append(message["grasp_posture"]["joint_names"][0])
    opened.append(message["pre_grasp_posture"]["points"][0]["positions"][0])
    quality.append(message["grasp_quality"])
    approach = message["pre_grasp_approach"]
    assert approach["desired_distance"] == 2 * approach["min_distance"]
    approaches.append([approach["direction"]["vector"][axis] for axis in "xyz"])
    retreat = message["post_grasp_retreat"]["direction"]["vector"]
    assert [-retreat[axis] for axis in "xyz"] == approaches[-1]
    forces.append([message["max_contact_force"], *point["effort"]])
report(grips, joints=joints, opened=opened, quality=quality, approaches=approaches, forces=forces)
