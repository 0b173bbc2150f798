#!/usr/bin/env python3
"""Reads `gripfast export grips.json -o grips.moveit.yaml --origin flange` in ROS 2.

    python3 load_grips.py grips.moveit.yaml            # prints the best grips; needs PyYAML only
    python3 load_grips.py grips.moveit.yaml --publish  # a node that publishes them (rclpy)

ROS 2 has no pick action any more that would take moveit_msgs/Grasp messages. What a pick needs of
each grip is its pose, its approach and the postures of the hand: `load` gives these in the order of
the file, best first. In MoveIt Task Constructor the pose is the target of a `ComputeIK` stage whose
frame is the robot's flange; the approach and the lift are `MoveRelative` stages along
`pre_grasp_approach`; the hand goes to `pre_grasp_posture` before, and to `grasp_posture` after.
"""

import argparse
from dataclasses import dataclass

import yaml


@dataclass(frozen=True)
class Grip:
    """One grip: the pose of the flange in the part's frame, and how to get there."""

    id: str
    frame: str
    position: tuple[float, float, float]
    orientation_xyzw: tuple[float, float, float, float]
    approach: tuple[float, float, float]
    approach_distance: float
    opened: dict[str, float]
    closed: dict[str, float]
    quality: float


def load(path: str) -> list[Grip]:
    """The grips of a file, best first."""
    with open(path, encoding="utf-8") as file:
        messages = yaml.safe_load(file)
    return [grip(message) for message in messages or []]


def grip(message: dict) -> Grip:
    pose = message["grasp_pose"]["pose"]
    approach = message["pre_grasp_approach"]
    vector = lambda values, names: tuple(float(values[name]) for name in names)
    return Grip(
        id=str(message["id"]),
        frame=message["grasp_pose"]["header"]["frame_id"],
        position=vector(pose["position"], "xyz"),
        orientation_xyzw=vector(pose["orientation"], "xyzw"),
        approach=vector(approach["direction"]["vector"], "xyz"),
        approach_distance=float(approach["desired_distance"]),
        opened=posture(message["pre_grasp_posture"]),
        closed=posture(message["grasp_posture"]),
        quality=float(message["grasp_quality"]),
    )


def posture(trajectory: dict) -> dict[str, float]:
    """Joint positions of the last point of a trajectory."""
    return dict(zip(trajectory["joint_names"], trajectory["points"][-1]["positions"]))


def publish(grips: list[Grip]) -> None:
    """Publishes the poses, latched, on /grips: RViz shows them, a task subscribes to them."""
    import rclpy
    from geometry_msgs.msg import Pose, PoseArray
    from rclpy.node import Node
    from rclpy.qos import DurabilityPolicy, QoSProfile

    rclpy.init()
    node = Node("gripfast_grips")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = node.create_publisher(PoseArray, "grips", latched)
    message = PoseArray()
    message.header.frame_id = grips[0].frame
    for grip in grips:
        pose = Pose()
        pose.position.x, pose.position.y, pose.position.z = grip.position
        q = pose.orientation
        q.x, q.y, q.z, q.w = grip.orientation_xyzw
        message.poses.append(pose)
    publisher.publish(message)
    rclpy.spin(node)


def main() -> None:
    parser = argparse.ArgumentParser(description="Reads grips for MoveIt 2.")
    parser.add_argument("file")
    parser.add_argument("--publish", action="store_true")
    parser.add_argument("--top", type=int, default=10)
    arguments = parser.parse_args()
    grips = load(arguments.file)[: arguments.top]
    if not grips:
        raise SystemExit("the file holds no grip")
    if arguments.publish:
        publish(grips)
    for grip in grips:
        print(grip.id, grip.position, grip.orientation_xyzw, f"quality {grip.quality:.4f}")


if __name__ == "__main__":
    main()
