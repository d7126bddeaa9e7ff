"""Runs a notebook's cells in a kernel of its own and prints the notebook with its outputs.

python -m tests.support.processes.notebook NOTEBOOK [stop]

With ``stop``, the kernel is interrupted, as by the button, when a cell first shows an image; and
each cell is run twice.
"""

import os
import signal
import sys
import threading
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient


def main() -> None:
    """Run the notebook that the command line names."""
    path, *options = sys.argv[1:]
    notebook = nbformat.read(path, 4)
    client = NotebookClient(
        notebook, timeout=200, resources={"metadata": {"path": str(Path(path).parent)}}
    )
    with client.setup_kernel():
        for index, cell in enumerate(notebook.cells):
            for _ in range(2 if options else 1):
                if options:
                    threading.Thread(target=_stop, args=(client, cell), daemon=True).start()
                client.execute_cell(cell, index)
    print(nbformat.writes(notebook))


def _stop(client: NotebookClient, cell: nbformat.NotebookNode) -> None:
    cell["outputs"] = []  # the old ones, which the run removes too
    while "<img" not in str(cell.get("outputs", "")):
        time.sleep(0.05)
    os.kill(client.km.provisioner.pid, signal.SIGINT)


if __name__ == "__main__":
    main()
