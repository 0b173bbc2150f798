#!/usr/bin/env python3
"""Writes the shipped sample parts: binary STL files in millimetres and parts.json with their exact truth.

Every part is a set of signed prisms (a polygon extruded along an axis), so its volume, centre of mass and inertia follow
from polygon formulas that know nothing of the triangles. All coordinates are multiples of 1/1024 mm: they are exact in
the STL's 32-bit numbers, the whole computation runs in integers and fractions, and the script's own check demands that the
triangles' volume and centre EQUAL the formulas', not only that they are close.

    python3 data/make_parts.py          rewrite data/parts (same bytes every time)
    python3 data/make_parts.py --check  compare with what is there, write nothing

Python 3.11 or later, standard library only.
"""

import json
import math
import pathlib
import struct
import sys
from fractions import Fraction

GRID = 1024  # steps per millimetre
HERE = pathlib.Path(__file__).resolve().parent / "parts"


def snap(value_mm):
    """A length in millimetres as a whole number of grid steps."""
    return round(value_mm * GRID)


def ring(points_mm):
    return [(snap(x), snap(y)) for x, y in points_mm]


def rectangle(x0, y0, x1, y1):
    return ring([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def circle(x, y, radius, sides):
    """A polygon inscribed in the circle; for an even number of sides opposite sides are exactly parallel after snapping."""
    step = 2 * math.pi / sides
    centre = (snap(x), snap(y))
    return [(centre[0] + snap(radius * math.cos(step * k)), centre[1] + snap(radius * math.sin(step * k))) for k in range(sides)]


def oblong(x, y, length, radius, sides_per_end):
    """A slot along x with round ends, `length` between the centres of the ends."""
    right = [(length / 2 + radius * math.sin(math.pi * k / sides_per_end), -radius * math.cos(math.pi * k / sides_per_end)) for k in range(sides_per_end + 1)]
    points = right + [(-px, -py) for px, py in right]
    return ring([(x + px, y + py) for px, py in points])


def doubled_area(loop):
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(loop, loop[1:] + loop[:1]))


def left(loop):
    """The loop counter-clockwise."""
    return loop if doubled_area(loop) > 0 else loop[::-1]


def right(loop):
    """The loop clockwise."""
    return loop if doubled_area(loop) < 0 else loop[::-1]


# --- moments of a polygon, exact -------------------------------------------------------------------------------------

def loop_moments(loop):
    """Integrals of 1, x, y, xx, xy, yy over the inside of a loop (negative for a clockwise one)."""
    total = [Fraction(0)] * 6
    for (x0, y0), (x1, y1) in zip(loop, loop[1:] + loop[:1]):
        cross = x0 * y1 - x1 * y0
        total[0] += Fraction(cross, 2)
        total[1] += Fraction(cross * (x0 + x1), 6)
        total[2] += Fraction(cross * (y0 + y1), 6)
        total[3] += Fraction(cross * (x0 * x0 + x0 * x1 + x1 * x1), 12)
        total[4] += Fraction(cross * (2 * x0 * y0 + x0 * y1 + x1 * y0 + 2 * x1 * y1), 24)
        total[5] += Fraction(cross * (y0 * y0 + y0 * y1 + y1 * y1), 12)
    return total


class Frame:
    """Axes along the part's axes, so that every number stays on the grid. `axes[i]` is the part axis of local axis i."""

    def __init__(self, axes, origin_mm=(0, 0, 0)):
        self.axes = axes
        self.origin = [snap(c) for c in origin_mm]

    def point(self, x, y, z):
        out = list(self.origin)
        for axis, value in zip(self.axes, (x, y, z)):
            out[axis] += value
        return tuple(out)


# Right-handed permutations only: an extrusion along z, along x and along y.
ALONG_Z, ALONG_X, ALONG_Y = Frame((0, 1, 2)), Frame((1, 2, 0)), Frame((2, 0, 1))


class Solid:
    """Faces for the mesh; signed prisms for the truth. The two are written down separately and must agree."""

    def __init__(self, name, what):
        self.name, self.what = name, what
        self.faces = []  # (label, list of 3-D loops: outer first, seen from outside counter-clockwise)
        self.facets = 0
        self.volume = Fraction(0)
        self.first = [Fraction(0)] * 3
        self.second = [[Fraction(0)] * 3 for _ in range(3)]

    def cap(self, label, frame, height_mm, up, outer, holes=()):
        """A flat face at local z = height, its material below it when `up`, above it otherwise."""
        height = snap(height_mm)
        loops = [left(outer)] + [right(hole) for hole in holes]
        if not up:
            loops = [loop[::-1] for loop in loops]
        self.faces.append((label, [[frame.point(x, y, height) for x, y in loop] for loop in loops]))

    def wall(self, label, frame, loop, from_mm, to_mm, named=False):
        """The side faces over a loop with the material on its left. Facets of a round wall stay out of the face list."""
        low, high = snap(from_mm), snap(to_mm)
        for a, b in zip(loop, loop[1:] + loop[:1]):
            quad = [frame.point(*a, low), frame.point(*b, low), frame.point(*b, high), frame.point(*a, high)]
            self.faces.append((label if named else None, [quad]))

    def prism(self, frame, loop, from_mm, to_mm, sign):
        """Adds or removes the solid over the inside of a loop."""
        area, sx, sy, sxx, sxy, syy = [sign * m for m in loop_moments(left(loop))]
        low, high = Fraction(snap(from_mm)), Fraction(snap(to_mm))
        h1, h2, h3 = high - low, (high**2 - low**2) / 2, (high**3 - low**3) / 3
        first = [sx * h1, sy * h1, area * h2]
        second = [[sxx * h1, sxy * h1, sx * h2], [sxy * h1, syy * h1, sy * h2], [sx * h2, sy * h2, area * h3]]
        if any(frame.origin):
            raise ValueError("moments are taken about the part origin")
        self.volume += area * h1
        for i, i_part in enumerate(frame.axes):
            self.first[i_part] += first[i]
            for j, j_part in enumerate(frame.axes):
                self.second[i_part][j_part] += second[i][j]

    def drill(self, label, frame, loop, from_mm, to_mm):
        """Removes a through hole (its rims must be holes of the caps it pierces)."""
        self.wall(label, frame, right(loop), from_mm, to_mm)
        self.prism(frame, loop, from_mm, to_mm, -1)


# --- triangles -------------------------------------------------------------------------------------------------------

def orient(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def segments_touch(a, b, c, d):
    """Whether the closed segments ab and cd share a point."""
    o1, o2, o3, o4 = orient(a, b, c), orient(a, b, d), orient(c, d, a), orient(c, d, b)
    if ((o1 > 0) != (o2 > 0)) and ((o3 > 0) != (o4 > 0)) and o1 and o2 and o3 and o4:
        return True

    def on(p, q, r):
        return min(p[0], q[0]) <= r[0] <= max(p[0], q[0]) and min(p[1], q[1]) <= r[1] <= max(p[1], q[1])

    return (o1 == 0 and on(a, b, c)) or (o2 == 0 and on(a, b, d)) or (o3 == 0 and on(c, d, a)) or (o4 == 0 and on(c, d, b))


def triangulate(loops):
    """Triangles (as points) of a polygon with holes: holes joined by bridges, then ears cut. Adds no point."""
    outline = list(loops[0])
    holes = sorted(loops[1:], key=lambda hole: max(hole), reverse=True)
    while holes:
        hole = holes.pop(0)
        rest = holes
        best = None
        for i, p in enumerate(hole):
            for j, q in enumerate(outline):
                length = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2
                if best is not None and length >= best[0]:
                    continue
                # A bridge may meet the boundary only in its own ends, and must leave the outline towards the inside.
                edges = [(r[k], r[(k + 1) % len(r)]) for r in [outline, hole, *rest] for k in range(len(r))]
                if any(e0 not in (p, q) and e1 not in (p, q) and segments_touch(p, q, e0, e1) for e0, e1 in edges):
                    continue
                before, after = outline[j - 1], outline[(j + 1) % len(outline)]
                inside = orient(before, q, p) > 0 and orient(q, after, p) > 0 if orient(before, q, after) >= 0 else orient(before, q, p) > 0 or orient(q, after, p) > 0
                if inside and not any(e0 != p and e0 != q and orient(p, q, e0) == 0 and segments_touch(p, q, e0, e0) for e0, _ in edges):
                    best = (length, i, j)
        _, i, j = best
        outline = outline[: j + 1] + hole[i:] + hole[: i + 1] + outline[j:]
    triangles = []
    index = 0
    stuck = 0
    while len(outline) > 3:
        n = len(outline)
        a, b, c = outline[(index - 1) % n], outline[index % n], outline[(index + 1) % n]
        ear = orient(a, b, c) > 0 and not any(
            p not in (a, b, c) and orient(a, b, p) >= 0 and orient(b, c, p) >= 0 and orient(c, a, p) >= 0 for p in outline
        )
        if ear:
            triangles.append((a, b, c))
            del outline[index % n]
            index += 1  # skip one, so that the triangles do not all fan out from one corner
            stuck = 0
        else:
            index += 1
            stuck += 1
            if stuck > 2 * n:
                raise ValueError("no ear left: the polygon is not simple")
    if orient(*outline) <= 0:
        raise ValueError("the last triangle is not counter-clockwise")
    triangles.append(tuple(outline))
    return triangles


def doubled_normal(loop):
    """Newell's normal: its length is twice the area."""
    n = [0, 0, 0]
    for p, q in zip(loop, loop[1:] + loop[:1]):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            n[i] += p[j] * q[k] - p[k] * q[j]
    return n


def face_triangles(loops):
    """Triangles of a plane 3-D face: dropped along the largest component of its normal, which keeps integers integers."""
    normal = doubled_normal(loops[0])
    drop = max(range(3), key=lambda i: abs(normal[i]))
    u, v = ((drop + 1) % 3, (drop + 2) % 3)
    if normal[drop] < 0:
        u, v = v, u
    lifted = {(p[u], p[v]): p for loop in loops for p in loop}
    return [tuple(lifted[p] for p in triangle) for triangle in triangulate([[(p[u], p[v]) for p in loop] for loop in loops])]


# --- the parts -------------------------------------------------------------------------------------------------------

def l_bracket():
    solid = Solid("l_bracket", "L bracket 60 x 40 x 50 mm, 6 mm thick: two holes and a slot in the foot, two holes in the upright")
    profile = [(snap(z), snap(x)) for z, x in [(0, 0), (0, 60), (6, 60), (6, 6), (50, 6), (50, 0)]]
    foot = [circle(20, 10, 3.25, 32), circle(20, 30, 3.25, 32), oblong(44, 20, 10, 3.25, 16)]  # (x, y)
    upright = [circle(10, 34, 2.75, 32), circle(30, 34, 2.75, 32)]  # (y, z)
    solid.cap("foot, below", ALONG_Z, 0, False, rectangle(0, 0, 60, 40), foot)
    solid.cap("foot, above", ALONG_Z, 6, True, rectangle(6, 0, 60, 40), foot)
    solid.cap("foot, end", ALONG_X, 60, True, rectangle(0, 0, 40, 6))
    solid.cap("upright, back", ALONG_X, 0, False, rectangle(0, 0, 40, 50), upright)
    solid.cap("upright, front", ALONG_X, 6, True, rectangle(0, 6, 40, 50), upright)
    solid.cap("upright, top", ALONG_Z, 50, True, rectangle(0, 0, 6, 40))
    solid.cap("side, near", ALONG_Y, 0, False, profile)
    solid.cap("side, far", ALONG_Y, 40, True, profile)
    solid.prism(ALONG_Y, profile, 0, 40, 1)
    for hole in foot:
        solid.drill("foot hole", ALONG_Z, hole, 0, 6)
    for hole in upright:
        solid.drill("upright hole", ALONG_X, hole, 0, 6)
    return solid


def pocket_plate():
    solid = Solid("pocket_plate", "plate 120 x 80 x 16 mm: two blind pockets (10 and 12 mm deep), a through window, four holes")
    plate = rectangle(0, 0, 120, 80)
    chamfered = ring([(16, 14), (52, 14), (56, 18), (56, 62), (52, 66), (16, 66), (12, 62), (12, 18)])
    round_pocket = circle(88, 26, 14, 48)
    window = rectangle(70, 52, 106, 66)
    holes = [circle(x, y, 2.25, 24) for x, y in [(6, 6), (114, 6), (114, 74), (6, 74)]]
    solid.cap("bottom", ALONG_Z, 0, False, plate, [window, *holes])
    solid.cap("top", ALONG_Z, 16, True, plate, [chamfered, round_pocket, window, *holes])
    solid.cap("floor of the chamfered pocket", ALONG_Z, 6, True, chamfered)
    solid.cap("floor of the round pocket", ALONG_Z, 4, True, round_pocket)
    solid.wall("side", ALONG_Z, left(plate), 0, 16, named=True)
    solid.wall("wall of the chamfered pocket", ALONG_Z, right(chamfered), 6, 16, named=True)
    solid.wall("wall of the round pocket", ALONG_Z, right(round_pocket), 4, 16)
    solid.wall("wall of the window", ALONG_Z, right(window), 0, 16, named=True)
    for hole in holes:
        solid.wall("hole", ALONG_Z, right(hole), 0, 16)
    solid.prism(ALONG_Z, plate, 0, 16, 1)
    for loop, low in [(chamfered, 6), (round_pocket, 4), (window, 0), *((hole, 0) for hole in holes)]:
        solid.prism(ALONG_Z, loop, low, 16, -1)
    return solid


def extrusion(solid, outer, holes, length, names=("end, below", "end, above", "side")):
    solid.cap(names[0], ALONG_Z, 0, False, outer, holes)
    solid.cap(names[1], ALONG_Z, length, True, outer, holes)
    solid.wall(names[2], ALONG_Z, left(outer), 0, length, named=True)
    solid.prism(ALONG_Z, outer, 0, length, 1)
    for hole in holes:
        solid.drill("bore", ALONG_Z, hole, 0, length)
    return solid


def hex_nut():
    solid = Solid("hex_nut", "hexagon nut blank, 16 mm across flats, 8 mm high, 8.5 mm bore (no thread, no chamfer)")
    corner = 16 / math.sqrt(3)
    outer = ring([(corner * math.cos(math.radians(a)), corner * math.sin(math.radians(a))) for a in range(0, 360, 60)])
    return extrusion(solid, outer, [circle(0, 0, 4.25, 48)], 8, ("bottom", "top", "flat"))


def t_slot_bar():
    solid = Solid("t_slot_bar", "T-slot bar 20 x 20 mm, 100 mm long: a 6 mm slot opening into an 11 mm channel on each side, 4.25 mm core bore")
    half_side = [(10, -10), (10, -3), (8.5, -3), (8.5, -5.5), (7.5, -5.5), (4.5, -2.5)]  # right side, lower half
    right_side = half_side + [(x, -y) for x, y in reversed(half_side)][:-1]
    outer = []
    for turn in range(4):
        cosine, sine = [(1, 0), (0, 1), (-1, 0), (0, -1)][turn]
        outer += [(x * cosine - y * sine, x * sine + y * cosine) for x, y in right_side]
    return extrusion(solid, ring(outer), [circle(0, 0, 2.125, 32)], 100, ("end, below", "end, above", "side"))


def spur_gear():
    solid = Solid("spur_gear", "spur gear, module 2 mm, 24 teeth, 20 degree involutes (6 chords a flank), 12 mm wide, 12 mm bore with a 4 mm keyway")
    module, teeth, pressure = 2.0, 24, math.radians(20)
    pitch = module * teeth / 2
    base, tip, root = pitch * math.cos(pressure), pitch + module, pitch - 1.25 * module
    involute = lambda r: math.sqrt((r / base) ** 2 - 1) - math.acos(base / r)
    half = math.pi / (2 * teeth) + involute(pitch)
    start = max(base, root)
    flank = [(start + (tip - start) * k / 6) for k in range(7)]
    tooth = [(root, -(half - involute(start)))] + [(r, -(half - involute(r))) for r in flank]
    tooth += [(r, -angle) for r, angle in reversed(tooth)]
    outer = [(r * math.cos(a + 2 * math.pi * k / teeth), r * math.sin(a + 2 * math.pi * k / teeth)) for k in range(teeth) for r, a in tooth]
    key_half, key_top, bore = 2.0, 7.75, 6.0
    gap = math.asin(key_half / bore)
    arc = [math.pi / 2 + gap + (2 * math.pi - 2 * gap) * k / 44 for k in range(45)]
    hole = [(bore * math.cos(a), bore * math.sin(a)) for a in arc]
    hole = hole[1:-1] + [(key_half, bore * math.cos(gap)), (key_half, key_top), (-key_half, key_top), (-key_half, bore * math.cos(gap))]
    return extrusion(solid, ring(outer), [ring(hole)], 12, ("end, below", "end, above", "tooth"))


def shaft_key():
    solid = Solid("shaft_key", "parallel key 8 x 7 x 40 mm, square ends: a plain box")
    return extrusion(solid, rectangle(-4, -3.5, 4, 3.5), [], 40)


PARTS = [l_bracket, pocket_plate, hex_nut, t_slot_bar, spur_gear, shaft_key]

# --- check and write -------------------------------------------------------------------------------------------------


def check(solid, triangles):
    """Closed, outward, and with exactly the volume and the centre that the prisms give."""
    edges = set()
    for triangle in triangles:
        for a, b in zip(triangle, triangle[1:] + triangle[:1]):
            if (a, b) in edges:
                raise ValueError(f"{solid.name}: the edge {a} -> {b} occurs twice")
            edges.add((a, b))
    if any((b, a) not in edges for a, b in edges):
        raise ValueError(f"{solid.name}: an edge has no partner: the mesh is not closed")
    volume, first = Fraction(0), [Fraction(0)] * 3
    for a, b, c in triangles:
        det = sum(a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]) for i in range(3))
        volume += Fraction(det, 6)
        for i in range(3):
            first[i] += Fraction(det * (a[i] + b[i] + c[i]), 24)
    if volume != solid.volume or first != solid.first:
        raise ValueError(f"{solid.name}: the triangles' volume or centre is not the prisms'")


