"""The devices besides the processor on which Cycles can render here, by Blender's own probe.

``python -m plateau.cycles.devices`` prints them, a JSON object of names by kind. A
process of its own: a driver that does not suit the machine may abort it.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from plateau.cycles.blender import blender, bpy

if TYPE_CHECKING:
    from collections.abc import Iterator

#: Blender's name of a kind of device, by the variant's own name; the first ones are tried first.
KINDS: Final = {name: name.upper() for name in ("optix", "cuda", "hip", "oneapi")}


def found() -> dict[str, list[str]]:
    """Return the names of the devices that Blender finds, by their kind."""
    return {kind: names for kind in KINDS if (names := [one.name for one in _devices(kind)])}


def use(scene: Any, kind: str) -> None:
    """Have a scene rendered on every device of a kind, and not on the processor.

    Raises
    ------
    RuntimeError
        There is none.
    """
    if kind == "cpu":
        scene.cycles.device = "CPU"
        return
    chosen = list(_devices(kind))
    if not chosen:
        raise RuntimeError(f"Blender finds no device for {kind}")
    preferences = _preferences()
    preferences.compute_device_type = KINDS[kind]
    for one in preferences.devices:
        one.use = one.type == KINDS[kind]
    scene.cycles.device = "GPU"


def _devices(kind: str) -> Iterator[Any]:
    try:
        with blender():
            listed = _preferences().get_devices_for_type(KINDS[kind])
    except ValueError:  # of another platform, which this Blender does not know
        return
    yield from (one for one in listed if one.type == KINDS[kind])


def _preferences() -> Any:
    return bpy.context.preferences.addons["cycles"].preferences


if __name__ == "__main__":
    print(json.dumps(found()))
