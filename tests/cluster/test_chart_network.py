"""Who may talk to whom, by the chart's network policies: what has to, and nobody else."""

from ipaddress import ip_address, ip_network
from typing import Any

import pytest

from tests.cluster import support_chart as chart
from tests.cluster.support_chart import EXAMPLES, NAMESPACE, Manifest

#: A pod: the namespace that it is in, and its labels.
Pod = tuple[str, dict[str, str]]
OURS = {"app.kubernetes.io/name": "plateau", "app.kubernetes.io/instance": "farm"}


def ours(part: str) -> Pod:
    return NAMESPACE, {**OURS, "app.kubernetes.io/component": part}


API, MONITOR, REDIS = ours("api"), ours("monitor"), ours("redis")
DNS = ("kube-system", {"k8s-app": "kube-dns"})
KEDA = ("keda", {"app": "keda-operator"})
PROMETHEUS = ("monitoring", {"app": "prometheus"})
NEIGHBOUR = (NAMESPACE, {"app": "notebook"})
STRANGER = ("elsewhere", {"app": "notebook"})
INGRESS = ("ingress-nginx", {"app": "nginx"})
#: Redis, the API, DNS, https, mail, and what nobody uses here.
PORTS = {"redis": 6379, "api": 8713, "dns": 53, "https": 443, "mail": 587, "ssh": 22}


class Network:
    """Decides as Kubernetes does: a pod that no policy of a direction selects is open in it."""

    def __init__(self, found: list[Manifest]) -> None:
        self._policies = chart.of_kind(found, "NetworkPolicy")

    def lets(self, source: Pod, target: Pod | str, port: int) -> bool:
        """Whether a pod can reach a pod, or an address outside."""
        leaves = self._allows("Egress", source, target, port)
        return leaves and (isinstance(target, str) or self._allows("Ingress", target, source, port))

    def _allows(self, direction: str, pod: Pod, other: Pod | str, port: int) -> bool:
        specs = [one["spec"] for one in self._policies]
        binding = [
            spec
            for spec in specs
            if direction in spec["policyTypes"]
            and pod[0] == NAMESPACE
            and _selects(spec["podSelector"], pod[1])
        ]
        if not binding:
            return True
        key = "to" if direction == "Egress" else "from"
        return any(
            port in {one["port"] for one in rule.get("ports", [{"port": port}])}
            and any(_is_peer(peer, other) for peer in rule[key])
            for spec in binding
            for rule in spec.get(direction.lower(), ())
        )


def _is_peer(peer: dict[str, Any], other: Pod | str) -> bool:
    if isinstance(other, str):
        block = peer.get("ipBlock")
        if block is None:
            return False
        address = ip_address(other)
        excepted = any(address in ip_network(one) for one in block.get("except", ()))
        return address in ip_network(block["cidr"]) and not excepted
    if "ipBlock" in peer:
        return False
    namespace, labels = other
    if "namespaceSelector" in peer:
        if not _selects(peer["namespaceSelector"], {"kubernetes.io/metadata.name": namespace}):
            return False
    elif namespace != NAMESPACE:
        return False
    return _selects(peer.get("podSelector", {}), labels)


def _selects(selector: dict[str, Any], labels: dict[str, str]) -> bool:
    for expression in selector.get("matchExpressions", ()):
        assert expression["operator"] == "NotIn"
        if labels.get(expression["key"]) in expression["values"]:
            return False
    return all(labels.get(key) == value for key, value in selector.get("matchLabels", {}).items())


def network(example: str) -> Network:
    return Network(chart.rendered(example))


def allowed(example: str, pods: dict[str, Pod | str]) -> set[str]:
    """Every way that is open, as ``source > target:port``, among these pods and addresses."""
    decides = network(example)
    return {
        f"{source} > {target}:{port}"
        for source, from_pod in pods.items()
        for target, to_pod in pods.items()
        for port, number in PORTS.items()
        if source != target
        and not isinstance(from_pod, str)
        # Between pods that are not ours, the chart says nothing.
        and (OURS.items() <= from_pod[1].items() or not isinstance(to_pod, str))
        and any(
            OURS.items() <= pod[1].items() for pod in (from_pod, to_pod) if isinstance(pod, tuple)
        )
        and decides.lets(from_pod, to_pod, number)
    }


def test_of_a_farm_with_its_own_redis_nothing_is_open_but_this() -> None:
    pods = {"api": API, "monitor": MONITOR, "worker": ours("worker-cpu"), "redis": REDIS}
    others = {"dns": DNS, "keda": KEDA, "prometheus": PROMETHEUS, "neighbour": NEIGHBOUR}
    outside = {"public": "93.184.216.34", "private": "10.1.2.3", "node": "169.254.169.254"}
    assert allowed("gpu", {**pods, **others, "stranger": STRANGER, **outside}) == {
        "api > redis:redis",
        "monitor > redis:redis",
        "worker > redis:redis",
        "keda > api:api",
        "neighbour > api:api",
        "monitor > public:https",
        *(f"{part} > dns:dns" for part in pods),
    }


def test_of_one_with_everything_outside_these_are_open() -> None:
    pods = {"api": API, "monitor": MONITOR, "worker": ours("worker-cpu")}
    outside = {"store": "10.30.0.10", "beside": "10.30.0.11", "public": "93.184.216.34"}
    assert allowed("external", {**pods, "stranger": STRANGER, **outside}) == {
        "api > store:https",
        "monitor > store:https",
        "worker > store:https",
        "monitor > public:https",
        # As it has targets of notifications
        "monitor > public:mail",
    }
    assert network("external").lets(ours("worker-cpu"), "10.20.0.7", 6380)
    assert not network("external").lets(ours("worker-cpu"), "10.21.0.7", 6380)


def test_the_api_opens_to_whom_it_is_told_and_to_prometheus() -> None:
    decides = network("full")
    for pod in (INGRESS, KEDA, PROMETHEUS):
        assert decides.lets(pod, API, 8713)
    for pod in (NEIGHBOUR, STRANGER, ours("worker-small")):
        assert not decides.lets(pod, API, 8713)
    # And monitors to the private network of the receivers of webhooks
    assert decides.lets(MONITOR, "10.40.1.1", 8080)
    assert not decides.lets(ours("worker-small"), "10.40.1.1", 8080)
    assert decides.lets(ours("worker-small"), "169.254.20.10", 53)


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_pod_is_denied_what_is_not_named(example: str) -> None:
    found = chart.rendered(example)
    decides = Network(found)
    for one in chart.of_kind(found, "Deployment", "StatefulSet"):
        pod = NAMESPACE, one["spec"]["template"]["metadata"]["labels"]
        assert not decides.lets(pod, STRANGER, 80)
        assert not decides.lets(STRANGER, pod, 80)
        assert not decides.lets(pod, "169.254.169.254", 80)  # the cloud's metadata
