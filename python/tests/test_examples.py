"""The example for MoveIt 2, without ROS."""

from __future__ import annotations

import importlib.util
import sys

import numpy as np
import pytest
from conftest import COARSE, ROOT

import gripfast


def test_the_loader_for_moveit_reads_what_export_writes(tmp_path):
    pytest.importorskip("yaml")
    spec = importlib.util.spec_from_file_location("load_grips", ROOT / "examples/moveit2/load_grips.py")
    loader = importlib.util.module_from_spec(spec)
    sys.modules["load_grips"] = loader
    spec.loader.exec_module(loader)
    result = gripfast.plan("data/parts/hex_nut.stl", "robotiq-2f85", **COARSE)
    file = tmp_path / "grips.moveit.yaml"
    result.export(file, top=5, joint=["finger_joint:motion"], origin="pads")
    grips = loader.load(str(file))
    assert [grip.id for grip in grips] == [str(id) for id in result.ids[:5]]
    poses = result.tool_poses("moveit")
    for grip, pose in zip(grips, poses):
        assert np.allclose(grip.position, pose[:3, 3], atol=1e-12)
        assert np.allclose(grip.approach, pose[:3, 2], atol=1e-12)
        assert grip.opened["finger_joint"] < grip.closed["finger_joint"]
        x, y, z, w = grip.orientation_xyzw
        assert np.allclose(
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], pose[:3, 2]
        )
