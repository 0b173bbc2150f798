#!/usr/bin/env python3
"""The grips of `gripfast figures --benchmark` in physics engines: which friction does each need?

    gripfast figures --benchmark -o bench
    python3 -m venv engines && engines/bin/pip install mujoco drake
    engines/bin/python benches/engines/run.py bench/benchmark.json [--engine mujoco|drake] [--case ID]

Each engine holds the part between two rigid pads, ramps the load up, and says whether the part stays.
The smallest friction with which it does is found by bisection and printed beside the exact one. The
pads are coupled as the jaws of a gripper: a push along the closing axis moves none of them. Not a
test: an engine's answer depends on its contact model, its step and its patience. MuJoCo takes some
seconds a grip, Drake with hydroelastic contact some minutes.

What to expect: straight slides agree to 0.2 %. MuJoCo's contact forces minimise one convex function,
in which friction and normal force trade: where a part turns, normal force moves to the points that
slip fastest (seen in its contact forces: on the square their mean distance from the middle rises from
7.64 to 8.32 mm once it turns), so the part creeps but stays with 10 to 20 % less friction than equal
pressure allows. Drake's contact SAP does the same; its lagged one, which is used here, does not.
"""

import argparse
import json

import numpy as np

#: Mass of the part [kg] and radius of gyration [m]: they decide how fast it slips, not whether.
MASS, GYRATION = 0.05, 0.01
#: Time to ramp the load up, and to hold it [s].
RAMP, HOLD = 0.05, 0.1
#: The part has slipped when it moves by more than this while it is held [m, or rad times 10 mm].
SLIPPED = 2e-3
#: Half a pad, and its thickness [m].
PAD, THICK = 0.06, 0.01


def inside(point, ring):
    """Whether a point lies in a convex ring, counter-clockwise."""
    edges = np.roll(ring, -1, axis=0) - ring
    to = point - ring
    return bool(np.all(edges[:, 0] * to[:, 1] - edges[:, 1] * to[:, 0] >= -1e-12))


def cells(case, spacing):
    """Middles of the cells of a grid whose cells lie in the part's face."""
    points = []
    for ring in map(np.array, case["pieces"]):
        low, high = ring.min(axis=0), ring.max(axis=0)
        counts = np.maximum(1, np.round((high - low) / spacing)).astype(int)
        step = (high - low) / counts
        grid = np.stack(np.meshgrid(*[np.arange(n) + 0.5 for n in counts], indexing="ij"), axis=-1)
        points += [point for point in (low + grid.reshape(-1, 2) * step) if inside(point, ring)]
    return np.array(points)


