"""Shuts a render child in, and takes it to the program that has its renderer."""

from collections.abc import Iterable
from pathlib import Path

from plateau.farm.model.renderers import variant_named
from plateau.worker.confinement.confine import confine, confine_before
from plateau.worker.renderers.program import continue_in, program_of


def shut_in(variant: str, module: str, *, scenes: Iterable[Path], kernels: Path) -> list[str]:
    """Confine this process as its variant allows; return what does not confine it, in words.

    Where a program brings the renderer, this process becomes it, and runs `module` from the start
    with the same arguments. Call this before other threads start, see `confine`.
    """
    known = variant_named(variant)
    is_confined = known.is_confined
    program = program_of(variant)
    if program is not None:
        if is_confined:
            confine_before(program, scenes=scenes, kernels=kernels)
        continue_in(variant, module)
    if not is_confined:
        return [f"{known.renderer} was never tried under it with {known.own_name}"]
    taken = confine(scenes=scenes, kernels=kernels, on_gpu=known.on_gpu)
    return [f"{one.name}: {one.error}" for one in taken if one.error is not None]
