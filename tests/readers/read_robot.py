"""Poses in millimetres with a robot maker's angles, turned into matrices by each maker's own definition."""

import csv
import sys

import numpy

from common import grip, report, rotation


def about(axis, degrees):
    c, s = numpy.cos(numpy.radians(degrees)), numpy.sin(numpy.radians(degrees))
    matrix = numpy.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def matrix(row):
    value = {name: float(text) for name, text in row.items() if name.endswith(("_rad", "_deg")) or name in ("q1", "q2", "q3", "q4")}
    if "rx_rad" in value:
        # Rodrigues' formula.
        vector = numpy.array([value["rx_rad"], value["ry_rad"], value["rz_rad"]])
        angle = numpy.linalg.norm(vector)
        x, y, z = vector / angle if angle > 0 else (0, 0, 0)
        k = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return numpy.eye(3) + numpy.sin(angle) * k + (1 - numpy.cos(angle)) * k @ k
    if "a_deg" in value:
        # A about z, B about the new y, C about the new x.
        return about(2, value["a_deg"]) @ about(1, value["b_deg"]) @ about(0, value["c_deg"])
    if "w_deg" in value:
        # W about x, then P about y, then R about z, all of them fixed.
        turned = about(1, value["p_deg"]) @ about(0, value["w_deg"])
        return about(2, value["r_deg"]) @ turned
    return numpy.array(rotation(value["q1"], value["q2"], value["q3"], value["q4"]))


with open(sys.argv[1], newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(file))
grips = [
    grip(
        row["id"],
        [float(row[name]) / 1e3 for name in ("x_mm", "y_mm", "z_mm")],
        matrix(row),
        float(row["jaw_gap_mm"]) / 1e3,
        row["mu_s"] or None,
    )
    for row in rows
]
report(grips, part=[row["part_file"] for row in rows], columns=list(rows[0]))
