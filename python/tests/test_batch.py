"""Batches from Python: the same files as the program's."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest
from conftest import COARSE, flags

import gripfast

PARTS = ["data/parts/hex_nut.stl", "data/parts/shaft_key.stl", "data/parts/t_slot_bar.stl"]
GRIPPERS = ["generic", "franka-hand"]


def data(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in ("manifest.jsonl", "shards.jsonl")
    }


def batch(**options: object) -> gripfast.Batch:
    return gripfast.Batch(PARTS, GRIPPERS, top=5, negatives=6, **{**COARSE, **options})


@pytest.fixture(scope="module")
def theirs(tmp_path_factory) -> dict[str, bytes]:
    import subprocess

    from conftest import PROGRAM, ROOT

    folder = tmp_path_factory.mktemp("theirs") / "out"
    line = [PROGRAM, "batch", *PARTS, "--gripper", GRIPPERS[0], "--gripper", GRIPPERS[1]]
    line += ["--top-k", "5", "--negatives", "6", "-q", "-o", str(folder), *flags(COARSE)]
    subprocess.run(line, cwd=ROOT, check=True, capture_output=True)
    return data(folder)


def test_a_batch_writes_the_files_of_the_program(theirs, tmp_path):
    heard = []
    report = batch().run(tmp_path, progress=lambda *news: heard.append(news))
    assert (report.jobs, report.grips, report.failed, report.open) == (6, 6, 0, 0)
    assert data(tmp_path) == theirs
    assert len(heard) == 6 and heard[-1][1:] == (6, 6) and heard[0][0]["outcome"] == "grips"


def test_jobs_done_one_by_one_come_to_the_same_files(theirs, tmp_path):
    jobs = batch()
    store = gripfast.Store(jobs, tmp_path)
    assert store.pending() == list(range(6)) and [job.number for job in jobs] == store.pending()
    for number in (4, 0, 5):
        # As on another machine.
        job = pickle.loads(pickle.dumps(jobs.jobs[number]))
        store.record(*gripfast.run_job(job, threads=1))
    assert store.counts() == (3, 6)
    with pytest.raises(gripfast.OptionError, match="job 4"):
        store.record(*gripfast.run_job(jobs.jobs[4]))
    del store
    with pytest.raises(gripfast.OptionError, match="batch"):
        gripfast.Store(jobs, tmp_path)
    store = gripfast.Store(jobs, tmp_path, resume=True)
    assert store.pending() == [1, 2, 3]
    part = gripfast.Part(PARTS[1])
    for number in store.pending():
        given = part if jobs.jobs[number].part == "shaft_key.stl" else None
        store.record(*gripfast.run_job(jobs.jobs[number], given))
    report = store.finish()
    assert (report.grips, report.open) == (6, 0) and data(tmp_path) == theirs


def test_a_batch_in_shares_writes_the_same_files(theirs, tmp_path):
    report = batch().run(tmp_path / "here", split=3)
    assert (report.grips, report.failed) == (6, 0) and data(tmp_path / "here") == theirs
    # Share by share, some of them on another machine, and begun again.
    jobs = batch()
    store = gripfast.Store(jobs, tmp_path / "there")
    failed, state = gripfast.run_share(jobs.jobs[2], 1, 4, threads=1)
    assert failed is None
    store.record_share(2, 1, 4, state)
    del store
    store = gripfast.Store(jobs, tmp_path / "there", resume=True)
    assert store.share(2, 1, 4) == state and store.share(2, 0, 4) is None
    for number in store.pending():
        job = jobs.jobs[number]
        found = [store.share(number, share, 4) or gripfast.run_share(job, share, 4)[1]
                 for share in range(4)]
        store.record(*gripfast.gather_job(job, found))
    assert store.finish().grips == 6 and data(tmp_path / "there") == theirs


def test_a_bad_part_in_shares_fails_once(tmp_path):
    bad = tmp_path / "bad.stl"
    bad.write_text("nothing")
    jobs = gripfast.Batch([bad, PARTS[1]], ["generic"], **COARSE)
    report = jobs.run(tmp_path / "out", split=5)
    assert (report.grips, report.failed, report.open) == (1, 1, 0)
    entry, state = gripfast.run_share(jobs.jobs[0], 0, 2)
    assert json.loads(entry)["outcome"] == "failed" and state == b""


def test_a_bad_part_is_an_outcome(tmp_path):
    bad = tmp_path / "bad.stl"
    bad.write_text("nothing")
    jobs = gripfast.Batch([bad, PARTS[1]], ["generic"], **COARSE)
    report = jobs.run(tmp_path / "out", jobs=1)
    assert (report.grips, report.failed) == (1, 1)
    (name, error), = report.failed_jobs
    assert name.startswith("bad.stl") and error["kind"] in ("format", "geometry")
    lines = (tmp_path / "out/manifest.jsonl").read_text().splitlines()
    assert {json.loads(line)["outcome"] for line in lines} == {"grips", "failed"}


def test_a_file_of_jobs_is_read(tmp_path):
    file = tmp_path / "jobs.toml"
    file.write_text(
        'grippers = ["generic"]\n[request]\ndensity = "1kg/m3"\n'
        '[[part]]\npart = "data/parts/hex_nut.stl"\nname = "nut"\nmass = "9g"\n'
        '[[loads]]\nname = "down"\nloads = ["gravity:-z"]\n[[loads]]\nloads = ["gravity"]\naccel = "1g"\n'
    )
    jobs = gripfast.Batch.read(file, spacing="9mm")
    assert [(job.part, job.gripper, job.loads) for job in jobs] == [
        ("nut", "generic", "down"), ("nut", "generic", "gravity accel 1g"),
    ]
    request = jobs.jobs[1].request
    assert request["mass"] == "9g" and request["accel"] == "1g" and request["spacing"] == "9mm"
    assert "density" not in request.to_dict()
    with pytest.raises(gripfast.FormatError, match="colour"):
        gripfast.Batch(PARTS, GRIPPERS, description={"colour": 3})
    with pytest.raises(TypeError):
        gripfast.Batch(PARTS[0], GRIPPERS)


def test_the_data_set_opens_in_pandas(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    batch().run(tmp_path)
    frame = pandas.read_parquet(tmp_path / "grips.parquet")
    assert set(frame["gripper"]) == set(GRIPPERS)
    assert frame.groupby(["gripper", "part"], observed=True).size().max() == 5
    negatives = pandas.read_parquet(tmp_path / "negatives.parquet")
    assert negatives["reason"].str.len().min() > 3
    manifest = pandas.read_json(tmp_path / "manifest.jsonl", lines=True)
    assert list(manifest["outcome"].unique()) == ["grips"]
