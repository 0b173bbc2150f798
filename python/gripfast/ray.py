"""Batches on many machines: the jobs of a batch as tasks of Ray.

>>> import gripfast, gripfast.ray                                          # doctest: +SKIP
>>> batch = gripfast.Batch(["parts/"], ["robotiq-2f85"], density="2700kg/m3")  # doctest: +SKIP
>>> gripfast.ray.run(batch, "out/")                                        # doctest: +SKIP

The machine that calls :func:`run` keeps the folder: it hands out jobs and records what comes back,
so a machine that is lost costs the jobs in flight there, and Ray does them again elsewhere. The files
are those that ``Batch.run`` writes, byte for byte.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Sequence
from typing import Any

import ray

from . import _gripfast
from ._batch import Batch, Job, Report, Store
from ._inputs import Path
from ._run import _Listener

#: Tasks handed out beyond those that run, for each processor of the cluster: enough that no machine
#: waits, few enough that the memory stays small.
_AHEAD = 2

#: A part file with everything beside it that a job needs, as it travels.
_Shipped = tuple[str, bytes]


def run(
    batch: Batch | Sequence[Job],
    folder: Path,
    *,
    resume: bool = False,
    split: int = 1,
    num_cpus: float = 1,
    num_gpus: float = 0,
    max_retries: int = 3,
    ship: bool = False,
    progress: bool | Callable[[dict[str, Any], int, int], None] | None = None,
) -> Report:
    """Does all jobs of a batch on the cluster that Ray is connected to (``ray.init``).

    Each job is a task of ``num_cpus`` processors, on as many threads, and ``num_gpus``. With
    ``split`` each job is that many tasks, one for each share of its candidates, and one that puts
    them together: a single large part keeps many machines busy, and the files are the same, byte for
    byte. Ray does a task again, up to ``max_retries`` times, when its machine or process is lost;
    after that the job has failed, and ``resume=True`` tries it again. Parts are read by their paths
    on the machine that does the job; with ``ship=True`` this machine reads the files and sends them
    (not for parts of several files, such as glTF with buffers beside it). ``progress`` as in
    :meth:`Batch.run`.
    """
    if split < 1:
        raise ValueError("split is below 1")
    if not ray.is_initialized():
        ray.init()
    jobs = list(batch)
    store = Store(jobs, folder, resume=resume)
    task = ray.remote(
        num_cpus=num_cpus, num_gpus=num_gpus, max_retries=max_retries, retry_exceptions=False
    )(_task)
    threads = max(1, int(num_cpus))
    ordered = sorted(store.pending(), key=lambda number: (jobs[number].request["part"], number))
    #: Job, and share; None: the whole job.
    parts: list[int | None] = list(range(split)) if split > 1 else [None]
    waiting = [(number, share) for number in reversed(ordered) for share in reversed(parts)]
    running: dict[Any, tuple[int, int | None]] = {}
    shares: dict[int, dict[int, bytes]] = {}
    parcels: dict[str, Any] = {}

    def start(number: int, share: int | None, *work: Any) -> None:
        part = jobs[number].request["part"]
        if ship and part not in parcels:
            # Jobs of one part follow each other: its parcel is dropped after the last.
            parcels.clear()
            parcels[part] = _parcel(part)
        text = jobs[number].text
        running[task.remote(text, threads, parcels.get(part), *work)] = (number, share)

    def take(number: int, share: int, state: bytes) -> None:
        found = shares.setdefault(number, {})
        found[share] = state
        if len(found) == split:
            del shares[number]
            start(number, None, "gather", [found[one] for one in range(split)])

    with _Listener(progress, None, "job") as hear:

        def record(number: int, entry: str, content: bytes) -> None:
            shares.pop(number, None)
            store.record(entry, content)
            hear("job", entry, *store.counts())

        ended: set[int] = set()
        while waiting or running:
            cluster: Any = ray
            slots = cluster.cluster_resources().get("CPU", 1.0) / max(num_cpus, 0.01)
            while waiting and len(running) < (1 + _AHEAD) * max(slots, 1.0):
                number, share = waiting.pop()
                if number in ended:
                    continue
                if share is None:
                    start(number, None, "run")
                elif (state := store.share(number, share, split)) is not None:
                    take(number, share, state)
                else:
                    start(number, share, "share", (share, split))
            if not running:
                continue  # shares of jobs that have failed
            done, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
            for reference in done:
                number, share = running.pop(reference)
                if number in ended:
                    continue
                try:
                    entry, content = ray.get(reference)
                except (ray.exceptions.RayError, OSError) as error:
                    entry, content = _gripfast.lost_job(jobs[number].text, _first_line(error)), b""
                if entry is None:
                    assert share is not None
                    store.record_share(number, share, split, content)
                    take(number, share, content)
                else:
                    ended.add(number)
                    record(number, entry, content)
    return store.finish()


def _parcel(part: str) -> Any:
    try:
        with open(part, "rb") as file:
            return ray.put((os.path.basename(part), file.read()))
    except OSError:
        # The job says what is wrong with it.
        return None


def _task(
    text: str, threads: int, parcel: _Shipped | None, what: str, work: Any = None
) -> tuple[str | None, bytes]:
    """A job on a machine of the cluster, a share of it, or the end of its shares."""

    def do(text: str, part: _gripfast.Part | None) -> tuple[str | None, bytes]:
        if what == "share":
            return _gripfast.run_share(text, work, part, threads)
        if what == "gather":
            return _gripfast.gather_job(text, work, part, threads)
        return _gripfast.run_job(text, part, threads)

    if parcel is None:
        return do(text, None)
    name, content = parcel
    request = json.loads(text)["request"]
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, name)
        with open(path, "wb") as file:
            file.write(content)
        try:
            native = _gripfast.Part.read(
                path,
                request.get("unit"),
                request.get("max_memory"),
                False,
                request.get("faceted", False),
                request.get("fit"),
                request["part"],
            )
        except Exception:  # noqa: BLE001
            # A bad part is an outcome of the job, which reads it again to say so.
            fields = json.loads(text)
            fields["request"]["part"] = path
            return do(json.dumps(fields), None)
        return do(text, native)


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0] if lines else 'no message'}"


__all__ = ["run"]
