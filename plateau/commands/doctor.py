"""`plateau doctor`: what works on this machine, and why the rest does not."""

import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from plateau.commands import options as o
from plateau.commands.app import app
from plateau.commands.printing import print_json
from plateau.errors import CommandFailed, ExitCode, needs

if TYPE_CHECKING:
    from plateau.farm.model.renderers import RendererFacts
    from plateau.farm.process.settings import Settings
    from plateau.worker.supervisor.variants import VariantChoice

#: The longest that a renderer may look for devices; a driver may start first.
_DEVICES_S: Final = 120.0


@dataclass(frozen=True)
class Check:
    """The result of one check."""

    name: str
    detail: str
    ok: bool = True
    needed: bool = False  #: whether nothing can be rendered if it fails


@app.command()
def doctor(
    notify: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Only send a test message to this target of PLATEAU_NOTIFY_FILE, and say whether "
            "it was taken.",
        ),
    ] = None,
    as_json: o.Json = False,
) -> None:
    """Check what works on this machine, and explain what does not.

    For example:
      plateau doctor
      PLATEAU_NOTIFY_FILE=/etc/plateau/targets plateau doctor --notify ops

    The exit code is 1 if nothing can be rendered, or the message cannot be sent. Its reason is then
    shown, and may have parts of the target's URL.
    """
    if notify is not None:
        _notify(notify, as_json=as_json)
        return
    from plateau.farm.model.renderers import MITSUBA, renderers
    from plateau.processes.read_settings import farm_settings
    from plateau.worker.supervisor.variants import choose

    settings = farm_settings()
    choice = choose(settings.cache, every=True)
    checks = [*_machine(), *_stores(settings), *_folders(settings), *_variants(choice)]
    for one in renderers().values():
        if one.package and one.name != MITSUBA:
            checks += _renderer(one)
    checks += [_denoiser(), *_confinement()]
    can_render = all(check.ok for check in checks if check.needed)
    shown = _without_passwords(settings)
    if as_json:
        found: dict[str, object] = {
            "can_render": can_render,
            "variant": choice.variant,
            "why": choice.why,
            "checks": [asdict(check) for check in checks],
            "settings": shown,
        }
        print_json(found)
    else:
        for check in checks:
            mark = "ok" if check.ok else "NO" if check.needed else "–"
            print(f"{mark:<4}{check.name}: {check.detail}")
        print("\nsettings (set by PLATEAU_… in the environment)")
        for name, value in shown.items():
            print(f"    PLATEAU_{name.upper()} = {'' if value is None else value}")
        print(
            f"\nscenes are rendered with {choice.variant}"
            if can_render
            else "\nnothing can be rendered"
        )
    raise typer.Exit(ExitCode.OK if can_render else ExitCode.FAILED)


def _machine() -> Iterator[Check]:
    import platform

    yield Check("Python", f"{platform.python_version()}, {sys.executable}", needed=True)
    cores = len(os.sched_getaffinity(0))
    yield Check("cores", f"{cores} of {platform.machine()}")


def _stores(settings: "Settings") -> Iterator[Check]:
    import secrets

    from plateau.farm.blobs.store import Blobs
    from plateau.farm.redis.embedded import find_redis_server
    from plateau.farm.redis.health import examine
    from plateau.farm.redis.url import without_password

    binary = find_redis_server()
    if binary is None:
        detail = "no redis-server: apt install redis-server, or use Python 3.10–3.12"
    else:
        detail = f"{_redis_version(binary)}, {binary}"
    yield Check("embedded Redis", detail, ok=binary is not None, needed=settings.redis_url is None)
    if settings.redis_url is not None:
        yield from (Check(**asdict(one)) for one in examine(settings.redis_url))
    where = settings.blobs or str(settings.data / "blobs")
    shown = without_password(where)
    name = f"doctor/{secrets.token_hex(8)}"
    try:
        blobs = Blobs(where)
        blobs.put(name, b"can be written")
        blobs.get(name)
        blobs.delete(name)
        yield Check("blob store", f"{shown} can be written", needed=True)
    except Exception as error:  # noqa: BLE001  (a store's URL may fail in any way)
        yield Check("blob store", f"{shown}: {error}", ok=False, needed=True)


