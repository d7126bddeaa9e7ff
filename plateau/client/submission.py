"""Submits a scene with the spec of a job or of a batch."""

import os
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any, Final

from pydantic import ValidationError

from plateau.client.errors import invalid_spec
from plateau.client.transport import Model, Transport
from plateau.farm.model.spec import JobSpec
from plateau.files.packing import pack
from plateau.files.scene_at_hand import SceneAtHand, scene_file

_SHA256: Final = re.compile(r"[0-9a-f]{64}")
_IN_ROOT: Final = re.compile(r"\{[^{}/]+\}(/|$)")


def spec_of(spec: JobSpec | None, fields: Mapping[str, Any]) -> JobSpec:
    """The spec with these fields replaced, checked."""
    given = {} if spec is None else {name: getattr(spec, name) for name in spec.model_fields_set}
    with refusing():
        return JobSpec.model_validate({**given, **fields})


@contextmanager
def refusing() -> Iterator[None]:
    """Raise `InvalidSpec` for a spec that does not fit, as the service would."""
    try:
        yield
    except ValidationError as error:
        raise invalid_spec(error) from None


def submitted(
    transport: Transport,
    kind: type[Model],
    scene: SceneAtHand,
    request: str,
    values: Iterable[Mapping[str, str]],
    idempotency_key: str | None,
) -> Model:
    """Submit a scene with a request (a spec as JSON); returns the answer.

    `values` are the sets of parameters with which the scene's files are found.
    """
    headers = {"Idempotency-Key": idempotency_key or secrets.token_hex(16)}
    parts: dict[str, Any] = {"spec": (None, request)}
    with ExitStack() as stack:
        if isinstance(scene, str) and _SHA256.fullmatch(scene):
            parts["scene_sha256"] = (None, scene)
        elif isinstance(scene, str | os.PathLike) and _IN_ROOT.match(str(scene)):
            parts["scene_path"] = (None, str(scene))
        else:
            path = stack.enter_context(scene_file(scene))
            packed = stack.enter_context(pack(path, *values))
            # httpx rewinds it each time
            parts["scene"] = (packed.name, packed.file, packed.media_type)
        return transport.make(kind, "/v1/jobs", headers=headers, files=parts)
