"""Builds images by what a Containerfile says, without a container engine, as root on Debian.

Each step is a layer: what it changes in the file systems of those before it, kept in a folder that
is named after all that went into it, so that a later build repeats only what has changed. Debian's
own Python stands where the Containerfile says python:3.11-slim, which comes from a registry.

    python -m tests.cluster.kubernetes.images
"""

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

from tests.cluster.kubernetes.archive import Image, write_archive
from tests.cluster.support_chart import ROOT
from tests.cluster.support_containerfile import Stage, stages

TOOLS: Final = ROOT / ".cluster-tools"
FOLDER: Final = TOOLS / "images"
ARCHIVE: Final = FOLDER / "images.tar"
REDIS: Final = "plateau.test/redis:7.0.15"
COREDNS: Final = "plateau.test/coredns:1.13.1"
KEDA: Final = "plateau.test/keda:2.21.0"
PAUSE: Final = "plateau.test/pause:1"

#: What the cluster runs beside the farm; programs are in .cluster-tools/bin.
_OTHERS: Final = {
    REDIS: [
        ("RUN", "apt-get update && apt-get install --yes --no-install-recommends redis-server"),
        ("RUN", "rm -r /var/lib/apt/lists/* && chmod 755 /etc/redis"),
    ],
    COREDNS: [("COPY", "coredns /usr/bin/"), ("ENTRYPOINT", '["coredns"]')],
    KEDA: [("COPY", "keda keda-adapter /"), ("USER", "10001:10001")],
    PAUSE: [("ENTRYPOINT", '["sleep", "infinity"]')],
}

#: The image that the farm's rest on, nearly: Debian 12 and its Python 3.11.
_BASE: Final = """
debootstrap --variant=minbase --include={packages} bookworm "$0"
for suite in bookworm bookworm-updates; do
  echo "deb http://deb.debian.org/debian $suite main"
done > "$0/etc/apt/sources.list"
cd "$0"
rm -r var/lib/apt/lists/* var/cache/apt/archives/*.deb usr/lib/python3*/EXTERNALLY-MANAGED
: > etc/resolv.conf
""".format(packages="ca-certificates,python-is-python3,python3-pip,python3-venv")

#: How this machine reaches the registries of packages.
_NETWORK: Final = re.compile(r"(?i).*_proxy|.*_CA_BUNDLE|SSL_CERT_FILE|PIP_CERT|(PIP|UV)_.*INDEX.*")


