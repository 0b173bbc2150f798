import csv
import sys

from common import grip, report, rotation

with open(sys.argv[1], newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(file))
grips = []
for row in rows:
    q = [float(row[name]) for name in ("qw", "qx", "qy", "qz")]
    position = [float(row[name]) for name in ("x_m", "y_m", "z_m")]
    grips.append(grip(row["id"], position, rotation(*q), row["width_m"], row["mu_s"] or None))
report(grips, load_names=[row["load_name"] for row in rows], frames=[row["tool_frame"] for row in rows])
