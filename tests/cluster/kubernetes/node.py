"""A machine with Kubernetes on it, real but for its size: one node, as root on Debian.

Its processes have a network, mounts and process numbers of their own, and end with the first of
them, which ends with the tests. Beside those it has a folder and control groups, both of its name,
which are removed at its end; what a run leaves that was killed, the next one removes.
"""

import contextlib
import ctypes
import fcntl
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Final

import pytest

from tests.cluster.kubernetes.identities import identities
from tests.cluster.kubernetes.images import ARCHIVE
from tests.cluster.kubernetes.settings import (
    ADDRESS,
    API_SERVER,
    CONTROLLERS,
    KUBELET,
    NAME,
    configuration,
)
from tests.support.until import until

_PREFIX: Final = "plateau-kubernetes-"
_CONTROL_GROUPS: Final = Path("/sys/fs/cgroup")
_CLONE_NEWNET: Final = 0x40000000

#: The first process. Folders that the node's programs share with the machine's are hidden; settings
#: that kubelet would change for the whole machine it finds as it wants them.
_FIRST: Final = """
mount --make-rshared /
mount -t proc proc /proc
mount -t tmpfs tmpfs /run
mount -t tmpfs tmpfs /var/lib
mount --bind "$0/log" /var/log
for setting in vm/overcommit_memory=1 kernel/panic=10 kernel/panic_on_oops=1; do
  file=/run/$(basename "${setting%=*}")
  echo "${setting#*=}" > "$file"
  mount --bind "$file" "/proc/sys/${setting%=*}"
done
ip link set dev lo up
ip link add node0 type veth peer name outside
ip addr add ADDRESS/24 dev node0
ip link set dev outside up
ip link set dev node0 up
ip route add default via 10.200.0.254 dev node0 onlink
ip neigh add 10.200.0.254 lladdr 02:00:00:00:00:01 dev node0 nud permanent
echo 1 > /proc/sys/net/ipv4/ip_forward
echo ready
sleep infinity & wait
""".replace("ADDRESS", ADDRESS)


