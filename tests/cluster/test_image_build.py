"""An image, built from the Containerfile by Debian's buildah; no registry of images is asked."""

import os
import shutil
import ssl
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.cluster.support_chart import ROOT, Find
from tests.cluster.support_containerfile import FILE

pytestmark = pytest.mark.long_form

#: What the base of the Containerfile has: a Debian 12 with Python 3.11 and pip.
PACKAGES = "python3,python3-pip,python3-venv,python-is-python3,ca-certificates"
BASE = """\
FROM scratch
ADD base.tar /
COPY authorities.crt /etc/ssl/certs/ca-certificates.crt
ENV PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin PIP_BREAK_SYSTEM_PACKAGES=1 \\
    SSL_CERT_FILE=/etc/ssl/certs/ca-certificates.crt PIP_CERT=/etc/ssl/certs/ca-certificates.crt
"""
BASE_NAME = "localhost/plateau-base"
IMAGE_NAME = "localhost/plateau-api"


class Builder:
    """Buildah with a store of its own; it needs no daemon and no namespace."""

    def __init__(self, program: Path, folder: Path) -> None:
        self._store = [program, "--root", folder / "store", "--runroot", folder / "run"]

    def __call__(self, *command: str | Path) -> str:
        done = subprocess.run(
            [*self._store, *command],
            env=os.environ | {"STORAGE_DRIVER": "vfs", "BUILDAH_ISOLATION": "chroot"},
            cwd=ROOT,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr[-2000:]
        return done.stdout.strip()


@pytest.fixture
def builder(tool: Find) -> Iterator[Builder]:
    """A builder that has the base: Debian's packages, as mmdebstrap unpacks them."""
    if os.geteuid() != 0:
        pytest.fail("images are unpacked as root: run `make test-cluster` as root")
    with TemporaryDirectory(prefix="plateau-image-") as made:
        folder = Path(made)
        debootstrap = [tool("mmdebstrap"), "--quiet", "--variant=minbase", f"--include={PACKAGES}"]
        subprocess.run([*debootstrap, "bookworm", folder / "base.tar"], check=True)
        shutil.copy(ssl.get_default_verify_paths().cafile or "", folder / "authorities.crt")
        (folder / "Basefile").write_text(BASE)
        builder = Builder(tool("buildah"), folder)
        builder("build", "--tag", BASE_NAME, "--file", folder / "Basefile", folder)
        yield builder


def test_the_image_of_the_api_is_built_and_runs(builder: Builder) -> None:
    """Some minutes, most of them downloads."""
    named = ("--build-arg", f"PYTHON={BASE_NAME}", "--target", "api", "--tag", IMAGE_NAME)
    builder("build", "--network", "host", *named, "--file", FILE, ROOT)
    container = builder("from", IMAGE_NAME)
    assert builder("run", container, "--", "id", "--user") == "10001"
    assert builder("run", container, "--", "plateau", "--version").startswith("plateau ")
