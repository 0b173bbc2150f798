"""The code on the pages, run as it stands there, page by page."""

from __future__ import annotations

import doctest
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT

import gripfast
import gripfast._run

BLOCK = re.compile(r"^```python\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "data", tmp_path / "data")
    return tmp_path


@pytest.mark.parametrize("page", ["python.md", "ray.md"])
def test_the_code_of_a_page_runs(page, folder):
    if page == "ray.md":
        pytest.importorskip("distributed", reason="SKIPPED: Dask is not installed")
    blocks = BLOCK.findall((ROOT / "docs" / page).read_text())
    assert blocks
    # In a file, and only there: Dask's workers import it.
    body = "\n".join(blocks)
    indented = "".join(f"    {line}" if line.strip() else line for line in body.splitlines(True))
    (folder / "page.py").write_text(f'if __name__ == "__main__":\n{indented}')
    done = subprocess.run(
        [sys.executable, "page.py"], cwd=folder, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    if page == "python.md":
        assert (folder / "out/manifest.jsonl").exists() and "value" in done.stdout + done.stderr


def test_the_readme_s_five_lines_run(folder):
    text = (ROOT / "README.md").read_text()
    (lines,) = [block for block in BLOCK.findall(text) if "gripfast.plan" in block]
    assert len(lines.strip().splitlines()) == 5
    done = subprocess.run(
        [sys.executable, "-c", lines], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("[0.0") and (folder / "bracket.html").exists()


@pytest.mark.parametrize("module", [gripfast, gripfast._run])
def test_the_examples_of_the_documentation_run(module):
    found = doctest.testmod(module)
    assert found.attempted > 0 and found.failed == 0


def test_the_notebook_runs(folder):
    nbformat = pytest.importorskip("nbformat", reason="SKIPPED: nbformat is not installed")
    client = pytest.importorskip("nbclient", reason="SKIPPED: nbclient is not installed")
    pytest.importorskip("matplotlib", reason="SKIPPED: matplotlib is not installed")
    notebook = nbformat.read(ROOT / "docs/grips.ipynb", as_version=4)
    client.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    ).execute()
    kinds = {
        kind
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        for kind in output.get("data", {})
    }
    assert {"image/png", "text/html"} <= kinds


def test_the_types_hold():
    pytest.importorskip("mypy", reason="SKIPPED: mypy is not installed")
    package = Path(gripfast.__file__).parent
    assert (package / "py.typed").exists()
    for line in (
        [
            "-m", "mypy", "--strict", "--no-error-summary", "--disable-error-code=import-untyped",
            "-p", "gripfast",
        ],
        ["-m", "mypy.stubtest", "--ignore-disjoint-bases", "gripfast._gripfast"],
    ):
        done = subprocess.run(
            [sys.executable, *line], capture_output=True, text=True, check=False, cwd=ROOT / "python/tests"
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_import_is_quick_and_brings_nothing_heavy():
    code = (
        "import time; t = time.perf_counter(); import numpy; n = time.perf_counter(); import gripfast;"
        "import sys; print(time.perf_counter() - n);"
        "assert not {'pandas', 'pyarrow', 'ray', 'tqdm'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert float(done.stdout) < 2.0
