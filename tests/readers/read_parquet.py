import json
import sys

import pyarrow.parquet

from common import grip, report, rotation

table = pyarrow.parquet.read_table(sys.argv[1])
rows = table.to_pylist()
grips = []
for row in rows:
    q = [row[name] for name in ("qw", "qx", "qy", "qz")]
    grips.append(grip(row["id"], [row["x_m"], row["y_m"], row["z_m"]], rotation(*q), row["width_m"], row["mu_s"]))
metadata = json.loads(table.schema.metadata[b"gripfast"])
report(
    grips,
    load_names=[row["load_name"] for row in rows],
    frames=[metadata["tool_frame"]] * len(rows),
    columns=table.column_names,
    mu_upper=[row["mu_upper"] for row in rows],
)
