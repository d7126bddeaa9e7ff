"""Runs what the chart's pods run, as processes of this machine, the way Kubernetes would.

Environment, arguments, mounts, secrets and probes are those of the manifests, with folders for
volumes and local addresses for services. A process has the pod's user and no capability, cannot
gain any, and finds a file system that is read-only but for its volumes.
"""

import math
import os
import re
import shlex
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import TracebackType

import httpx
import pytest

from tests.cluster import support_chart as chart
from tests.cluster.support_chart import ROOT, Manifest

_CONFINED = (
    'mount --bind "$0" "$0" && mount -o remount,bind,ro / && cd / && '
    'exec setpriv --pdeathsig KILL --reuid "$1" --regid "$1" --clear-groups --no-new-privs '
    '--bounding-set=-all --inh-caps=-all "${@:2}"'
)


def _reachable(paths: Iterable[Path], hold: Path) -> Iterator[str]:
    """Yield shell commands that let every user reach the paths, in this mount namespace alone.

    Python or the repository may lie in root's home, which other users cannot enter.
    """
    hidden: dict[Path, list[Path]] = {}
    for path in paths:
        for folder in reversed(path.parents):
            if not folder.stat().st_mode & stat.S_IXOTH:
                hidden.setdefault(folder, []).append(path)
                break
    for index, (folder, inside) in enumerate(hidden.items()):
        held = hold / str(index)
        held.mkdir(parents=True, exist_ok=True)
        yield shlex.join(["mount", "--rbind", str(folder), str(held)])
        yield shlex.join(["mount", "-t", "tmpfs", "-o", "mode=755", "tmpfs", str(folder)])
        for path in inside:
            yield shlex.join(["mkdir", "-p", str(path)])
            kept = held / path.relative_to(folder)
            yield shlex.join(["mount", "--rbind", str(kept), str(path)])