def stl(solid, triangles):
    """Binary STL: normals are facts of the corners, rounded."""
    out = bytearray(f"gripfast sample part {solid.name}, millimetres".encode().ljust(80, b" "))
    out += struct.pack("<I", len(triangles))
    for triangle in triangles:
        n = doubled_normal(list(triangle))
        length = math.sqrt(sum(c * c for c in n))
        values = [c / length for c in n] + [c / GRID for p in triangle for c in p]
        if any(struct.unpack("<f", struct.pack("<f", v))[0] != v for v in values[3:]):
            raise ValueError(f"{solid.name}: a coordinate does not fit a 32-bit number")
        out += struct.pack("<12fH", *values, 0)
    return bytes(out)


def truth(solid, triangles):
    centre = [m / solid.volume for m in solid.first]
    central = [[solid.second[i][j] - centre[i] * centre[j] * solid.volume for j in range(3)] for i in range(3)]
    trace = sum(central[i][i] for i in range(3))
    inertia = [[(trace if i == j else 0) - central[i][j] for j in range(3)] for i in range(3)]
    faces = []
    for label, loops in solid.faces:
        if label is None:
            continue
        doubled = [sum(values) for values in zip(*(doubled_normal(loop) for loop in loops))]
        length = math.sqrt(sum(c * c for c in doubled))
        normal = [c / length for c in doubled]
        faces.append({
            "name": label,
            "normal": [round(c, 12) + 0.0 for c in normal],
            "offset_mm": round(sum(c * p for c, p in zip(normal, loops[0][0])) / GRID, 9) + 0.0,
            "area_mm2": round(length / 2 / GRID**2, 9),
            "holes": len(loops) - 1,
        })
    corners = [[f([p[i] for t in triangles for p in t]) / GRID for i in range(3)] for f in (min, max)]
    volume = solid.volume / GRID**3
    return {
        "file": f"{solid.name}.stl",
        "what": solid.what,
        "unit": "mm",
        "triangles": len(triangles),
        "bbox_mm": corners,
        "volume_mm3": float(volume),
        "volume_mm3_exact": f"{volume.numerator}/{volume.denominator}",
        "centre_of_mass_mm": [float(c / GRID) for c in centre],
        "inertia_about_centre_mm5": [[float(c / GRID**5) for c in row] for row in inertia],
        "faces": faces,
        "wall_facets_left_out": sum(1 for label, _ in solid.faces if label is None),
    }


def main():
    files, parts = {}, []
    for make in PARTS:
        solid = make()
        triangles = [t for _, loops in solid.faces for t in face_triangles(loops)]
        check(solid, triangles)
        files[f"{solid.name}.stl"] = stl(solid, triangles)
        parts.append(truth(solid, triangles))
        print(f"{solid.name}: {len(triangles)} triangles, {parts[-1]['volume_mm3']:.6f} mm^3, closed, exact")
    note = "Inertia is at unit density. Faces: plane faces by construction; coplanar pieces are listed one by one; walls of bores, of drilled holes and of the round pocket are left out."
    files["parts.json"] = (json.dumps({"unit": "mm", "note": note, "parts": parts}, indent=1) + "\n").encode()
    if "--check" in sys.argv[1:]:
        stale = [name for name, data in files.items() if not (HERE / name).is_file() or (HERE / name).read_bytes() != data]
        if stale:
            sys.exit(f"not what the script writes: {', '.join(stale)}")
        return
    HERE.mkdir(exist_ok=True)
    for name, data in files.items():
        (HERE / name).write_bytes(data)


if __name__ == "__main__":
    main()