class Builder:
    """Does the steps of stages, once for each state of what they are made from."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._folder = folder
        self._stages = stages()
        self._built: dict[str, Image] = {}
        folder.mkdir(parents=True, exist_ok=True)

    def base(self) -> Image:
        """What all rests on."""
        layer = self._layer(_digest(_BASE), ["bash", "-euc", _BASE])
        return Image(layers=(layer,))

    def target(self, name: str) -> Image:
        """The image that a stage of the Containerfile ends with."""
        if name not in self._stages:
            return self.base()
        if name not in self._built:
            stage = self._stages[name]
            self._built[name] = self.on(self.target(stage.base), stage, ROOT)
        return self._built[name]

    def on(self, image: Image, stage: Stage, context: Path) -> Image:
        """The image after the steps of a stage; COPY takes its sources from the context."""
        for instruction, argument in stage.steps:
            image = self._after(image, instruction, argument, context)
        return image

    def _after(self, image: Image, instruction: str, argument: str, context: Path) -> Image:
        match instruction:
            case "RUN":
                return self._run(image, argument)
            case "COPY":
                return self._copy(image, argument, context)
            case "ENV":
                told = (word.partition("=")[::2] for word in shlex.split(argument))
                known = dict(image.environment)
                known |= {name: value.replace("$PATH", known["PATH"]) for name, value in told}
                return replace(image, environment=tuple(known.items()))
            case "USER":
                return replace(image, user=argument)
            case "WORKDIR":
                return replace(image, folder=argument)
            case "ENTRYPOINT":
                return replace(image, entrypoint=tuple(json.loads(argument)))
            case "CMD":
                return replace(image, command=tuple(json.loads(argument)))
            case "LABEL" | "EXPOSE":
                return image
        raise AssertionError(f"no such instruction: {instruction}")

    def _run(self, image: Image, step: str) -> Image:
        told = {**dict(image.environment), **_network()}
        clean = ("env", "-i", *(f"{name}={value}" for name, value in told.items()))
        inside = f"mkdir -p {image.folder}; cd {image.folder}; {step}"
        script = shlex.join([f"--userspec={image.user}", ".", *clean, "bash", "-euc", inside])
        key = _digest(image.key, image.folder, image.user, step)
        return self._with_layer(image, key, f'cd "$0"; chroot {script}')

    def _copy(self, image: Image, argument: str, context: Path) -> Image:
        *sources, target = argument.split()
        unpack = 'tar -xC "$to" --no-same-owner'
        if sources[0].startswith("--from="):
            other = self.target(sources.pop(0).removeprefix("--from="))
            made_from = [other.key]
            layers = ":".join(map(str, reversed(other.layers)))
            begin = f"mount -t overlay overlay -o ro,lowerdir={layers} /mnt; cd /mnt"
            deeds = [f"tar -cC .{one} . | {unpack}" for one in sources]
        else:
            made_from = [one for source in sources for one in _contents(context, source)]
            begin = f"cd {shlex.quote(str(context))}"
            # A folder's contents are copied, and files into a folder
            deeds = [
                f"tar -cC {one} --exclude=__pycache__ . | {unpack}"
                if (context / one).is_dir()
                else f'cp {one} "$to"'
                for one in sources
            ]
        to = f'to="$0{Path(image.folder, target)}"; mkdir -p "$to"'
        key = _digest(image.key, image.folder, argument, *made_from)
        return self._with_layer(image, key, "; ".join([to, begin, *deeds]))

    def _with_layer(self, image: Image, key: str, script: str) -> Image:
        upper, work, merged = (f'"$1"/{name}' for name in ("upper", "work", "merged"))
        lower = ":".join(map(str, reversed(image.layers)))
        begin = f"""
            mkdir -p {upper} {work} {merged}
            mount -t overlay overlay -o lowerdir={lower},upperdir={upper},workdir={work} {merged}
            mount -t proc proc {merged}/proc
            mount --rbind /dev {merged}/dev
            mount --bind /etc/resolv.conf {merged}/etc/resolv.conf
            mount --bind /etc/ssl/certs {merged}/etc/ssl/certs
            set -- {merged}
        """
        inside = f'{begin}\nexec bash -euc {shlex.quote(script)} "$1"'
        spaces = ("--mount", "--pid", "--fork", "--kill-child")
        layer = self._layer(key, ["unshare", *spaces, "bash", "-euc", inside, "build"])
        return replace(image, layers=(*image.layers, layer))

    def _layer(self, key: str, command: list[str]) -> Path:
        """The folder of a layer, made by the command where there is none."""
        layer = self._folder / key
        if not layer.exists():
            made = self._folder / "new"
            shutil.rmtree(made, ignore_errors=True)
            made.mkdir()
            done = subprocess.run(
                [*command, str(made)],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{command[-2]}\n{done.stdout[-4000:]}"
            upper = made / "upper"
            (upper if upper.exists() else made).rename(layer)
            shutil.rmtree(made, ignore_errors=True)
        return layer

    def forget_others(self, images: Iterable[Image]) -> None:
        """Remove the layers that neither these images need, nor those that they copy from."""
        kept = {layer for image in (*images, *self._built.values()) for layer in image.layers}
        for folder in self._folder.iterdir():
            if folder.is_dir() and folder not in kept:
                shutil.rmtree(folder)


def _contents(context: Path, source: str) -> Iterator[str]:
    """What is copied, file by file, with a digest of each."""
    path = context / source
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file() and "__pycache__" not in file.parts:
            digest = hashlib.sha256(file.read_bytes()).hexdigest()
            yield f"{file.relative_to(context)}:{digest}"


def _network() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if _NETWORK.fullmatch(name)}


def _digest(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]


def build() -> None:
    """Build all images into one archive, unless it has them already."""
    builder = Builder()
    images = {
        f"{repository}/{part}:0.1.0": builder.target(part)
        for repository in ("docker.io/plateau", "registry.example.org/plateau")
        for part in ("api", "monitor", "worker")
    }
    for name, steps in _OTHERS.items():
        images[name] = builder.on(builder.base(), Stage(name, "", steps), TOOLS / "bin")
    wanted = json.dumps({name: [image.config, image.key] for name, image in images.items()})
    made_from = ARCHIVE.with_suffix(".json")
    if not made_from.exists() or made_from.read_text() != wanted:
        made_from.unlink(missing_ok=True)
        write_archive(images, ARCHIVE)
        made_from.write_text(wanted)
    builder.forget_others(images.values())


if __name__ == "__main__":
    build()