def free_port() -> int:
    """A port that was free a moment ago."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


class Pod:
    """A container that runs, and how to look whether it does."""

    def __init__(self, node: "Node", name: str, pod: Manifest, container: Manifest) -> None:
        self.name, self._node, self._pod, self._container = name, node, pod, container
        self._user = pod["securityContext"]["runAsUser"]
        self._folders = {
            mount["mountPath"]: node.volume(name, pod, mount, self._user)
            for mount in container["volumeMounts"]
        }
        self.log = node.folder / f"{name}-{container['name']}.log"
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                self._confined(self._command()),
                env=self._environment(),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def here(self, text: str) -> str:
        """The same with the places of this machine for those in the pod."""
        places = "|".join(map(re.escape, sorted(self._folders, key=len, reverse=True)))
        text = re.sub(
            rf"(?<![\w./])(?:{places})(?![\w-])", lambda m: str(self._folders[m[0]]), text
        )
        for service, address in self._node.addresses.items():
            text = re.sub(rf"\b{service}\.{chart.NAMESPACE}\.svc:\d+", address, text)
        return text

    def end(self) -> None:
        """Stop it as Kubernetes would, and see that it ends well and in time."""
        self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(self._pod["terminationGracePeriodSeconds"])
        assert code == 0, f"{self.name} ended with {code}: {self.log.read_text()}"

    def await_probe(self, probe: str) -> None:
        """Wait until the probe succeeds, no longer than it may take by the manifest.

        That of the start waits by itself: each failure would be an event of Kubernetes's.
        """
        asked = self._container[probe]
        tries = 1 if probe == "startupProbe" else max(asked.get("failureThreshold", 3), 30)
        for _ in range(tries):
            assert self.process.poll() is None, f"{self.name} ended: {self.log.read_text()}"
            if self._probed(asked):
                return
            time.sleep(min(asked["periodSeconds"], 2.0))
        raise AssertionError(f"{self.name}: {probe} never succeeded: {self.log.read_text()}")

    def _probed(self, probe: Manifest) -> bool:
        if "exec" in probe:
            command = [self._at_its_port(self.here(word)) for word in probe["exec"]["command"]]
            timeout_s = probe["timeoutSeconds"]
            done = subprocess.run(command, capture_output=True, timeout=timeout_s, check=False)
            return done.returncode == 0
        address = self._node.addresses[self.name]
        if "tcpSocket" in probe:
            host, port = address.split(":")
            with socket.socket() as tried:
                return tried.connect_ex((host, int(port))) == 0
        try:
            return httpx.get(
                f"http://{address}{probe['httpGet']['path']}", trust_env=False
            ).is_success
        except httpx.TransportError:
            return False

    def _at_its_port(self, text: str) -> str:
        port = self._node.addresses.get(self.name, "").rpartition(":")[2]
        text = text.replace("/127.0.0.1/8713", f"/127.0.0.1/{port}")
        return text.replace("redis-cli ", f"{self._node.find('redis-cli')} -p {port} ")

    def _confined(self, command: list[str]) -> list[str]:
        needed = dict.fromkeys(map(Path, (sys.base_prefix, sys.prefix, ROOT)))
        script = " && ".join([*_reachable(needed, self._node.folder / "hidden"), _CONFINED])
        return [
            *("unshare", "--mount", "bash", "-c", script, str(self._node.folder)),
            *(str(self._user), *command),
        ]

    def _command(self) -> list[str]:
        if "command" in self._container:  # Redis's own image
            program, config = self._container["command"]
            file = Path(self.here(config))
            file.write_text(self.here(file.read_text()))
            port = self._node.addresses[self.name].rpartition(":")[2]
            return [str(self._node.find(program)), str(file), "--port", port, "--bind", "127.0.0.1"]
        arguments = [self.here(word) for word in self._container["args"]]
        if "--port" in arguments:
            port = self._node.addresses[self.name].rpartition(":")[2]
            arguments[arguments.index("--port") + 1] = port
        python = self._node.pythons.get(self._container["args"][0], sys.executable)
        return [str(python), "-m", "plateau", *arguments]

    def _environment(self) -> dict[str, str]:
        told = {one["name"]: self._value(one) for one in self._container.get("env", ())}
        image = {"PATH": os.environ["PATH"], "HOME": self.here("/tmp"), "TMPDIR": self.here("/tmp")}
        if not self._node.pythons:
            image["PYTHONPATH"] = str(ROOT)
        return {**image, "PYTHONDONTWRITEBYTECODE": "1", **told}

    def _value(self, variable: Manifest) -> str:
        source = variable.get("valueFrom", {})
        if "secretKeyRef" in source:
            wanted = source["secretKeyRef"]
            return self.here(self._node.secrets[wanted["name"]][wanted["key"]])
        if "resourceFieldRef" in source:
            assert source["resourceFieldRef"] == {"resource": "limits.cpu", "divisor": "1"}
            return str(math.ceil(float(self._container["resources"]["limits"]["cpu"])))
        return self.here(variable["value"])


class Node:
    """A machine on which pods run, each as processes.

    Parameters
    ----------
    folder
        Where volumes and logs are kept; others than root have to reach it.
    found
        The objects of the chart.
    find
        Where a program lies.
    pythons
        The interpreter of each command of Plateau's; without any, the one of the tests.
    """

    def __init__(
        self,
        folder: Path,
        found: list[Manifest],
        find: Callable[[str], Path],
        pythons: dict[str, Path] | None = None,
    ) -> None:
        self.folder, self.find, self._found = folder, find, found
        self.pythons = pythons or {}
        self.running: dict[str, Pod] = {}
        self.secrets = {
            one["metadata"]["name"]: dict(one["stringData"])
            for one in chart.of_kind(found, "Secret")
        }
        self.addresses = {
            service["metadata"]["name"]: f"127.0.0.1:{free_port()}"
            for service in chart.of_kind(found, "Service")
        }

    def __enter__(self) -> "Node":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for pod in self.running.values():
            if pod.process.poll() is None:
                pod.process.kill()
                pod.process.wait()

    def start(self, name: str) -> Pod:
        """Start the pod of this name, what comes first in it before, and wait till it is ready."""
        [pod] = [
            specification for called, specification in chart.pods(self._found) if called == name
        ]
        for container in pod.get("initContainers", ()):
            first = Pod(self, name, pod, container)
            assert first.process.wait(120) == 0, first.log.read_text()
        [container] = pod["containers"]
        self.running[name] = started = Pod(self, name, pod, container)
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            started.await_probe(probe)
        return started

    def volume(self, name: str, pod: Manifest, mount: Manifest, user: int) -> Path:
        """The folder that stands for a volume, or the file of it that is mounted."""
        volumes = {one["name"]: one for one in pod["volumes"]}
        claimed = {"persistentVolumeClaim": {"claimName": mount["name"]}}  # by a StatefulSet
        volume = {"name": mount["name"], **volumes.get(mount["name"], claimed)}
        if "emptyDir" in volume:
            return _owned(self.folder / name / volume["name"], user)
        if "persistentVolumeClaim" in volume:
            return _owned(
                self.folder / "claims" / volume["persistentVolumeClaim"]["claimName"], user
            )
        if "secret" in volume:
            files = self.secrets[volume["secret"]["secretName"]]
        else:
            files = chart.named(self._found, "ConfigMap", volume["configMap"]["name"])["data"]
        folder = _owned(self.folder / name / volume["name"], user)
        for file, text in files.items():
            if not (folder / file).exists():
                (folder / file).write_text(text)
        return folder / mount["subPath"] if "subPath" in mount else folder


def _owned(folder: Path, user: int) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    os.chown(folder, user, user)
    return folder


def needs_root() -> None:
    """Fail where the processes could not be confined."""
    if os.geteuid() != 0:
        pytest.fail("pods are confined by namespaces of root's: run `make test-cluster` as root")
