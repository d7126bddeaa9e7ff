"""From the command line to the results of a job that converges at once: `make bench-startup`.

`plateau render` starts Redis, API, monitor and worker, renders the two steps that the default rule
needs, writes its results and stops all processes. One Mitsuba process imports Mitsuba, loads the
scene and renders the same passes. They alternate, with kernels that Dr.Jit has compiled before.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Final

from bench import ROOT
from bench.support.alone import Alone
from bench.support.processes import Taken, timed
from bench.support.report import Table, machine_table, spread, write_report
from plateau.farm.model.seeds import SeedSchedule
from plateau.farm.model.spec import JobSpec
from plateau.farm.process.settings import Settings
from plateau.worker.supervisor.variants import VariantChoice, choose

#: A scene without noise, whose job converges at once.
_SCENE: Final = ROOT / "bench" / "support" / "still"
_COLUMNS = ("plateau render", "Mitsuba alone", "beyond Mitsuba")


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is started, and how often."""

    pairs: int = 5  #: after one that is not counted
    size: int = 256  #: of the image, in pixels
    variant: str | None = None  #: by default the one that a worker takes by itself


@dataclass(frozen=True)
class Found:
    """The times of `plateau render` and of Mitsuba alone in pairs."""

    spp: int
    pairs: list[tuple[Taken, Taken]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=Plan.pairs, help="runs of each")
    parser.add_argument("--size", type=int, default=Plan.size, help="of the image, in pixels")
    options = parser.parse_args()
    plan = Plan(pairs=options.pairs, size=options.size)
    write_report(
        "startup",
        tables(plan, measure(plan)),
        settings={"pairs": plan.pairs},
        notes=[
            "A first run of each is not counted: it compiles modules and reads files.",
            "The variant of this machine and the metric's kernels are cached in all runs.",
            "If other work had a share of the cores, times are too long.",
        ],
        document="performance.md",
    )


def measure(plan: Plan) -> Found:
    """Time the starts; raise if a job did not converge."""
    choice = choose(Settings().cache)
    pairs = []
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "cache"
        cache.mkdir()
        if plan.variant is None:
            shutil.copy(Settings().cache / "variant.json", cache)
        spp = _render(plan, choice, cache)[0]
        _bare(plan, choice, cache, spp)
        for number in range(plan.pairs):
            took = {}
            # The first to run alternates, so that a machine that slows down slows both.
            for name in ("ours", "bare")[:: 1 if number % 2 else -1]:
                if name == "ours":
                    took[name] = _render(plan, choice, cache)[1]
                else:
                    took[name] = _bare(plan, choice, cache, spp)
            pairs.append((took["ours"], took["bare"]))
            print(f"pair {number + 1} of {plan.pairs} done", file=sys.stderr)
    return Found(spp, pairs)


def _environment(cache: Path) -> dict[str, str]:
    environment = {**os.environ, "PLATEAU_CACHE": str(cache)}
    # As for most users: modules are compiled at their first import only.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return environment


def _plateau(cache: Path, *arguments: str) -> Taken:
    command = [sys.executable, "-m", "plateau", *arguments]
    with timed() as taken:
        subprocess.run(command, cwd=ROOT, env=_environment(cache), capture_output=True, check=True)
    return taken


def _render(plan: Plan, choice: VariantChoice, cache: Path) -> tuple[int, Taken]:
    """Return the spp at which `plateau render` converged, and its times."""
    size = (f"-Dwidth={plan.size}", f"-Dheight={plan.size}")
    variant = ("--variant", plan.variant) if plan.variant else ()
    with tempfile.TemporaryDirectory() as out:
        taken = _plateau(cache, "render", str(_SCENE), "--out", out, *size, *variant)
        job = json.loads((Path(out) / "summary.json").read_text())
    expected = ("converged", plan.variant or choice.variant)
    if (job["state"], job["variant"]) != expected:
        raise AssertionError(f"the job is {job['state']} with {job['variant']}, not {expected}")
    return int(job["spp"]), taken


def _bare(plan: Plan, choice: VariantChoice, cache: Path, spp: int) -> Taken:
    variant = plan.variant or choice.variant
    schedule = SeedSchedule(
        variant=variant,
        width=plan.size,
        height=plan.size,
        slice_spp=JobSpec().slice_spp,
        max_spp=spp,
    )
    with timed() as taken:
        Alone(
            scene=_SCENE,
            parameters={"width": str(plan.size), "height": str(plan.size)},
            passes=chain.from_iterable(map(schedule.passes, range(schedule.slices))),
            variant=variant,
            llvm_library=choice.llvm_library,
            threads=len(os.sched_getaffinity(0)),
            cache=cache,
            environment=_environment(cache),
        ).render()
    return taken


def tables(plan: Plan, found: Found) -> dict[str, Table]:
    """Return the tables: a start, and the machine."""
    ours, bare = ([one.wall_s for one in runs] for runs in zip(*found.pairs, strict=True))
    beyond = [one - other for one, other in zip(ours, bare, strict=True)]
    row = ["a start", *(spread(values, 2) for values in (ours, bare, beyond))]
    settings = {
        "size": f"{plan.size}×{plan.size}",
        "spp": found.spp,
        "pairs": plan.pairs,
        "variant": plan.variant or choose(Settings().cache).variant,
    }
    others = [one.others for pair in found.pairs for one in pair]
    return {
        "startup": [["wall time, s", *_COLUMNS], row],
        "startup-machine": machine_table(settings, others),
    }


if __name__ == "__main__":
    main()
