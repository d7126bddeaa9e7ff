"""Code that has taken over a render child, and tries every way out of it.

`take_over` lays it in a folder: with that on ``PYTHONPATH``, a child gets this module in the place
of its renderer, by the start path that real ones have. It tries all when it is asked to load a
scene, each attack in a thread of its own, and writes into its folder of kernels what came of each.

Run as a program it tries the same as another user, confined or not: the latter shows that the
attacks are real.
"""

import ctypes
import errno
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: x86_64's numbers; libc has no functions for these.
_NUMBERS = {"pidfd_open": 434, "pidfd_getfd": 438, "io_uring_setup": 425, "tgkill": 234}
_NUMBERS |= {"keyctl": 250, "setuid": 105, "bpf": 321, "userfaultfd": 323, "prlimit64": 302}
_PTRACE_SEIZE = 0x4206
_PR_SET_DUMPABLE = 4
_CLONE_NEWUSER = 0x10000000
_BOOT = (
    "import sys\n"
    "if 'plateau.worker.child' in sys.orig_argv:\n"
    "    import hostile_child\n"
    "    sys.modules['plateau.worker.renderers.mitsuba.renderer'] = hostile_child\n"
)


def take_over(folder: Path, victims: dict[str, str]) -> None:
    """Lay a hostile renderer into the folder, and tell it what to attack."""
    (folder / "sitecustomize.py").write_text(_BOOT)
    (folder / "hostile_child.py").write_text(Path(__file__).read_text())
    (folder / "victims.json").write_text(json.dumps(victims))


class Renderer:
    """What a render child takes for its renderer."""

    def __init__(self, *_: object) -> None:
        pass

    def load(self, request: Any) -> None:
        from plateau.worker.renderers.contract import SceneError

        victims = json.loads(Path(__file__).with_name("victims.json").read_text())
        kernels = Path.home() / ".drjit"
        found = outcomes({**victims, "scene": request.folder, "supervisor": str(os.getppid())})
        (kernels / "outcomes.part").write_text(json.dumps(found))
        (kernels / "outcomes.part").rename(kernels / "outcomes.json")
        raise SceneError("it was taken over")


def outcomes(victims: dict[str, str]) -> dict[str, str]:
    """What came of each attack: the name of the error, or ``done``."""
    found: dict[str, str] = {}

    def attempt(name: str, attack: Callable[[], object]) -> None:
        try:
            attack()
        except subprocess.SubprocessError as error:
            found[name] = repr(error)
        except OSError as error:
            found[name] = errno.errorcode.get(error.errno or 0, repr(error))
        else:
            found[name] = "done"

    for name, attack in _attacks(victims).items():
        thread = threading.Thread(target=attempt, args=(name, attack))
        thread.start()
        thread.join()
    return found


def _call(name: str, *arguments: Any) -> int:
    libc = ctypes.CDLL(None, use_errno=True)
    if name in _NUMBERS:
        answer: int = libc.syscall(_NUMBERS[name], *arguments)
    else:
        answer = getattr(libc, name)(*arguments)
    if answer == -1:
        raise OSError(ctypes.get_errno(), name)
    return answer


