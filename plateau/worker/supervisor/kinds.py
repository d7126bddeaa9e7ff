"""Tests by a known image what this worker renders, and names the kinds that it is.

A kind is a renderer, a variant, an LLVM library, a processor, and the bits that these make of a
known image. Workers whose bits differ are of different kinds. A worker whose image is not the known
one, or whose bits are not those of the day before, renders nothing.
"""

import contextlib
import time
from datetime import datetime, timezone
from functools import cache as once
from pathlib import Path
from typing import Any, Final

from plateau.farm.model import versions
from plateau.farm.model.renderers import renderer_of, variant_named, variants
from plateau.worker.renderers.program import release
from plateau.worker.supervisor import identity
from plateau.worker.supervisor.variants import SCALAR, Probe, VariantChoice, probe

#: A worker renders the known image again after so long.
_AGAIN_S: Final = 24 * 3600.0


class Kinds:
    """The kinds of one worker, one for each variant that it has rendered with.

    Parameters
    ----------
    cache : Path
        Folder for what the known image was, kept until anything changes on which it depends.
    choice : VariantChoice
        What the worker found out at its start.
    """

    def __init__(self, cache: Path, choice: VariantChoice) -> None:
        self._library = choice.llvm_library
        self._identity = self._identity_now()
        self._memory = identity.Memory(cache / "kinds.json", self._identity)
        self._known: dict[str, dict[str, Any]] = self._read()
        for tried in choice.tried:
            if tried.ok and tried.bits and tried.variant not in self._known:
                self._remember(tried)

    def trouble(self, variant: str) -> str | None:
        """Return why the worker must not render with a variant, or None.

        Takes a second or two at the first slice of a variant, and once a day.
        """
        checked_s = self._known.get(variant, {}).get("checked", 0.0)
        if 0.0 <= time.time() - checked_s < _AGAIN_S:
            return None
        return self.test(variant)

    def test(self, variant: str) -> str | None:
        """Render the known image now; return why the worker must not render with the variant."""
        try:
            tried = probe(variant, None if variant == SCALAR else self._library)
        except OSError as error:
            return f"cannot start a process: {error.strerror}"
        if not tried.ok:
            return f"{variant} renders nothing here: {tried.detail}"
        before = self._known.get(variant)
        # Whether a GPU's bits are always the same, nobody has tried.
        if before and before["bits"] != tried.bits and not variant_named(variant).on_gpu:
            if self._identity_now() != self._identity:
                return "libraries were upgraded under this worker: start it again"
            day = datetime.fromtimestamp(before["checked"], timezone.utc).date()
            return (
                f"{variant} renders other bits of a known image ({tried.bits}) than on {day} "
                f"({before['bits']}), and nothing was upgraded: test this machine's memory and "
                f"processor, then remove {self._memory.file} and start the worker again"
            )
        self._remember(tried)
        return None

    def named(self, variant: str) -> str:
        """Return the name of the worker's kind with a variant; it has no comma."""
        known = variant_named(variant)
        parts = [known.own_name]
        if known.own_name.startswith("llvm") and self._library:
            parts.append(Path(self._library).name)
        parts.append("a GPU" if known.on_gpu else identity.cpu())
        if variant in self._known:
            parts.append(f"bits {self._known[variant]['bits']}")
        return f"{_release(variant)} ({'; '.join(parts)})".replace(",", "")

    def names(self) -> tuple[str, ...]:
        """Return the names of all kinds that the worker is known to be."""
        return tuple(map(self.named, tuple(self._known)))

    def _identity_now(self) -> dict[str, Any]:
        return identity.of(filter(None, [self._library]))

    def _remember(self, tried: Probe) -> None:
        self._known[tried.variant] = {"bits": tried.bits, "checked": time.time()}
        self._memory.write(self._known)

    def _read(self) -> dict[str, dict[str, Any]]:
        """What is remembered of the variants that are installed: a renderer may have gone since."""
        with contextlib.suppress(AttributeError, ValueError, TypeError, KeyError):
            return {
                name: {"bits": str(one["bits"]), "checked": float(one["checked"])}
                for name, one in (self._memory.read() or {}).items()
                if name in variants()
            }
        return {}  # of the wrong shape


@once
def _release(variant: str) -> str:
    """The name and version of a variant's renderer, which may be a part of Plateau."""
    known = renderer_of(variant)
    return f"{known.name} {release(variant) if known.package else versions.plateau()}"
