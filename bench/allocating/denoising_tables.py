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
#: The same where samples go by zones.
_ZONES = ", by zones"
#: The same where a blend knows what is wrong in truth.
_BEST = ", at best"


def peers_of(scene: str) -> str:
    """Return the name of a scene whose figures are those of other renderers."""
    return f"{scene}{_PEERS}"


def zones_of(scene: str) -> str:
    """Return the name of a scene whose figures are those of samples by zones."""
    return f"{scene}{_ZONES}"


def best_of(scene: str) -> str:
    """Return the name of a scene whose figures are those of a blend that knows the truth."""
    return f"{scene}{_BEST}"


def tables(report: dict[str, Any]) -> dict[str, str]:
    """Return every table by the name of its place in the document."""
    found = {one["name"]: one for one in report["figures"]}
    every = report["settings"]["scenes"]
    names = [name for name in every if not name.endswith((_PEERS, _ZONES, _BEST))]

    def number(scene: str, what: str, form: str = ",.0f") -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else format(one["value"], form)

    def ratio(one: str, other: str) -> str:
        more, less = found.get(one), found.get(other)
        return "–" if more is None or less is None else f"{more['value'] / less['value']:.2f}"

    def fewer(scene: str, what: str, other: str, its: str) -> str:
        """Both numbers, and how many times fewer the other one is."""
        times = ratio(f"{scene}: {what}", f"{other}: {its}")
        return f"{number(scene, what)} / {number(other, its)} = {times}"

    def spread(scene: str, what: str) -> str:
        one = found.get(f"{scene}: {what}")
        return "–" if one is None else markdown.spread(one, 2)

    wanted = (*(f"spp at {target:.2%}" for target in TARGETS), f"{OWN}: spp")
    needed = [
        [
            scene,
            *(fewer(scene, f"{RAW}: {what}", scene, f"{BLEND}: {what}") for what in wanted),
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
    by_zones = [
        [
            name,
            *(fewer(name, f"{RAW}: {what}", zones_of(name), what) for what in wanted),
            number(zones_of(name), f"{OWN}: wrong", ".3%"),
            number(zones_of(name), "looks"),
            spread(zones_of(name), "estimate / truth"),
        ]
        for name in names
        if zones_of(name) in every
    ]
    at_best = [
        [
            name,
            *(
                fewer(best_of(name), f"{RAW}: {what}", best_of(name), f"{BLEND}: {what}")
                for what in wanted[:-1]
            ),
        ]
        for name in names
        if best_of(name) in every
    ]
    return {
        "denoising-best": markdown.table(["scene", "0.10 % wrong", "0.02 % wrong"], at_best),
        "denoising-zones": markdown.table(
            [
                "scene",
                "0.10 % wrong",
                "0.02 % wrong",
                "the rule's end",
                "wrong then",
                "looks",
                "estimate / truth",
            ],
            by_zones,
        ),
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
