"""Which Mitsuba variants this machine can test: scalar always, LLVM where a library works."""

import os
from functools import cache

import pytest

from plateau.worker.supervisor.llvm_libraries import llvm_libraries
from plateau.worker.supervisor.variants import LLVM, SCALAR, Probe, probe

#: For parametrised tests and fixtures: every variant that tests cover.
VARIANTS = (SCALAR, pytest.param(LLVM, marks=pytest.mark.llvm))


def library_for(variant: str) -> str | None:
    """The LLVM library for a variant; without one the test skips, or fails in CI."""
    if variant != LLVM:
        return None
    library = _usable_llvm()
    if library is None and os.environ.get("CI") == "true":
        pytest.fail("CI must test the LLVM variant, and no usable libLLVM was found")
    if library is None:
        pytest.skip("no usable libLLVM on this machine (Debian: libllvm19)")
    return library


@cache
def known_probe(variant: str, library: str | None) -> Probe:
    """What a variant's first trial in this process has found."""
    return probe(variant, library)


@cache
def _usable_llvm() -> str | None:
    return next((str(path) for path in llvm_libraries() if known_probe(LLVM, str(path)).ok), None)