class Node:
    """A cluster of one node.

    Parameters
    ----------
    tool
        Finds a program.
    """

    def __init__(self, tool: Callable[[str], Path]) -> None:
        self._tool = tool
        self._stack = contextlib.ExitStack()
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Node":
        _refuse_where_it_cannot_be()
        _remove_stale()
        self.folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        with contextlib.ExitStack() as stack:
            stack.callback(_remove, self.folder)
            lock = stack.enter_context((self.folder / "lock").open("w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
            self._begin(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def kubectl(self, *arguments: str, given: str | None = None, fails: bool = False) -> str:
        """What kubectl prints; on standard error where it has to fail."""
        return self._run("kubectl", *arguments, given=given, fails=fails)

    def helm(self, *arguments: str, fails: bool = False) -> str:
        """What helm prints; on standard error where it has to fail."""
        return self._run("helm", *arguments, fails=fails)

    def get(self, *arguments: str) -> dict[str, Any]:
        """An object, or a list of them."""
        return json.loads(self.kubectl("get", *arguments, "--output=json"))

    def apply(self, *objects: dict[str, Any]) -> None:
        """Make the objects what they are said to be."""
        listed = {"apiVersion": "v1", "kind": "List", "items": objects}
        self.kubectl("apply", "--filename=-", given=json.dumps(listed))

    @contextlib.contextmanager
    def network(self) -> Iterator[None]:
        """Let this thread, and what it starts, be on the node's network."""
        theirs = Path(f"/proc/{self._pid}/ns/net")
        with Path("/proc/thread-self/ns/net").open() as ours, theirs.open() as there:
            _enter(there)
            try:
                yield
            finally:
                _enter(ours)

    def start(self, name: str, *arguments: str) -> None:
        """Start one of the node's programs; it ends with the node."""
        with (self.folder / "log" / f"{name}.log").open("wb") as log:
            self._processes[name] = subprocess.Popen(
                [*self._inside, str(self._tool(name)), *arguments],
                env={**os.environ, "PATH": f"/usr/sbin:/sbin:{os.environ['PATH']}"},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def run(self, program: str, *arguments: str) -> None:
        """Run a program on the node."""
        command = [*self._inside, str(self._tool(program)), *arguments]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    # --- how it comes to be ---

    def _begin(self, stack: contextlib.ExitStack) -> None:
        for name in ("log", "volumes", "cni"):
            (self.folder / name).mkdir()
        identities(self.folder, f"https://{ADDRESS}:6443", NAME, ADDRESS)
        self._first(stack)
        for file, text in configuration(self.folder).items():
            (self.folder / file).write_text(text)
        self.start("etcd", "--data-dir=etcd", "--unsafe-no-fsync")
        self.start("containerd", "--config=containerd.toml")
        self.start("kube-apiserver", *API_SERVER)
        stack.enter_context(self.network())
        self._await(lambda: "ok" in self._try("get", "--raw=/readyz"))
        for name, arguments in CONTROLLERS.items():
            self.start(name, f"--kubeconfig={name}.conf", *arguments)
        self.run("ctr", "--namespace=k8s.io", "images", "import", str(ARCHIVE))
        self.start("kubelet", *KUBELET, f"--root-dir={self.folder}/kubelet")
        self._await(lambda: self._try("get", "node", NAME).count(" Ready "))
        self.kubectl("apply", f"--filename={Path(__file__).parent / 'cluster.yaml'}")
        self.kubectl(
            "rollout", "status", "deployment/coredns", "--namespace=kube-system", "--timeout=120s"
        )

    def _first(self, stack: contextlib.ExitStack) -> None:
        """Start the process with which all others end."""
        for root in _control_groups():
            (root / self.folder.name).mkdir()
        spaces = ("--net", "--mount", "--pid", "--fork", "--kill-child")
        first = subprocess.Popen(
            ["unshare", *spaces, "bash", "-euc", _FIRST, str(self.folder)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        stack.callback(self._end, first)
        assert first.stdout is not None
        assert first.stderr is not None
        if first.stdout.readline() != "ready\n":
            pytest.fail(f"the node has no namespaces of its own: {first.stderr.read()}")
        children = Path(f"/proc/{first.pid}/task/{first.pid}/children")
        self._pid = int(children.read_text())
        enter = ("nsenter", f"--target={self._pid}", "--net", "--mount", "--pid")
        self._inside = (*enter, "env", f"--chdir={self.folder}")

    def _end(self, first: subprocess.Popen[str]) -> None:
        first.kill()
        first.communicate()
        for process in self._processes.values():
            process.wait(60)

    def _await(self, condition: Callable[[], object]) -> None:
        def checked() -> object:
            for name, process in self._processes.items():
                assert process.poll() is None, f"{name} ended: {self._log(name)}"
            return condition()

        until(checked, 180, lambda: "\n".join(map(self._log, self._processes)), every_s=0.5)

    def _log(self, name: str) -> str:
        text = (self.folder / "log" / f"{name}.log").read_text(errors="replace")
        return f"--- {name}\n{text[-2000:]}"

    def _run(
        self, program: str, *arguments: str, given: str | None = None, fails: bool = False
    ) -> str:
        done = subprocess.run(
            [self._tool(program), f"--kubeconfig={self.folder}/admin.conf", *arguments],
            env={**os.environ, "HOME": str(self.folder)},
            input=given,
            capture_output=True,
            text=True,
            timeout=1000,
            check=False,
        )
        assert (done.returncode != 0) == fails, f"{program} {arguments}: {done.stdout}{done.stderr}"
        return done.stderr if fails else done.stdout

    def _try(self, *arguments: str) -> str:
        with contextlib.suppress(AssertionError):
            return self.kubectl(*arguments)
        return ""


def _refuse_where_it_cannot_be() -> None:
    if os.geteuid() != 0:
        pytest.fail("a node of Kubernetes needs namespaces: run `make test-cluster` as root")
    if not any(os.access(root, os.W_OK) for root in _control_groups()):
        pytest.fail(f"kubelet needs control groups, and none at {_CONTROL_GROUPS} can be written")


def _control_groups() -> list[Path]:
    """The root of the control groups, or by version 1 that of each controller."""
    if (_CONTROL_GROUPS / "cgroup.controllers").exists():
        return [_CONTROL_GROUPS]
    return [
        root
        for root in _CONTROL_GROUPS.glob("*/")
        if (root / "cgroup.procs").exists() and not root.is_symlink()
    ]


def _remove_stale() -> None:
    """Remove what runs have left that were killed."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with (folder / "lock").open("a") as lock, contextlib.suppress(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _remove(folder)


def _remove(folder: Path) -> None:
    for root in _control_groups():
        groups = [*(root / folder.name).glob("**/")]
        for group in sorted(groups, key=lambda path: len(path.parts), reverse=True):
            until(lambda group=group: _is_removed(group), 30)  # type: ignore[misc]
    shutil.rmtree(folder)


def _is_removed(group: Path) -> bool:
    """Whether the group is gone; its last process may be about to end."""
    with contextlib.suppress(OSError):
        group.rmdir()
    return not group.exists()


def _enter(network: IO[str]) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.setns(network.fileno(), _CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "setns")