def _attacks(victims: dict[str, str]) -> dict[str, Callable[[], object]]:
    pid = int(victims["supervisor"])
    its = Path(f"/proc/{pid}")
    secret, data, scene = (Path(victims[name]) for name in ("secret", "data", "scene"))
    buffer = ctypes.create_string_buffer(64)
    vector = (ctypes.c_void_p * 2)(ctypes.addressof(buffer), 8)

    def steal_descriptor() -> None:
        _call("pidfd_getfd", _call("pidfd_open", pid, 0), 0, 0)

    return {
        # its supervisor
        "read its environment": (its / "environ").read_bytes,
        "read its memory": lambda: _open(its / "mem"),
        "write its memory": lambda: _open(its / "mem", os.O_RDWR),
        "read its map": (its / "maps").read_bytes,
        "list its files": lambda: _list(its / "fd"),
        "open its files": lambda: _open(its / "fd" / "1"),
        "enter its root": lambda: _list(its / "root"),
        "trace it": lambda: _call("ptrace", _PTRACE_SEIZE, pid, 0, 0),
        "read another's memory": lambda: _call("process_vm_readv", pid, vector, 1, vector, 1, 0),
        "write another's memory": lambda: _call("process_vm_writev", pid, vector, 1, vector, 1, 0),
        "take its descriptor": steal_descriptor,
        "signal it": lambda: os.kill(pid, 0),
        "signal its thread": lambda: _call("tgkill", pid, pid, 0),
        "signal all": lambda: os.kill(-1, 0),
        "limit it": lambda: _call("prlimit64", pid, 7, None, buffer),
        "slow it down": lambda: os.setpriority(os.PRIO_PROCESS, pid, 19),
        "bind it to a core": lambda: os.sched_setaffinity(pid, os.sched_getaffinity(pid)),
        # files
        "read a secret": secret.read_bytes,
        "read the users": Path("/etc/passwd").read_bytes,
        "list the root": lambda: _list(Path("/")),
        "list the data folder": lambda: _list(data),
        "list its home": lambda: _list(Path.home()),
        "list the scenes": lambda: _list(scene.parents[1]),
        "write a secret": lambda: secret.open("r+b").close(),
        "cut a secret": lambda: os.truncate(secret, 0),
        "rename a secret": lambda: secret.rename(secret.with_suffix(".x")),
        "write into the data folder": lambda: (data / "new").touch(),
        "make a folder there": lambda: (data / "folder").mkdir(),
        "change its scene": lambda: (scene / "scene.xml").open("ab").close(),
        "write beside its kernels": lambda: (Path.home() / "new.pth").touch(),
        "change its own program": lambda: Path(__file__).open("ab").close(),
        "link a secret": lambda: os.link(secret, Path.home() / ".drjit" / "link"),
        "change who may read": lambda: secret.chmod(0o666),
        "change when it was written": lambda: os.utime(secret, (0, 0)),
        "give a file away": lambda: os.chown(secret, os.getuid(), os.getgid()),
        "mark a file": lambda: os.setxattr(secret, "user.mark", b"x"),
        "make a device": lambda: os.mknod(data / "device", 0o020666, os.makedev(1, 3)),
        "remove a secret": secret.unlink,
        # programs and sockets
        "fork": lambda: os.fork() or os._exit(0),
        "run a program": lambda: subprocess.run(["/bin/true"], check=True),
        "spawn a program": lambda: os.posix_spawn("/bin/true", ["true"], {}),
        "become another program": lambda: os.execv("/nowhere/no-such-program", ["x"]),
        "connect": lambda: socket.socket().connect(("127.0.0.1", int(victims["port"]))),
        "send a datagram": lambda: socket.socket(type=socket.SOCK_DGRAM).close(),
        "connect to Redis": lambda: socket.socket(socket.AF_UNIX).connect(victims["redis"]),
        "send packets": lambda: socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET).close(),
        "make a pair of sockets": lambda: [one.close() for one in socket.socketpair()],
        "io_uring": lambda: _call("io_uring_setup", 1, ctypes.create_string_buffer(120)),
        # powers
        "mount": lambda: _call("mount", b"none", os.fsencode(data), b"no-such-kind", 0, None),
        "become another user": lambda: _call("setuid", 1),
        "change the root": lambda: os.chroot("/"),
        "name the machine": lambda: socket.sethostname(socket.gethostname()),
        "a namespace": lambda: _call("unshare", _CLONE_NEWUSER),
        "keys of the kernel": lambda: _call("keyctl", 0, -3, 0),
        "bpf": lambda: _call("bpf", 0, None, 0),
        "page faults": lambda: os.close(_call("userfaultfd", os.O_CLOEXEC)),
        "shared memory": lambda: _call("shmget", 0, 4096, 0o1600),
    }


def _list(folder: Path) -> None:
    list(folder.iterdir())


def _open(path: Path, flags: int = os.O_RDONLY) -> None:
    os.close(os.open(path, flags))


def _main(victims: dict[str, str], user: int, how: str) -> None:
    from plateau.worker.confinement.confine import confine  # while it can be read

    if user != os.geteuid():
        os.setgroups([])
        os.setgid(user)
        os.setuid(user)
        _call("prctl", _PR_SET_DUMPABLE, 1, 0, 0, 0)  # as a program that this user has started
    answers = os.dup(1)
    os.dup2(os.open(Path(victims["scene"]) / "scene.xml", os.O_RDONLY), 1)  # the neighbour's
    neighbour = os.fork()
    if not neighbour:
        os.close(answers)
        os._exit(len(os.read(0, 1)))  # when the test has seen all
    os.dup2(answers, 1)
    if how != "free":
        scenes = Path(victims["scene"]).parents[1]
        confine(scenes=[scenes], kernels=Path.home() / ".drjit", on_gpu=how == "on a GPU")
    print(json.dumps(outcomes({**victims, "supervisor": str(neighbour)})))


if __name__ == "__main__":
    _main(json.loads(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
