"""A release of the chart in a cluster, as its users and its keeper see it."""

import base64
import json
from pathlib import Path
from typing import Any, Final

import yaml

from plateau.client import Client
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.redis.link import connect
from tests.cluster.kubernetes.images import REDIS
from tests.cluster.kubernetes.node import Node
from tests.cluster.support_chart import CHART
from tests.support.farms.real_farm import Farm
from tests.support.until import until

#: The standard that pods of the farm's namespace have to fit.
_STRICT: Final = {"pod-security.kubernetes.io/enforce": "restricted"}


class Release(Farm):
    """The chart with the values of an example, in a namespace of its own with volumes.

    Parameters
    ----------
    node
        The cluster; whoever calls is on its network.
    example
        The name of a file in the chart's folder of examples.
    values
        What differs from it on this node, by the value's full name.
    """

    def __init__(self, node: Node, example: str, **values: object) -> None:
        self.node = node
        self.namespace = f"render-{example}"
        self._file = CHART / "examples" / f"{example}.yaml"
        self._values = {"redis.image": REDIS, **values}
        told = yaml.safe_load(self._file.read_text())
        storage = told.get("redis", {}).get("storage", {})
        volume = told.get("blobs", {}).get("volume", {})
        self._keys = told.get("keys", {}).get("existingSecret", "farm-plateau-keys")
        self._volume("data-farm-plateau-redis-0", "ReadWriteOnce", storage.get("className"))
        claim = volume.get("existingClaim")
        blobs = claim or "farm-plateau-blobs"
        self.store = Blobs(str(self._volume(blobs, "ReadWriteMany", volume.get("className"))))
        labels = {"metadata": {"name": self.namespace, "labels": _STRICT}}
        node.apply({"apiVersion": "v1", "kind": "Namespace", **labels})
        roots = [root["claim"] for root in told.get("sceneRoots", {}).values()]
        for name in roots:
            self._volume(name, "ReadWriteMany", None)
        asked = {"accessModes": ["ReadWriteMany"], "resources": {"requests": {"storage": "1Ti"}}}
        for name in filter(None, (claim, *roots)):
            self.apply("PersistentVolumeClaim", name, spec=asked)

    def apply(self, kind: str, name: str, **fields: object) -> None:
        """Make an object of the core's in the namespace."""
        about = {"name": name, "namespace": self.namespace}
        self.node.apply({"apiVersion": "v1", "kind": kind, "metadata": about, **fields})

    def install(self) -> None:
        """Install it, and find its API through the Service."""
        self._helm("install", f"--values={self._file}", **self._values)
        service = self._get("service", "farm-plateau-api")
        self.url = f"http://{service['spec']['clusterIP']}:8713"
        self.key = self.secret(self._keys, "admin")
        self.client = Client(self.url, key=self.key, patience_s=60)

    def upgrade(self, **values: object) -> None:
        """Upgrade it with the values that it has, and those that are given."""
        self._helm("upgrade", "--reuse-values", **values)

    def uninstall(self) -> None:
        """Uninstall it, and wait until its pods are gone."""
        self.client.close()
        self.node.helm("uninstall", "farm", f"--namespace={self.namespace}", "--wait")
        until(lambda: not self.pods(), every_s=0.5)

    def look_inside(self) -> None:
        """Connect to the chart's Redis, where it now runs."""
        pod = self._get("pod", "farm-plateau-redis-0")
        url = self.secret("farm-plateau-redis", "admin-url")
        name = f"farm-plateau-redis.{self.namespace}.svc"
        self.redis_client = connect(url.replace(name, pod["status"]["podIP"]))
        self.jobs = Jobs(self.redis_client)

    def pods(self, part: str | None = None) -> list[dict[str, Any]]:
        """The pods of the release, or of a part of it."""
        asked = "app.kubernetes.io/instance=farm"
        if part is not None:
            asked += f",app.kubernetes.io/component={part}"
        return list(self._get("pods", f"--selector={asked}")["items"])

    def delete(self, part: str) -> None:
        """Delete the pod of a part, and wait until another is ready."""
        [old] = self.pods(part)
        name = old["metadata"]["name"]
        self.node.kubectl("delete", "pod", name, f"--namespace={self.namespace}")
        until(lambda: self._is_replaced(part, old["metadata"]["uid"]), every_s=0.5)

    def warnings(self) -> list[tuple[str, str]]:
        """The events that warn, as reason and message."""
        events = self._get("events", "--field-selector=type=Warning")["items"]
        return [(event["reason"], event["message"]) for event in events]

    def make_secret(self, name: str, values: dict[str, str]) -> None:
        """Make a Secret."""
        self.apply("Secret", name, stringData=values)

    def secret(self, name: str, key: str) -> str:
        """What a Secret has under a key."""
        return base64.b64decode(self._get("secret", name)["data"][key]).decode()

    def _is_replaced(self, part: str, uid: str) -> bool:
        pods = self.pods(part)
        return len(pods) == 1 and pods[0]["metadata"]["uid"] != uid and is_ready(pods[0])

    def _get(self, *asked: str) -> dict[str, Any]:
        return self.node.get(*asked, f"--namespace={self.namespace}")

    def _helm(self, *arguments: str, **values: object) -> None:
        given = [f"--set-json={name}={json.dumps(value)}" for name, value in values.items()]
        where = ("farm", str(CHART), f"--namespace={self.namespace}", "--wait", "--timeout=15m")
        self.node.helm(*arguments, *given, *where)

    def _volume(self, claim: str, mode: str, class_name: str | None) -> Path:
        """A volume that waits for the claim, and where it lies."""
        path = self.node.folder / "volumes" / self.namespace / claim
        path.mkdir(parents=True)
        here = {"key": "kubernetes.io/os", "operator": "Exists"}
        self.node.apply(
            {
                "apiVersion": "v1",
                "kind": "PersistentVolume",
                "metadata": {"name": f"{self.namespace}-{claim}"},
                "spec": {
                    "accessModes": [mode],
                    "capacity": {"storage": "2Ti"},
                    "claimRef": {"name": claim, "namespace": self.namespace},
                    "local": {"path": str(path)},
                    "nodeAffinity": {
                        "required": {"nodeSelectorTerms": [{"matchExpressions": [here]}]}
                    },
                    "storageClassName": class_name or "local",
                },
            }
        )
        return path


def is_ready(pod: dict[str, Any]) -> bool:
    """Whether the pod serves."""
    conditions = pod["status"].get("conditions", ())
    return any(one["type"] == "Ready" and one["status"] == "True" for one in conditions)
