"""Processes whose parent is killed, and those whose parent is this one."""

import subprocess
import sys
from contextlib import suppress

import psutil


def orphan_of(program: str, *arguments: object) -> psutil.Process:
    """The process whose id this Python program prints, once the program was killed."""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = psutil.Process(int(parent.stdout.readline()))
        parent.kill()
    return child


def children_running(module: str) -> list[psutil.Process]:
    """The children of this process that run a module."""
    found = []
    for one in psutil.Process().children():
        with suppress(psutil.Error):  # it has just ended
            if module in one.cmdline():
                found.append(one)
    return found
