"""The stubs say what is there."""

import subprocess
import sys


def test_stubs_match():
    call = [sys.executable, "-m", "mypy.stubtest", "--ignore-disjoint-bases", "isoclay._isoclay"]
    done = subprocess.run(call, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_hold():
    done = subprocess.run([sys.executable, "-m", "mypy", "--strict", "-p", "isoclay"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
