"""Packages of others from PyPI in a folder of their own: the environment of the tests stays as it is."""

import subprocess
import sys
from pathlib import Path

import pytest


def installed(folder: Path, *packages: str) -> Path:
    """Install packages, without those that they need, into a folder; the test is skipped where PyPI is not reached."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
    done = subprocess.run([*command, "--target", folder, *packages], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"PyPI cannot be reached: {done.stderr[-300:]}")
    return folder
