"""Batches on a cluster of two machines of Ray, one of which is lost in mid-run."""

from __future__ import annotations

import threading
import time

import pytest
from conftest import COARSE, ROOT
from test_batch import data

import gripfast

pytest.importorskip("ray", reason="SKIPPED: Ray is not installed")

PARTS = [str(ROOT / "data/parts")]


def batch() -> gripfast.Batch:
    return gripfast.Batch(
        PARTS, ["generic", "robotiq-2f85"], ["gravity", "ball:20:5N"], top=5, negatives=4,
        **{**COARSE, "spacing": "5mm"},
    )


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    assert batch().run(folder).failed == 0
    return data(folder)


def test_a_machine_that_is_lost_costs_nothing(here, tmp_path):
    import ray
    from ray.cluster_utils import Cluster

    import gripfast.ray

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    cluster.connect()
    try:
        lost = threading.Event()

        def lose_one(entry, ended, jobs):
            if ended == 3 and not lost.is_set():
                lost.set()
                cluster.remove_node(second, allow_graceful=False)

        report = gripfast.ray.run(batch(), tmp_path / "out", progress=lose_one)
        assert lost.is_set() and (report.grips, report.failed) == (24, 0)
        assert data(tmp_path / "out") == here

        # With parts sent along, and resumed after the driver gave up.
        class Enough(Exception):
            pass

        def give_up(entry, ended, jobs):
            if ended == 5:
                raise Enough

        with pytest.raises(Enough):
            gripfast.ray.run(batch(), tmp_path / "sent", ship=True, progress=give_up)
        time.sleep(0.5)
        done = []
        report = gripfast.ray.run(
            batch(), tmp_path / "sent", ship=True, resume=True,
            progress=lambda entry, ended, jobs: done.append(ended),
        )
        assert done[0] == 6 and len(done) == 19
        assert (report.grips, report.failed) == (24, 0) and data(tmp_path / "sent") == here

        # Every job cut into shares, given up in mid-run and resumed.
        with pytest.raises(Enough):
            gripfast.ray.run(batch(), tmp_path / "shares", split=3, progress=give_up)
        report = gripfast.ray.run(batch(), tmp_path / "shares", split=3, resume=True)
        assert (report.grips, report.failed) == (24, 0) and data(tmp_path / "shares") == here

        # A part that is not there fails its jobs and no others.
        some = gripfast.Batch(
            ["data/parts/hex_nut.stl"], ["generic"],
            description={"part": [{"part": "nowhere.stl"}]}, **COARSE,
        )
        for split in (1, 3):
            report = gripfast.ray.run(some, tmp_path / f"bad{split}", split=split)
            assert (report.grips, report.failed) == (1, 1)
        assert report.failed_jobs[0][1]["kind"] == "not_found"
    finally:
        ray.shutdown()
        cluster.shutdown()
