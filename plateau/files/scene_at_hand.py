"""A scene as people have it at hand: a path, the name of an example, a Mitsuba dict."""

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeAlias

from plateau import scenes
from plateau.errors import needs
from plateau.farm.bundle import BundleError
from plateau.farm.model.scene_roots import at_home

#: A file, a zip or a folder; `scenes:NAME`; or what `mitsuba.load_dict` takes.
SceneAtHand: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any]"

_PREFIX: Final = "plateau-scene-"


@contextmanager
def scene_file(scene: SceneAtHand) -> Iterator[Path]:
    """The scene as a path; a dict is written to a temporary folder that lasts for the context.

    Raises
    ------
    BundleError
        There is no such example, or the dict cannot be written; the message names the value.
    TypeError
        It is neither a path nor a dict.
    """
    if isinstance(scene, Mapping):
        with tempfile.TemporaryDirectory(prefix=_PREFIX) as folder:
            with needs("worker"):
                from plateau.worker.renderers.mitsuba.scene_dict import write_scene_dict
            named = Path(folder) / "scene"  # as it is called where nobody says how
            named.mkdir()
            yield write_scene_dict(scene, named)
    elif isinstance(scene, str | os.PathLike):
        try:
            path = scenes.path_of(at_home(scene))
        except ValueError as error:
            raise BundleError("missing-file", str(error)) from None
        yield path
    else:
        raise TypeError(
            f"a scene is a path, scenes:NAME or a Mitsuba dict, not {type(scene).__name__}; of a "
            "loaded scene, give the file or the dict that it was loaded from"
        )
