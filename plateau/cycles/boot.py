"""Runs a module of Plateau in a ``blender`` program: what the program is started with.

After ``--`` come Plateau's version of Python and the folders of its packages; after another ``--``
the module and its arguments.
"""

import os
import runpy
import site
import sys
import sysconfig
import traceback

import bpy


def _main(arguments: list[str]) -> int:
    """Run the module; return the process's exit status."""
    start = arguments.index("--") + 1
    middle = arguments.index("--", start)
    python, *folders = arguments[start:middle]
    module, *rest = arguments[middle + 1 :]
    own = sysconfig.get_python_version()
    if not hasattr(bpy.context.scene.cycles, "use_sample_subset"):
        release = bpy.app.version_string
        print(f"Blender {release} is too old: its Cycles cannot render a subset of its samples")
        return 1
    if own != python:
        print(
            f"Blender {bpy.app.version_string} has Python {own}, and Plateau was installed for "
            f"{python}: install Plateau for Python {own} on this machine"
        )
        return 1
    for folder in folders:
        site.addsitedir(folder)
    sys.argv = [module, *rest]
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else ended.code is not None
    except BaseException:  # noqa: BLE001  (as Python does at the end of a process)
        traceback.print_exc()
        return 1
    return 0


if __name__ == "__main__":
    status = _main(sys.argv)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # without Blender's last words, which would follow those of the module
