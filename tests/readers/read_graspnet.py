import sys

import numpy

from common import grip, report

data = numpy.load(sys.argv[1], allow_pickle=False)
rows = data["grasps"]
assert rows.shape[1] == 17 and rows.dtype == numpy.float64
assert (data["scores"] == rows[:, 0]).all()
grips = [grip(id, row[13:16], row[4:13].reshape(3, 3), row[1], row[0]) for id, row in zip(data["ids"], rows)]
report(grips, height=rows[:, 2].tolist(), depth=rows[:, 3].tolist(), object=rows[:, 16].tolist(), api=data["api_scores"].tolist(), frame=str(data["tool_frame"]))
