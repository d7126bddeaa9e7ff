"""Mitsuba alone: renders passes one after the other. `bench.support.alone` starts it.

It imports little else. It reads a JSON request from standard input and answers in JSON on standard
output:

- started_at: when this process began to import Mitsuba, in seconds of `time.time`;
- began_s, ended_s: when the first pass began and when each ended, in seconds after that;
- cpu_s: the CPU seconds of this process at the end of each pass.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

_STARTED = time.monotonic()
_STARTED_AT = time.time()


def main() -> None:
    request = json.load(sys.stdin)

    import drjit as dr
    import mitsuba as mi

    mi.set_variant(request["variant"])
    mi.set_log_level(mi.LogLevel.Error)
    dr.set_thread_count(request["threads"])

    # The scene as the farm prepares it, so that the samples are the same.
    from plateau.worker.renderers.contract import Load
    from plateau.worker.renderers.mitsuba.scene_prep import prepare
    from plateau.worker.supervisor.scene_cache import loading_threads

    scene = Load(
        folder=request["folder"],
        entry="scene.xml",
        parameters=request["parameters"],
        threads=loading_threads(Path(request["folder"])),
    )
    one = prepare(request["variant"], scene)
    total: Any = 0.0
    began_s = time.monotonic() - _STARTED
    ended_s, cpu_s = [], []
    for spp, seed in request["passes"]:
        one.integrator.render(
            one.scene, one.sensor, seed=seed, spp=spp, develop=False, evaluate=True
        )
        dr.sync_thread()
        ended_s.append(time.monotonic() - _STARTED)
        cpu_s.append(time.process_time())
        if request["image"]:
            total = total + np.array(one.film.bitmap(raw=True), dtype=np.float64)
    if request["image"]:
        np.save(request["image"], (total[..., :3] / total[..., 3:]).astype(np.float32))
    told = {"started_at": _STARTED_AT, "began_s": began_s, "ended_s": ended_s, "cpu_s": cpu_s}
    json.dump(told, sys.stdout)


if __name__ == "__main__":
    main()
