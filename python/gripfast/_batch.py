"""Many parts, grippers and load sets: jobs, and the folder that keeps what comes of them."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from . import _gripfast
from ._inputs import Part, Path, Request, _object, _plain
from ._run import _Listener


@dataclass(frozen=True)
class Job:
    """One part with one gripper under one load set. It can be sent to another machine."""

    text: str

    @property
    def fields(self) -> dict[str, Any]:
        """``number``, ``part``, ``gripper``, ``loads`` and ``request``."""
        return _object(self.text)

    @property
    def number(self) -> int:
        """Its number, from 0."""
        return int(self.fields["number"])

    @property
    def part(self) -> str:
        """Name of the part."""
        return str(self.fields["part"])

    @property
    def gripper(self) -> str:
        """Name of the gripper."""
        return str(self.fields["gripper"])

    @property
    def loads(self) -> str:
        """Name of the load set."""
        return str(self.fields["loads"])

    @property
    def request(self) -> Request:
        """What to plan."""
        return Request.from_dict(self.fields["request"])


@dataclass(frozen=True)
class Report:
    """What came of a batch: numbers of jobs, and some of those without a grip or that failed."""

    jobs: int
    grips: int
    empty: int
    failed: int
    open: int
    empty_jobs: list[tuple[str, str]] = field(default_factory=list)
    failed_jobs: list[tuple[str, dict[str, str]]] = field(default_factory=list)

    @classmethod
    def _of(cls, text: str) -> Report:
        return cls(**_object(text))


class Batch:
    """Parts x grippers x load sets.

    ``Batch(["parts/"], ["robotiq-2f85", "franka-hand"], density="2700kg/m3", top=50)``: parts are
    files and folders; ``loads`` is a list of load sets, each as in a request; ``top`` is the number of
    grips kept of each job (100); options are fields of a request. ``Batch.read("jobs.toml")`` reads the file of ``gripfast batch``.
    """

    def __init__(
        self,
        parts: Sequence[Path] = (),
        grippers: Sequence[str] = (),
        loads: Sequence[str] = (),
        *,
        request: Request | None = None,
        description: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        told: dict[str, Any] = json.loads(json.dumps(description or {}))
        shared = Request.from_dict(told.get("request", {})) if request is None else request
        shared = Request._of(shared._json)
        if (top := options.pop("top", None)) is not None:
            told["top"] = top
        shared.update(**options)
        told["request"] = shared.to_dict()
        if isinstance(parts, (str, os.PathLike)) or isinstance(grippers, str):
            raise TypeError("parts and grippers are lists")
        told["parts"] = [*told.get("parts", []), *(os.fspath(part) for part in parts)]
        told["grippers"] = [*told.get("grippers", []), *grippers]
        sets = [{"name": text, "loads": text.split(",")} for text in loads]
        told["loads"] = [*told.get("loads", []), *sets]
        texts = _gripfast.batch_jobs(json.dumps(told, default=_plain))
        self.jobs: list[Job] = [Job(text) for text in texts]

    @classmethod
    def read(cls, path: Path, **options: Any) -> Batch:
        """The batch that a file describes, with options over it."""
        with open(path, "rb") as file:
            return cls(description=tomllib.load(file), **options)

    def __len__(self) -> int:
        return len(self.jobs)

    def __iter__(self) -> Iterator[Job]:
        return iter(self.jobs)

    def run(
        self,
        folder: Path,
        *,
        resume: bool = False,
        jobs: int | None = None,
        threads: int | None = None,
        split: int = 1,
        progress: bool | Callable[[dict[str, Any], int, int], None] | None = None,
    ) -> Report:
        """Does all jobs on this machine, as ``gripfast batch`` does, ``jobs`` of them at a time.
        ``split`` cuts the candidates of each job into shares, which go to the workers one by one: a
        single large part then keeps all of them busy. It changes nothing in the files. ``progress`` is called with (entry of the manifest, jobs that have ended, jobs in all)."""
        texts = [job.text for job in self.jobs]
        with _Listener(progress, None, "job") as listener:
            return Report._of(
                _gripfast.batch_run(
                    texts, os.fspath(folder), resume, (jobs, threads, split), listener
                )
            )


def run_job(job: Job, part: Part | None = None, threads: int | None = None) -> tuple[str, bytes]:
    """Does one job, on a part in memory where it is given: its line of the manifest as JSON, and its
    result, which :meth:`Store.record` keeps. A job that fails is an outcome, not an exception."""
    return _gripfast.run_job(job.text, None if part is None else part._native, threads)


def run_share(
    job: Job, number: int, of: int, part: Part | None = None, threads: int | None = None
) -> tuple[str | None, bytes]:
    """Does one of the ``of`` shares of a job's candidates, ``number`` from 0: ``None`` and what
    :func:`gather_job` wants, or, where the job failed, what :meth:`Store.record` wants."""
    native = None if part is None else part._native
    return _gripfast.run_share(job.text, (number, of), native, threads)


def gather_job(
    job: Job, shares: Sequence[bytes], part: Part | None = None, threads: int | None = None
) -> tuple[str, bytes]:
    """Puts together what all shares of a job have found, in the order of their numbers, wherever they
    were done: what :func:`run_job` gives, with the same numbers."""
    native = None if part is None else part._native
    return _gripfast.gather_job(job.text, list(shares), native, threads)


class Store:
    """The folder of a batch, open: what is finished is neither lost nor done twice."""

    def __init__(self, jobs: Batch | Sequence[Job], folder: Path, *, resume: bool = False) -> None:
        self._native = _gripfast.Store([job.text for job in jobs], os.fspath(folder), resume)

    def pending(self) -> list[int]:
        """Numbers of the jobs that are to be done."""
        return self._native.pending()

    def counts(self) -> tuple[int, int]:
        """Jobs that have ended, and jobs in all."""
        return self._native.counts()

    def record(self, entry: str, content: bytes) -> None:
        """Keeps what :func:`run_job` gave."""
        self._native.record(entry, content)

    def share(self, job: int, number: int, of: int) -> bytes | None:
        """What an earlier run has left of a share of an open job, by the job's number."""
        return self._native.share(job, (number, of))

    def record_share(self, job: int, number: int, of: int, state: bytes) -> None:
        """Keeps what :func:`run_share` gave until the whole job is recorded."""
        self._native.record_share(job, (number, of), state)

    def finish(self) -> Report:
        """Writes what is left to be written, and closes the folder."""
        return Report._of(self._native.finish())
