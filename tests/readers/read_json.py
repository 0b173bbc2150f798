"""Native JSON and JSON Lines with the standard library; poses are those of the grip frame."""

import json
import sys

from common import grip, report


def refuse(text):
    raise ValueError(f"{text} is not JSON")


with open(sys.argv[1], encoding="utf-8") as file:
    text = file.read()
if sys.argv[1].endswith(".jsonl"):
    lines = [json.loads(line, parse_constant=refuse) for line in text.splitlines()]
    head, rows = lines[0], lines[1:]
    assert head["grips"] == []
else:
    head = json.loads(text, parse_constant=refuse)
    rows = head["grips"]
assert (head["format"], head["version"]) == ("gripfast-grips", 2)
grips = []
for row in rows:
    # The nine numbers are the columns one after the other.
    c = row["part_from_grip"]["rotation"]
    matrix = [[c[0], c[3], c[6]], [c[1], c[4], c[7]], [c[2], c[5], c[8]]]
    grips.append(grip(row["id"], row["part_from_grip"]["origin"], matrix, row["width"], row["worst"]["mu_s"]))
report(grips)
