#!/usr/bin/env python3
"""One batch done three ways: by the program, from Python, and by Ray on two local nodes. Are the tables
the same, and does the memory stay where it is while the parts become more?

    target/pytest/bin/python benches/batches/run.py --program target/debug/gripfast [--parts DIR] [--count 100]

The parts are meshes of DIR and plates, blocks and angles that are made here, ``count`` in all; what is
left out is named. Each way
writes a folder; all files but the ledgers, which hold times, must be the same bytes, split into shares
or not. The largest memory of the program is measured over a quarter, a half and all of the parts.
"""

import argparse
import json
import os
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

GRIPPERS = ["robotiq-2f85", "franka-hand", "onrobot-rg2"]
OPTIONS = {"density": "2700kg/m3", "spacing": "15mm", "angle_step": "90deg", "backend": "cpu"}
TOP, NEGATIVES = 20, 10
#: Larger meshes are left out: the run shall take minutes.
MOST_BYTES = 300_000


def prism(outline, height):
    """Triangles of a prism over a ring without inner corners but for one at the first point."""
    low, high = [(x, y, 0.0) for x, y in outline], [(x, y, height) for x, y in outline]
    count = len(outline)
    faces = []
    for k in range(1, count - 1):
        faces += [(low[0], low[k + 1], low[k]), (high[0], high[k], high[k + 1])]
    for k in range(count):
        n = (k + 1) % count
        faces += [(low[k], low[n], high[n]), (low[k], high[n], high[k])]
    return faces


def made(number):
    """A plate, a block, a hexagon or an angle, in millimetres."""
    chance = random.Random(number)
    a, b, c = (round(chance.uniform(low, high), 1) for low, high in ((20, 70), (8, 45), (4, 40)))
    wall = round(chance.uniform(3, 7), 1)
    outlines = [
        [(0, 0), (a, 0), (a, b), (0, b)],
        [(0, 0), (a, 0), (a - wall, b), (wall, b)],
        [(b, 0), (1.5 * b, 0.866 * b), (b, 1.732 * b), (0, 1.732 * b), (-0.5 * b, 0.866 * b), (0, 0)],
        [(wall, wall), (wall, b + 9), (0, b + 9), (0, 0), (a, 0), (a, wall)],
    ]
    return prism(outlines[number % 4], c)


def write_stl(path, faces):
    with open(path, "wb") as file:
        file.write(bytes(80) + struct.pack("<I", len(faces)))
        for face in faces:
            file.write(struct.pack("<12fH", 0, 0, 0, *(value for point in face for value in point), 0))


def of_use(binary, path):
    """Whether a mesh counts. Those in another unit than millimetres do not: a part of a twentieth of a
    millimetre between pads of centimetres takes minutes, and nobody asks for it."""
    if path.stat().st_size >= MOST_BYTES:
        print(f"left out: {path.name}: larger than {MOST_BYTES} bytes")
        return False
    told = subprocess.run([binary, "part", str(path)], capture_output=True, text=True, check=False)
    implausible = [line.strip() for line in told.stdout.splitlines() if "implausible size" in line]
    if implausible:
        print(f"left out: {path.name}: {implausible[0].partition(';')[0]}")
    return not implausible


def gather(folder, source, count, binary):
    """``count`` parts in a folder."""
    paths = []
    if source:
        meshes = sorted(Path(source).rglob("*"))
        paths = [p for p in meshes if p.suffix.lower() in (".stl", ".obj", ".ply", ".off", ".3mf")]
        paths = [p for p in paths if of_use(binary, p)][: count * 3 // 4]
    for place, path in enumerate(paths):
        os.symlink(path.resolve(), folder / f"{place:03}_{path.name}")
    for number in range(count - len(paths)):
        write_stl(folder / f"made_{number:03}.stl", made(number))
    return sorted(folder.iterdir())


def files(folder):
    ledgers = ("manifest.jsonl", "shards.jsonl")
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(Path(folder).rglob("*"))
        if path.is_file() and path.name not in ledgers
    }


