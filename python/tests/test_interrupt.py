"""Ctrl-C stops a run of Python as it stops the program."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

from conftest import ROOT

LONG = """
import gripfast
print("begin", flush=True)
try:
    gripfast.plan("data/parts/l_bracket.stl", "robotiq-2f85", "ball:500", mass="350g",
                  spacing="0.5mm", angle_step="3deg", threads=1)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


def test_an_interrupt_stops_a_long_run():
    child = subprocess.Popen(
        [sys.executable, "-c", LONG], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None and child.stdout.readline() == "begin\n"
    time.sleep(1.0)
    begun = time.monotonic()
    child.send_signal(signal.SIGINT)
    out, _ = child.communicate(timeout=300)
    assert out == "stopped\n" and child.returncode == 0
    # After the chunk in flight; the whole run would take many minutes.
    assert time.monotonic() - begun < 240
