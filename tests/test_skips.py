"""Skipped tests are told at the end of a run, each reason once; a strict run allows only some."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

@pytest.mark.parametrize("k", range(3))
def test_on_a_page(k):
    pytest.skip("no browser: none is installed")

@pytest.mark.skipif(True, reason={reason!r})
def test_of_something_else():
    pass

def test_that_runs():
    pass
"""


@pytest.mark.parametrize(
    "reason, strict, passes",
    [
        ("not today", "", True),
        ("not today", "1", False),
        ("no CUDA device", "1", True),
    ],
)
def test_the_last_lines_tell_what_was_skipped(reason, strict, passes, tmp_path):
    shutil.copy(Path(__file__).parent / "conftest.py", tmp_path)
    (tmp_path / "test_some.py").write_text(TESTS.format(reason=reason))
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--rootdir", tmp_path, "-c", os.devnull, tmp_path],
        env={**os.environ, "STROKESTYLE_STRICT_SKIPS": strict},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert (done.returncode == 0) == passes, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert "1 passed, 4 skipped" in lines.pop()
    told = ["skipped 3: no browser: none is installed", f"skipped 1: {reason}"]
    if not passes:
        told.append(f"failed: STROKESTYLE_STRICT_SKIPS is set, and does not allow: {reason}")
    assert lines[-len(told) :] == told
