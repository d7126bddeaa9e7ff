"""How an image of a data set is stored: the files' names, and what each has.

``exr``
    One file an image, with a layer for each input (``spp0004.R``), AOV and the variance.
``oidn``
    As Open Image Denoise's training takes it: ``NAME_0004spp.hdr.exr`` for the colour of so many
    samples per pixel, ``.alb.exr`` and ``.nrm.exr`` for albedo and normal. Of the files of a name,
    the one with the most samples is the target. Source: the README of OIDN's ``training`` folder.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from plateau.errors import needs
from plateau.farm.model.aovs import AOVS
from plateau.rendering.mapped import Mapped
from plateau.rendering.result import IMAGE, Result

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Layers = Mapping[str, NDArray[np.float32]]

_FEATURES: Final = {
    "hdr": ("R", "G", "B"),
    "alb": AOVS["albedo"].channels,
    "nrm": AOVS["normal"].channels,
}
_DIGITS: Final = 4


def files_of(one: Mapped, layout: str, name: str, max_spp: int) -> dict[str, bytes]:
    """The files of an image by their names; `max_spp` is the most that any image may have."""
    assert one.result is not None
    if layout == "oidn":
        return _oidn(one, name, max(_DIGITS, len(str(max_spp))))
    content = one.result.files[IMAGE]
    if one.noisy is not None:
        content = _with_inputs(one, one.result, content)
    return {f"{name}.exr": content}


def _with_inputs(one: Mapped, result: Result, content: bytes) -> bytes:
    """The image with the layers of its independent inputs."""
    with needs("images"):
        from plateau.farm.images.exr import decode_header, encode_layers, input_layer
        from plateau.farm.images.mattes import attributes_of

    layers = dict(one.channels)
    for spp, of_input in one.inputs.items():
        layers |= {f"{input_layer(spp)}.{name}": plane for name, plane in of_input.items()}
    header = decode_header(content)
    kept = {name: value for name, value in header.items() if name.startswith("plateau:")}
    compression = result.job.spec.exr.compression
    return encode_layers(layers, kept | attributes_of(header), compression=compression)


def _oidn(one: Mapped, name: str, digits: int) -> dict[str, bytes]:
    """The files of each number of samples; digits are alike, as OIDN sorts names as text."""
    with needs("images"):
        from plateau.farm.images.exr import encode_layers

    assert one.result is not None
    of_spp: dict[int, Any] = {**one.inputs, one.result.spp: one.channels}
    files = {}
    for spp, layers in of_spp.items():
        for feature, channels in _FEATURES.items():
            planes = {to: layers[source] for to, source in zip("RGB", channels, strict=True)}
            files[f"{name}_{spp:0{digits}d}spp.{feature}.exr"] = encode_layers(planes, {})
    return files
