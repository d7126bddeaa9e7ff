"""Processes whose parent is killed."""

import subprocess
import sys

import psutil


def orphan_of(program: str, *arguments: object) -> psutil.Process:
    """The process whose id this Python program prints, once the program was killed."""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = psutil.Process(int(parent.stdout.readline()))
        parent.kill()
    return child
