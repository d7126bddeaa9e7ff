"""The command line of the benchmarks that use the experiment's renders."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from bench import ROOT
from bench.experiment.cases import Case, cases
from bench.experiment.renders import Size
from plateau import scenes


@dataclass(frozen=True, kw_only=True)
class Options:
    """The parsed command line."""

    cases: list[Case]
    size: Size
    data: Path  #: folder of renders
    workers: int


def parse(description: str | None, *, step: int) -> Options:
    """Parse the command line; the cap has to be a multiple of `step` spp."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", type=int, default=256, help="pixels across and down (256)")
    parser.add_argument(
        "--cap", type=int, default=10_000, help="spp of each series that is rendered (10,000)"
    )
    parser.add_argument("--scenes", nargs="+", choices=scenes.NAMES, default=scenes.NAMES)
    parser.add_argument("--workers", type=int, default=1, help="worker processes (1)")
    parser.add_argument(
        "--data", type=Path, default=ROOT / "paper-data", help="folder of renders (./paper-data)"
    )
    found = parser.parse_args()
    if found.cap % step or found.cap < step:
        parser.error(f"--cap must be a multiple of {step}, not {found.cap}")
    return Options(
        cases=cases(tuple(found.scenes)),
        size=Size(found.size, found.cap),
        data=found.data,
        workers=found.workers,
    )
