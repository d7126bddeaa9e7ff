"""Finds the fastest Mitsuba variant that works on this machine. Never imports Mitsuba.

Dr.Jit loads its backends from the system: CUDA from the driver, LLVM from an installed library.
Some libraries are refused, and some abort the process during a render (LLVM 15 and 16 do on recent
CPUs). So each candidate renders a small image in a process of its own, in the order CUDA, then each
LLVM from the newest down, then ``scalar_rgb``, which needs no library. The variants of other
renderers are tried as well, where their package is here, and the driver that they need.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from itertools import filterfalse, takewhile
from pathlib import Path
from typing import Any

from plateau.farm.model import renderers
from plateau.farm.model.renderers import MITSUBA, VariantFacts, renderer_of, variant_named
from plateau.farm.process.lifecycle import die_with_parent, how_ended
from plateau.farm.process.scratch import scratch
from plateau.worker.renderers.program import program_of
from plateau.worker.supervisor import gpus, identity, needed_libraries
from plateau.worker.supervisor.llvm_libraries import llvm_libraries, system_libraries

CUDA, LLVM, SCALAR = "cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb"

#: A probe takes about two seconds, but far longer on a loaded machine or while a driver starts.
_PROBE_TIMEOUT_S = 120.0

#: The last line of a probe that went well.
_RENDERED = re.compile(r"OK ([0-9a-f]+)\s*\Z")

_TIMED_OUT = "gave no image within"
_ENDED_BY = "was ended by"  #: as `how_ended` says it
_WRONG = "CanaryWrong"

#: Lines that say why. Others follow them: Dr.Jit hides a missing library behind a NameError.
_CAUSES = ("LLVM ERROR", "cannot open shared object file")

#: The signals by which an unsuitable LLVM ends its process. Any other one came from outside, when
#: the worker was stopped or the kernel ran short of memory.
_BROKEN = (signal.SIGABRT, signal.SIGSEGV, signal.SIGILL, signal.SIGBUS, signal.SIGFPE)


@dataclass(frozen=True)
class Probe:
    """The outcome of one variant with one library."""

    variant: str
    library: str | None  #: the real path of an LLVM library
    ok: bool  #: whether it rendered an image
    detail: str  #: how it failed and its message, or why it works
    bits: str | None = None  #: a digest of the image, if it rendered one


@dataclass(frozen=True)
class VariantChoice:
    """The variant that a worker takes, and why."""

    variant: str
    llvm_library: str | None  #: the ``DRJIT_LIBLLVM_PATH`` of the LLVM variant
    why: str  #: a sentence for the log
    tried: tuple[Probe, ...]  #: in the order of trial

    @property
    def renders(self) -> bool:
        """Whether any variant worked here."""
        return any(probe.ok for probe in self.tried)

    @property
    def variants(self) -> tuple[str, ...]:
        """All variants known to work here, the best first."""
        working = [probe.variant for probe in self.tried if probe.ok]
        everywhere = [
            name
            for name, known in renderers.variants().items()
            if known.works_everywhere and is_installed(name)
        ]
        backends = {variant_named(one).backend for one in working}
        alike = (name for name, known in renderers.variants().items() if known.backend in backends)
        return tuple(dict.fromkeys((*working, *everywhere, *alike)))

    def like(self, variant: str) -> tuple[str, ...]:
        """Return those of them that have the renderer of a variant."""
        renderer = variant_named(variant).renderer
        return tuple(one for one in self.variants if variant_named(one).renderer == renderer)


def is_installed(variant: str) -> bool:
    """Return whether the package that has a variant's renderer is there; it is not imported."""
    package = renderer_of(variant).package
    return not package or find_spec(package) is not None


def is_here(variant: str) -> bool:
    """Return whether a variant's package is there, or a program that may bring it."""
    return is_installed(variant) or program_of(variant) is not None


def choose(cache: Path, *, every: bool = False) -> VariantChoice:
    """Return the first variant that works here, in the order of the module's docstring.

    Parameters
    ----------
    cache : Path
        Folder for the result, which is reused until anything changes on which it depends.
    every : bool
        Try all candidates again, as ``plateau doctor`` does.
    """
    candidates = _candidates()
    missing = needed_libraries.missing()
    if missing:
        # Every candidate would fail, with an error of Python's that names no library.
        untried = tuple(Probe(*one, ok=False, detail="was not tried") for one in candidates)
        why = f"nothing renders here: {needed_libraries.told(missing)}"
        return VariantChoice(SCALAR, None, why, untried)
    memory = identity.Memory(cache / "variant.json", _identity(candidates))
    tried = None if every else _known(memory)
    if tried is None:
        tried = _try(candidates, every)
        if all(map(_is_lasting, tried)):
            memory.write([asdict(one) for one in tried])
    return _choice(tuple(filter(_is_of_mitsuba, tried)), tuple(filterfalse(_is_of_mitsuba, tried)))


