"""A process that bundles a scene where it lies, for the API, within the kernel's limits.

`plateau.service.api.scene_checks.placing` starts it for one scene: it reads a question (JSON) from
its standard input, writes the bundle to an inherited file, and its answer (JSON) to its standard
output. It has no credentials.
"""

import json
import os
import resource
import sys
from pathlib import Path
from typing import Any, Final

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.farm.bundle.hashes import FileHashes
from plateau.farm.bundle.placing import find_placed, write_placed
from plateau.farm.model.scene_roots import SceneRoot
from plateau.farm.process.lifecycle import limit

#: CPU time for the XML of all sets of parameters; the files are then read for as long as it takes.
FINDING_S: Final = 60
MEMORY_BYTES: Final = 2**29


def main() -> None:
    """Answer the one question; the first argument is the descriptor of the bundle's file."""
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_DATA, MEMORY_BYTES)
    question = json.load(sys.stdin)
    roots = tuple(
        SceneRoot(one["name"], Path(one["path"]), tuple(one["elsewhere"]))
        for one in question["roots"]
    )
    answer: dict[str, Any] = {}
    try:
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (FINDING_S, hard))
        limits = BundleLimits(**question["limits"])
        found = find_placed(question["name"], roots, question["asked"], limits)
        resource.setrlimit(resource.RLIMIT_CPU, (hard, hard))
        with os.fdopen(int(sys.argv[1]), "wb") as target:
            write_placed(found, roots, FileHashes(Path(question["hashes"])), target)
    except BundleError as error:
        answer["error"] = error.to_tell()
    except OSError as error:
        answer["unreadable"] = str(error)
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