def mujoco_holds(case, mu, spacing):
    """Whether MuJoCo's part stays: a grid of small spheres on both faces between rigid pads."""
    import mujoco

    half, radius = case["distance"] / 2, 2e-4
    spheres = "".join(
        f'<geom type="sphere" size="{radius}" pos="{x} {y} {side * (half - radius)}"/>'
        for x, y in cells(case, spacing)
        for side in (-1, 1)
    )
    inertia = MASS * GYRATION**2
    pads = "".join(
        f'<body name="{name}" pos="0 0 {side * (half + THICK)}"><joint name="{name}" type="slide" axis="0 0 1" damping="200"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        f'<geom type="box" size="{PAD} {PAD} {THICK}" contype="2" conaffinity="1"/></body>'
        for name, side in (("low", -1), ("high", 1))
    )
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="2e-4" cone="elliptic" impratio="50" integrator="implicitfast"/>
        <default><geom friction="{mu} 0 0" condim="3" contype="1" conaffinity="2" solref="0.002 1"/></default>
        <worldbody>{pads}<body name="part"><freejoint/>
        <inertial pos="0 0 0" mass="{MASS}" diaginertia="{inertia} {inertia} {inertia}"/>{spheres}</body>
        </worldbody><equality><joint joint1="low" joint2="high" polycoef="0 -1 0 0 0" solref="0.002 1"/></equality></mujoco>"""
    )
    data = mujoco.MjData(model)
    index = {name: mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) for name in ("low", "high", "part")}
    load = np.concatenate([case["load"]["force"], case["load"]["moment"]])
    steps = int((2 * RAMP + HOLD) / model.opt.timestep)
    place = None
    for step in range(steps):
        time = step * model.opt.timestep
        data.xfrc_applied[index["low"], 2] = case["force"]
        data.xfrc_applied[index["high"], 2] = -case["force"]
        data.xfrc_applied[index["part"]] = load * np.clip((time - RAMP) / RAMP, 0, 1)
        mujoco.mj_step(model, data)
        if place is None and time >= 2 * RAMP:
            place = data.qpos[-7:].copy()
        if place is not None and moved(place, data.qpos[-7:]) > SLIPPED:
            return False
    return True


def moved(before, after):
    """Distance and turn between two poses (position, quaternion w x y z)."""
    turn = 2 * np.arccos(np.clip(abs(np.dot(before[3:], after[3:])), 0, 1))
    return np.linalg.norm(after[:3] - before[:3]) + 0.01 * turn


def drake_holds(case, mu, spacing):
    """Whether Drake's part stays: compliant hydroelastic boxes between rigid pads."""
    from pydrake.geometry import AddCompliantHydroelasticProperties, AddContactMaterial
    from pydrake.geometry import AddRigidHydroelasticProperties, Box, ProximityProperties
    from pydrake.math import RigidTransform
    from pydrake.multibody.math import SpatialForce
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.plant import ContactModel, DiscreteContactApproximation
    from pydrake.multibody.plant import ExternallyAppliedSpatialForce
    from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder, LeafSystem
    from pydrake.common.value import Value

    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 5e-4)
    plant.set_contact_model(ContactModel.kHydroelastic)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    gyration = UnitInertia(*[GYRATION**2] * 3)
    half = case["distance"] / 2

    def properties(compliant):
        made = ProximityProperties()
        AddContactMaterial(1.0, None, CoulombFriction(mu, mu), made)
        if compliant:
            AddCompliantHydroelasticProperties(spacing, 5e7, made)
        else:
            AddRigidHydroelasticProperties(0.05, made)
        return made

    part = plant.AddRigidBody("part", SpatialInertia(MASS, [0, 0, 0], gyration))
    # In columns: Drake takes the friction of each face of its coarse meshes at one point.
    for number, (x, y) in enumerate(cells(case, spacing)):
        column = Box(spacing, spacing, 2 * half)
        place = RigidTransform([x, y, 0])
        plant.RegisterCollisionGeometry(part, place, column, f"column{number}", properties(True))
    bodies, slides = {"part": part}, []
    for name, side in (("low", -1), ("high", 1)):
        pad = plant.AddRigidBody(name, SpatialInertia(1.0, [0, 0, 0], UnitInertia(1, 1, 1)))
        place = RigidTransform([0, 0, side * (half + THICK)])
        slide = PrismaticJoint(name, plant.world_frame(), pad.body_frame(), [0, 0, 1], damping=200.0)
        slides.append(plant.AddJoint(slide))
        box = Box(2 * PAD, 2 * PAD, 2 * THICK)
        plant.RegisterCollisionGeometry(pad, place, box, name, properties(False))
        bodies[name] = pad
    plant.AddCouplerConstraint(slides[0], slides[1], -1.0)
    plant.Finalize()

    load = np.concatenate([case["load"]["moment"], case["load"]["force"]])

    class Loads(LeafSystem):
        def __init__(self):
            super().__init__()
            self.DeclareAbstractOutputPort(
                "forces", lambda: Value([ExternallyAppliedSpatialForce()]), self.calc
            )

        def calc(self, context, output):
            time = context.get_time()
            share = np.clip((time - RAMP) / RAMP, 0, 1)
            entries = []
            for name, force in (
                ("low", np.array([0, 0, 0, 0, 0, case["force"]])),
                ("high", np.array([0, 0, 0, 0, 0, -case["force"]])),
                ("part", load * share),
            ):
                entry = ExternallyAppliedSpatialForce()
                entry.body_index = bodies[name].index()
                entry.p_BoBq_B = np.zeros(3)
                entry.F_Bq_W = SpatialForce(force[:3], force[3:])
                entries.append(entry)
            output.set_value(entries)

    loads = builder.AddSystem(Loads())
    builder.Connect(loads.get_output_port(), plant.get_applied_spatial_force_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyContextFromRoot(simulator.get_mutable_context())

    def pose():
        found = plant.EvalBodyPoseInWorld(context, part)
        return np.concatenate([found.translation(), found.rotation().ToQuaternion().wxyz()])

    simulator.AdvanceTo(2 * RAMP)
    place = pose()
    for time in np.arange(2 * RAMP, 2 * RAMP + HOLD, 0.005):
        simulator.AdvanceTo(time + 0.005)
        if moved(place, pose()) > SLIPPED:
            return False
    return True


ENGINES = {"mujoco": (mujoco_holds, 1e-3), "drake": (drake_holds, 4e-3)}


def friction(holds, case, spacing, tolerance):
    """The smallest friction with which the part stays."""
    low, high = 0.5 * case["mu_s"], 1.5 * case["mu_s"]
    if holds(case, low, spacing):
        return f"below {low:.4f}"
    if not holds(case, high, spacing):
        return f"above {high:.4f}"
    while high - low > tolerance * case["mu_s"]:
        middle = (low + high) / 2
        low, high = (low, middle) if holds(case, middle, spacing) else (middle, high)
    return (low + high) / 2


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file")
    parser.add_argument("--engine", choices=ENGINES, action="append")
    parser.add_argument("--case", action="append", help="only this case")
    parser.add_argument("--tolerance", type=float, default=1e-3, help="of the bisection, relative")
    arguments = parser.parse_args()
    with open(arguments.file, encoding="utf-8") as file:
        cases = json.load(file)["cases"]
    print(f"{'case':16} {'exact':>10} {'gripfast':>10}", *(f"{name:>10} {'off by':>8}" for name in ENGINES))
    for case in cases:
        if arguments.case and case["id"] not in arguments.case:
            continue
        line = f"{case['id']:16} {case['mu_s']:10.6f} {case['solved']:10.6f}"
        for name in arguments.engine or ENGINES:
            holds, spacing = ENGINES[name]
            found = friction(holds, case, spacing, arguments.tolerance)
            if isinstance(found, str):
                line += f" {found:>19}"
            else:
                line += f" {found:10.6f} {100 * (found / case['mu_s'] - 1):+7.2f}%"
        print(line, flush=True)


if __name__ == "__main__":
    main()
