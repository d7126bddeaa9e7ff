"""Writes images into an archive that containerd imports, as `docker save` does."""

import hashlib
import io
import json
import os
import stat
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

_PATH: Final = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


@dataclass(frozen=True)
class Image:
    """The layers, the lowest first, and how a process of it is started."""

    layers: tuple[Path, ...]
    environment: tuple[tuple[str, str], ...] = (("PATH", _PATH),)
    user: str = "0:0"
    folder: str = "/"
    entrypoint: tuple[str, ...] = ()
    command: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """What a step upon it depends on."""
        return f"{self.layers[-1].name} {self.environment}"

    @property
    def config(self) -> dict[str, Any]:
        """As the OCI image specification has it."""
        return {
            "Env": [f"{name}={value}" for name, value in self.environment],
            "User": self.user,
            "WorkingDir": self.folder,
            "Entrypoint": list(self.entrypoint),
            "Cmd": list(self.command),
        }


def write_archive(images: dict[str, Image], archive: Path) -> None:
    """Write what `ctr images import` takes: the images by their names."""
    manifest = []
    layers = dict.fromkeys(layer for image in images.values() for layer in image.layers)
    with tarfile.open(archive, "w") as tar:
        digests = {layer: _add_layer(tar, layer, archive.parent) for layer in layers}
        for name, image in images.items():
            ids = [digests[layer] for layer in image.layers]
            config = {
                "architecture": "amd64",
                "os": "linux",
                "config": image.config,
                "rootfs": {"type": "layers", "diff_ids": [f"sha256:{one}" for one in ids]},
                "history": [],
            }
            text = json.dumps(config).encode()
            file = f"{hashlib.sha256(text).hexdigest()}.json"
            _add_bytes(tar, file, text)
            files = [f"{one}.tar" for one in ids]
            manifest.append({"Config": file, "RepoTags": [name], "Layers": files})
        _add_bytes(tar, "manifest.json", json.dumps(manifest).encode())


def _add_layer(tar: tarfile.TarFile, layer: Path, folder: Path) -> str:
    file = folder / "layer.tar"
    with tarfile.open(file, "w") as inner:
        for path in (layer, *sorted(layer.rglob("*"))):
            name = str(path.relative_to(layer))
            info = path.lstat()
            if stat.S_ISCHR(info.st_mode) and info.st_rdev == 0:  # what overlayfs has for "removed"
                _add_bytes(inner, str(Path(name).with_name(f".wh.{path.name}")), b"")
                continue
            inner.add(path, name, recursive=False)
            if not path.is_symlink() and path.is_dir() and _is_opaque(path):
                _add_bytes(inner, f"{name}/.wh..wh..opq", b"")
    with file.open("rb") as opened:
        digest = hashlib.file_digest(opened, "sha256").hexdigest()
    tar.add(file, f"{digest}.tar")
    file.unlink()
    return digest


def _is_opaque(folder: Path) -> bool:
    try:
        return os.getxattr(folder, "trusted.overlay.opaque") == b"y"
    except OSError:
        return False


def _add_bytes(tar: tarfile.TarFile, name: str, content: bytes) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(content)
    tar.addfile(info, io.BytesIO(content))
