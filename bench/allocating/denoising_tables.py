"""The tables of denoised images, from their figures."""

from __future__ import annotations

from itertools import product
from typing import Any

from bench.allocating.peers import PEERS
from bench.support import markdown
from plateau.metric import Visible

TARGETS = (0.001, 0.0002)
RAW, DENOISED, BLEND = "raw", "denoised alone", "blend"
KINDS = (RAW, DENOISED, BLEND)
#: The rules that are tried on the blend: Plateau's own, and the paper's.
OWN = Visible.name
RULES = (OWN, "reverse", "successive", "multiple", "myszkowski")
#: What ends the name of a scene, where its figures are those of other renderers.
_PEERS = ", peers"


def peers_of(scene: str) -> str:
    """Return the name of a scene whose figures are those of other renderers."""
    return f"{scene}{_PEERS}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return every table by the name of its place in the document."""
    found = {one["name"]: one for one in report["figures"]}
    every = report["settings"]["scenes"]
    names = [name for name in every if not name.endswith(_PEERS)]

    def number(scene: str, what: str, form: str = ",.0f") -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else format(one["value"], form)

    def times(scene: str, what: str) -> str:
        raw, blend = (found.get(f"{scene}: {kind}: {what}") for kind in (RAW, BLEND))
        return "–" if raw is None or blend is None else f"{raw['value'] / blend['value']:.2f}"

    def spread(scene: str, what: str) -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else markdown.spread(one, 2)

    needed = [
        [
            scene,
            *(
                f"{number(scene, f'{RAW}: {what}')} / {number(scene, f'{BLEND}: {what}')} "
                f"= {times(scene, what)}"
                for what in (*(f"spp at {target:.2%}" for target in TARGETS), f"{OWN}: spp")
            ),
            *(number(scene, f"{kind}: {OWN}: wrong", ".3%") for kind in (RAW, BLEND)),
        ]
        for scene in names
    ]
    quality = [
        [
            scene,
            *(spread(scene, f"{kind}: wrong, of raw") for kind in (DENOISED, BLEND)),
            *(spread(scene, f"{kind}: estimate / truth") for kind in (RAW, BLEND)),
        ]
        for scene in names
    ]
    rules = [
        [
            f"{scene}, {kind}",
            *(
                f"{number(scene, f'{kind}: {rule}: spp')} / "
                f"{number(scene, f'{kind}: {rule}: wrong', '.3%')}"
                for rule in RULES
            ),
        ]
        for scene, kind in product(names, (BLEND, DENOISED))
    ]
    told = [
        [
            scene,
            *(
                number(scene, f"{BLEND}: {name}")
                for name in ("points", "determined", "determined, and twice as wrong")
            ),
        ]
        for scene in names
    ]
    elsewhere = [
        [
            name,
            *(
                f"{number(scene, f'{one}: spp')} / {number(scene, f'{one}: wrong', '.3%')}"
                for scene, one in (
                    (name, f"{BLEND}: {OWN}"),
                    *((peers_of(name), peer) for peer in PEERS),
                )
            ),
        ]
        for name in names
        if peers_of(name) in every
    ]
    return {
        "denoising-peers": markdown.table(["scene", "Plateau", *PEERS], elsewhere),
        "denoising-rules": markdown.table(["scene", *(f"`{rule}`" for rule in RULES)], rules),
        "denoising-determined": markdown.table(
            ["scene", "points", "determined", "of these, twice as wrong"], told
        ),
        "denoising": markdown.table(
            ["scene", "0.10 % wrong", "0.02 % wrong", "the rule's end", "wrong then, raw", "blend"],
            needed,
        ),
        "denoising-quality": markdown.table(
            [
                "scene",
                "denoised alone, wrong pixels of raw",
                "blend, wrong pixels of raw",
                "raw, estimate / truth",
                "blend, estimate / truth",
            ],
            quality,
        ),
    }