def _folders(settings: "Settings") -> Iterator[Check]:
    for name, folder in (("data folder", settings.data), ("cache folder", settings.cache)):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            problem = "" if os.access(folder, os.W_OK) else "cannot be written"
        except OSError as error:
            problem = error.strerror or str(error)
        yield Check(name, f"{folder}: {problem or 'can be written'}", ok=not problem, needed=True)


def _variants(choice: "VariantChoice") -> Iterator[Check]:
    variants = {one.variant for one in choice.tried}
    if "cuda_ad_rgb" not in variants:
        yield Check("CUDA", "no driver found", ok=False)
    if "llvm_ad_rgb" not in variants:
        detail = "no library found; with one (apt install libllvm19) rendering is 3 times as fast"
        yield Check("LLVM", detail, ok=False)
    for one in choice.tried:
        library = "" if one.library is None else f", {one.library}"
        yield Check(f"{one.variant}{library}", one.detail, ok=one.ok)
    works = any(one.ok for one in choice.tried)
    yield Check("workers render with", choice.why, ok=works, needed=True)


def _renderer(one: "RendererFacts") -> Iterator[Check]:
    """Check a renderer that Plateau does without."""
    import json
    import subprocess

    from plateau.farm.model.renderers import shown_name
    from plateau.worker.renderers.program import command, release
    from plateau.worker.supervisor.variants import is_here, probe

    variant = shown_name(f"{one.name}:{one.variants[0].own_name}")
    if not is_here(variant):
        yield Check(variant, one.missing, ok=False)
        return
    tried = probe(variant, None)
    yield Check(variant, f"{one.package} {release(variant)}; {tried.detail}", ok=tried.ok)
    if not one.devices:
        return
    name = f"{one.name} on GPUs"
    try:
        done = subprocess.run(
            command(variant, one.devices),
            capture_output=True,
            encoding="utf-8",
            timeout=_DEVICES_S,
            check=True,
        )
        found = json.loads(done.stdout.splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError) as error:
        yield Check(name, f"its own search failed: {error}", ok=False)
        return
    listed = "; ".join(f"{one.name}:{kind} ({', '.join(names)})" for kind, names in found.items())
    yield Check(name, listed or "it finds no device", ok=bool(found))


def _denoiser() -> Check:
    from plateau.picture.denoising import oidn

    try:
        detail = f"Open Image Denoise {oidn.version()}, for jobs that ask for it"
    except ImportError as error:
        why = str(error) if oidn.is_installed() else oidn.MISSING
        return Check("denoiser", why, ok=False)
    return Check("denoiser", detail)


def _confinement() -> Iterator[Check]:
    from plateau.worker.confinement.confine import try_here

    for one in try_here():
        detail = one.holds if one.error is None else f"not confined: {one.error}"
        yield Check(f"a render child's {one.name}", detail, ok=one.error is None)


def _redis_version(binary: Path) -> str:
    import subprocess

    answer = subprocess.run(
        [binary, "--version"], capture_output=True, encoding="utf-8", timeout=10, check=False
    ).stdout
    words = [word.removeprefix("v=") for word in answer.split() if word.startswith("v=")]
    return words[0] if words else "of unknown version"


def _without_passwords(settings: "Settings") -> dict[str, object]:
    from plateau.farm.redis.url import without_password

    shown: dict[str, object] = settings.model_dump(mode="json")
    for name in ("redis_url", "blobs"):
        if shown[name] is not None:
            shown[name] = without_password(str(shown[name]))
    return shown


def _notify(name: str, *, as_json: bool) -> None:
    """Send a test message to a target, or fail with what apprise said."""
    from plateau.processes.read_settings import read_settings
    from plateau.service.notices.targets import read_targets

    with needs("monitor,notify"):
        from plateau.service.monitor.notifier.notes import Note, NotNotified, send

        test = Note("Plateau: a test", "This target is notified when jobs end that name it.")
        try:
            send(name, read_targets(read_settings()).url(name), test)
        except NotNotified as error:
            raise CommandFailed(f"{name} was not notified: {error.said}") from None
    if as_json:
        print_json({"target": name, "notified": True})
    else:
        print(f"{name} was notified")