def program(binary, parts, folder, *more):
    """Runs the program; its largest memory in MiB, and its seconds."""
    line = [binary, "batch", *map(str, parts), "-o", str(folder), "-q", "--fail-on", "none", *more]
    line += ["--top-k", str(TOP), "--negatives", str(NEGATIVES)]
    line += [word for gripper in GRIPPERS for word in ("--gripper", gripper)]
    line += [word for name, value in OPTIONS.items() for word in (f"--{name.replace('_', '-')}", value)]
    begin = time.time()
    child = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    assert status == 0, f"the program ended with {status}"
    return used.ru_maxrss / 1024, time.time() - begin


def outcomes(folder):
    """How many jobs ended how, and the seconds of all jobs and of the slowest parts."""
    counts, seconds = {}, {}
    with open(Path(folder) / "manifest.jsonl", encoding="utf-8") as lines:
        for line in lines:
            job = json.loads(line)
            counts[job["outcome"]] = counts.get(job["outcome"], 0) + 1
            seconds[job["part"]] = seconds.get(job["part"], 0) + job["seconds"]
    slowest = sorted(seconds, key=seconds.get, reverse=True)[:3]
    slow = ", ".join(f"{part} {seconds[part]:.1f}" for part in slowest)
    return f"{counts}, {sum(seconds.values()):.0f} job seconds (most: {slow})"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", required=True)
    parser.add_argument("--parts", help="folder with meshes")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--without", action="append", default=[], choices=["python", "ray"])
    arguments = parser.parse_args()
    work = Path(tempfile.mkdtemp(prefix="gripfast-batches-"))
    (work / "parts").mkdir()
    parts = gather(work / "parts", arguments.parts, arguments.count, arguments.program)
    print(f"{len(parts)} parts x {len(GRIPPERS)} grippers in {work}", flush=True)
    for count in (len(parts) // 4, len(parts) // 2, len(parts)):
        # Evenly over the list: large and small ones in the same shares.
        some = [parts[place * len(parts) // count] for place in range(count)]
        memory, seconds = program(arguments.program, some, work / f"program{count}")
        print(f"program, {count:4} parts: {memory:7.1f} MiB at most, {seconds:6.1f} s", flush=True)
    truth = files(work / f"program{len(parts)}")
    print(outcomes(work / f"program{len(parts)}"), len(truth), "files", flush=True)

    def compare(name, folder):
        found = files(folder)
        differ = [path for path in truth.keys() | found.keys() if truth.get(path) != found.get(path)]
        print(f"{name}: {'the same bytes' if not differ else f'DIFFERENT: {sorted(differ)[:5]}'}", flush=True)
        return bool(differ)

    wrong = 0
    program(arguments.program, parts, work / "split", "--split", "3")
    wrong += compare("program in shares", work / "split")
    if "python" in arguments.without:
        sys.exit(wrong)
    import gripfast

    batch = gripfast.Batch(parts, GRIPPERS, top=TOP, negatives=NEGATIVES, **OPTIONS)
    begin = time.time()
    batch.run(work / "python")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"Python: {memory:.1f} MiB at most, {time.time() - begin:.1f} s", flush=True)
    wrong += compare("Python", work / "python")
    if "ray" not in arguments.without:
        import ray
        from ray.cluster_utils import Cluster

        import gripfast.ray

        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
        cluster.add_node(num_cpus=1)
        cluster.connect()
        for split in (1, 4):
            begin = time.time()
            gripfast.ray.run(batch, work / f"ray{split}", split=split)
            print(f"Ray, two nodes, split {split}: {time.time() - begin:.1f} s", flush=True)
            wrong += compare(f"Ray, split {split}", work / f"ray{split}")
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"the machine that hands out: {memory:.1f} MiB at most", flush=True)
        ray.shutdown()
        cluster.shutdown()
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