def probe(variant: str, library: str | None, timeout_s: float = _PROBE_TIMEOUT_S) -> Probe:
    """Return whether `variant` renders an image here, tried in a child process.

    Without a `library` Dr.Jit chooses the LLVM. The child is killed after `timeout_s` seconds.
    """
    environment = dict(os.environ)
    if variant_named(variant).on_gpu:
        environment |= gpus.environment()
    if library is not None:
        environment["DRJIT_LIBLLVM_PATH"] = library
    # A cached kernel of another LLVM would hide that this one cannot compile it.
    with scratch() as empty:
        environment["DRJIT_CACHE_DIR"] = environment["TMPDIR"] = str(empty)
        try:
            done = subprocess.run(
                [sys.executable, "-s", "-m", "plateau.worker.child.probe", variant],
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=timeout_s,
                check=False,
                preexec_fn=_before_the_probe(),
            )
        except subprocess.TimeoutExpired:
            return Probe(variant, library, ok=False, detail=f"{_TIMED_OUT} {timeout_s:g} s")
    said = _RENDERED.search(done.stdout)
    if done.returncode != 0 or said is None:
        shortage = gpus.shortage() if variant_named(variant).on_gpu else None
        detail = "; ".join(filter(None, (_last_words(done), shortage)))
        return Probe(variant, library, ok=False, detail=detail)
    detail = f"rendered a known image, bits {said[1]}"
    return Probe(variant, library, ok=True, detail=detail, bits=said[1])


def _before_the_probe() -> Callable[[], None]:
    """Return what a probe runs before its program: it dies with its worker, not by Ctrl-C."""
    arrange = die_with_parent(signal.SIGKILL)

    def before_the_program() -> None:
        arrange()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # until it can end by it

    return before_the_program


def _candidates() -> list[tuple[str, str | None]]:
    """Return (variant, LLVM library) in the order of trial."""
    cuda = [(CUDA, None)] if gpus.cuda_driver() is not None else []
    llvm = ((LLVM, str(path)) for path in llvm_libraries())
    return [*cuda, *llvm, (SCALAR, None), *((one, None) for one in _of_others())]


def _of_others() -> list[str]:
    """Return the variants of other renderers that may work here, and have to be tried.

    What works everywhere is tried where a program brings it, which may be of any version.
    """
    names = [name for name, _ in system_libraries()]

    def may_work(variant: str, known: VariantFacts) -> bool:
        if known.works_everywhere:
            return not is_installed(variant)
        return any(name.startswith(known.driver) for name in names)

    return [
        variant
        for variant, known in renderers.variants().items()
        if known.renderer != MITSUBA and is_here(variant) and may_work(variant, known)
    ]


def _is_of_mitsuba(one: Probe) -> bool:
    return variant_named(one.variant).renderer == MITSUBA


def _try(candidates: list[tuple[str, str | None]], every: bool) -> tuple[Probe, ...]:
    tried: list[Probe] = []
    for variant, library in candidates:
        # One variant of Mitsuba is enough, and every one of other renderers is offered.
        is_enough = any(map(_is_of_mitsuba, filter(lambda one: one.ok, tried))) and not every
        if not (is_enough and variant_named(variant).renderer == MITSUBA):
            tried.append(probe(variant, library))
    return tuple(tried)


def _choice(tried: tuple[Probe, ...], others: tuple[Probe, ...] = ()) -> VariantChoice:
    """Return what Mitsuba renders with, and what was found of other renderers."""
    failed = list(takewhile(lambda one: not one.ok, tried))
    story = "; ".join(f"{_described(one)} {one.detail}" for one in failed)
    if len(failed) == len(tried):
        return VariantChoice(SCALAR, None, f"nothing renders here: {story}", (*tried, *others))
    taken = tried[len(failed)]
    if taken.variant == SCALAR and not failed:
        why = f"{SCALAR}: neither a CUDA driver nor an LLVM library was found"
    else:
        why = f"{_described(taken)} renders here" + (f" ({story})" if failed else "")
    library = next((one.library for one in tried if one.ok and one.variant == LLVM), None)
    return VariantChoice(taken.variant, library, why, (*tried, *others))


def _is_lasting(one: Probe) -> bool:
    """Return whether another trial would probably have the same outcome."""
    if one.ok:
        return True
    if variant_named(one.variant).on_gpu:
        return False  # it may be in use
    if one.detail.startswith(_TIMED_OUT) or _WRONG in one.detail:
        return False  # a machine under load, memory that fails
    broken = tuple(f"{how_ended(-number)}," for number in _BROKEN)
    return not one.detail.startswith(_ENDED_BY) or one.detail.startswith(broken)


def _described(one: Probe) -> str:
    return one.variant if one.library is None else f"{one.variant} with {one.library}"


def _last_words(done: subprocess.CompletedProcess[str]) -> str:
    """Return how a probe ended, with the line that has the cause, or else its last line."""
    lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    telling = (line for line in lines if any(mark in line for mark in _CAUSES))
    said = next(telling, lines[-1] if lines else "nothing")
    return f"{how_ended(done.returncode)}, saying {said[:300]}"


def _known(memory: identity.Memory) -> tuple[Probe, ...] | None:
    """Return the outcome of the last trial, which another would probably have too."""
    try:
        return tuple(Probe(**one) for one in memory.read()) or None
    except TypeError:
        return None


def _identity(candidates: list[tuple[str, str | None]]) -> dict[str, Any]:
    """Return everything on which the outcome depends, as JSON shows it."""
    libraries = [path for _, path in candidates if path is not None]
    known = identity.of(libraries)
    return {**known, "candidates": [variant for variant, _ in candidates]}
