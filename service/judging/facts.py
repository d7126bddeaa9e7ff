"""What image files say of themselves: in the header of an EXR, and in text chunks of a PNG."""

import json
from collections.abc import Mapping
from typing import Any, Final

from plateau.farm.model import versions
from plateau.farm.model.job import Job, utc_now
from plateau.service.judging.merge import Merge

#: By name, without ``plateau:``. They are a file of the set of results, for its images to be made
#: again to the byte.
Facts = Mapping[str, str | int]
FILE: Final = "facts.json"

#: Rec. 709: x and y of red, green, blue and white.
_CHROMATICITIES: Final = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)


def facts_of(job: Job, merge: Merge, state: str, reason: str) -> Facts:
    """What is known of a merged image now.

    Parameters
    ----------
    job
        Whose image it is.
    merge
        The image.
    state, reason
        Of the job, with this image.
    """
    known: dict[str, str | int] = {
        **identity(job, merge.spp),
        **merge.origin,
        "rule": job.spec.rule.model_dump_json(),
        "state": state,
        "reason": reason,
        "non_finite": merge.non_finite(),
        "time": utc_now().isoformat(timespec="seconds"),
        "plateau": versions.plateau(),
    }
    return {name: value for name, value in known.items() if value != ""}


def identity(job: Job, spp: int) -> Facts:
    """Whose image it is, and of how many samples per pixel: that never changes."""
    return {"job": job.id, "spp": spp, "scene": job.name, "scene_sha256": job.scene_sha256}


def old_facts(job_id: str, spp: int) -> Facts:
    """What images said that were written before there were facts."""
    return {"job": job_id, "spp": spp}


def encode_facts(facts: Facts) -> bytes:
    """The facts as their file."""
    return json.dumps(facts).encode()


def decode_facts(content: bytes) -> Facts:
    """The facts in a file; ValueError where it is none."""
    facts: Facts = json.loads(content)
    return facts


def exr_header(facts: Facts) -> dict[str, Any]:
    """The attributes of an EXR file."""
    attributes = {f"plateau:{name}": value for name, value in facts.items()}
    return attributes | {"chromaticities": _CHROMATICITIES} if _is_new(facts) else attributes


def png_texts(facts: Facts) -> dict[str, str]:
    """The text chunks of a PNG file: what does not change, since kept pictures are made again."""
    named = ("job", "spp", "scene", "scene_sha256") if _is_new(facts) else ()
    return {f"plateau:{name}": str(facts[name]) for name in named if facts.get(name)}


def _is_new(facts: Facts) -> bool:
    return "scene_sha256" in facts
