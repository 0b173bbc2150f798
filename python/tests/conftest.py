"""What the tests share: the checkout, and the program that answers must agree with."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("GRIPFAST_PROGRAM", str(ROOT / "target/debug/gripfast"))

#: What makes a run quick.
COARSE = {
    "density": "2700kg/m3",
    "spacing": "8mm",
    "angle_step": "45deg",
    "backend": "cpu",
}


@pytest.fixture(autouse=True)
def in_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


@pytest.fixture
def program():
    """Runs the program and gives the result file that it writes."""
    if not Path(PROGRAM).exists():
        pytest.fail(f"{PROGRAM} is not there: build it, or name it in GRIPFAST_PROGRAM")

    def run(*arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [PROGRAM, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stderr
        return done

    return run


def flags(options: dict[str, object]) -> list[str]:
    """Options as flags of the program."""
    return [
        word
        for name, value in options.items()
        for word in (f"--{name.replace('_', '-')}", str(value))
    ]


def without_provenance(path: Path | str) -> dict[str, object]:
    """A result but for what says where and how it was made."""
    found = json.loads(Path(path).read_text())
    del found["provenance"]
    return found
