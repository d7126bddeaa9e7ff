"""The render child: the process that hosts a renderer, and may crash with it.

It shuts itself in before it imports numpy or the renderer and before it sees a scene. What it does
then is in `plateau.worker.child.request_loop`.
"""

import argparse
import os
from pathlib import Path

from plateau.farm.model.renderers import variant_named
from plateau.worker.child.shut_in import shut_in
from plateau.worker.confinement.confine import limit_resources


def main() -> None:
    """Shut this process in, and serve requests until the supervisor closes the socket."""
    parser = argparse.ArgumentParser(description="Plateau's render child; started by the worker.")
    parser.add_argument("socket", type=int)
    parser.add_argument("--films", type=int, required=True)
    parser.add_argument("--variant", required=True)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--memory-bytes", type=int, required=True)
    parser.add_argument("--open-files", type=int, required=True)
    parser.add_argument("--file-bytes", type=int, required=True)
    parser.add_argument("--scenes", type=Path, action="append", default=[])
    parser.add_argument("--kernels", type=Path, required=True)
    arguments = parser.parse_args()
    limit_resources(
        arguments.memory_bytes,
        arguments.open_files,
        arguments.file_bytes,
        on_gpu=variant_named(arguments.variant).on_gpu,
    )
    os.chdir(os.environ["HOME"])  # until there is a scene, whose folder it works in
    stays_open = shut_in(
        arguments.variant,
        "plateau.worker.child",
        scenes=arguments.scenes,
        kernels=arguments.kernels,
    )

    # Imported here: numpy starts threads.
    from plateau.worker.child.request_loop import serve

    serve(
        arguments.socket,
        arguments.films,
        variant=arguments.variant,
        threads=arguments.threads,
        stays_open=stays_open,
    )


if __name__ == "__main__":
    main()
