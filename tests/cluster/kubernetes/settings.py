"""How the programs of the node are started, and the files by which they go."""

import json
from pathlib import Path
from typing import Final

from tests.cluster.kubernetes.images import PAUSE

ADDRESS: Final = "10.200.0.1"
NAME: Final = "node1"

#: Each runs in the node's folder, in which its files are.
API_SERVER: Final = (
    f"--advertise-address={ADDRESS}",
    "--allow-privileged",
    "--authorization-mode=Node,RBAC",
    f"--bind-address={ADDRESS}",
    "--client-ca-file=cluster.crt",
    "--enable-admission-plugins=NodeRestriction",
    "--enable-aggregator-routing",
    "--etcd-servers=http://127.0.0.1:2379",
    "--kubelet-certificate-authority=cluster.crt",
    "--kubelet-client-certificate=admin.crt",
    "--kubelet-client-key=admin.key",
    "--kubelet-preferred-address-types=InternalIP",
    "--proxy-client-cert-file=front.crt",
    "--proxy-client-key-file=front.key",
    "--requestheader-allowed-names=front",
    "--requestheader-client-ca-file=aggregation.crt",
    "--requestheader-extra-headers-prefix=X-Remote-Extra-",
    "--requestheader-group-headers=X-Remote-Group",
    "--requestheader-username-headers=X-Remote-User",
    "--service-account-issuer=https://kubernetes.default.svc.cluster.local",
    "--service-account-key-file=accounts.pem",
    "--service-account-signing-key-file=accounts.pem",
    "--service-cluster-ip-range=10.96.0.0/16",
    "--tls-cert-file=apiserver.crt",
    "--tls-private-key-file=apiserver.key",
)
CONTROLLERS: Final = {
    "kube-controller-manager": (
        "--bind-address=127.0.0.1",
        "--horizontal-pod-autoscaler-sync-period=5s",
        "--leader-elect=false",
        "--root-ca-file=cluster.crt",
        "--service-account-private-key-file=accounts.pem",
        "--use-service-account-credentials",
    ),
    "kube-scheduler": ("--bind-address=127.0.0.1", "--leader-elect=false"),
    "kube-proxy": (
        "--cluster-cidr=10.244.0.0/24",
        "--conntrack-max-per-core=0",
        "--conntrack-tcp-timeout-close-wait=0",
        "--conntrack-tcp-timeout-established=0",
        f"--hostname-override={NAME}",
        "--proxy-mode=iptables",
    ),
}
KUBELET: Final = (
    "--config=kubelet.json",
    f"--hostname-override={NAME}",
    "--kubeconfig=kubelet.conf",
    f"--node-ip={ADDRESS}",
)


def configuration(folder: Path) -> dict[str, str]:
    """The files by which containerd, its network and kubelet go."""
    free = ("memory.available", "nodefs.available", "imagefs.available", "nodefs.inodesFree")
    kubelet = {
        "apiVersion": "kubelet.config.k8s.io/v1beta1",
        "kind": "KubeletConfiguration",
        "address": ADDRESS,
        "authentication": {"x509": {"clientCAFile": "cluster.crt"}},
        "cgroupDriver": "cgroupfs",
        "cgroupRoot": f"/{folder.name}",
        "clusterDNS": ["10.96.0.10"],
        "clusterDomain": "cluster.local",
        "containerRuntimeEndpoint": "unix:///run/containerd/containerd.sock",
        "evictionHard": dict.fromkeys(free, "1%"),
        "failCgroupV1": False,
        "failSwapOn": False,
        "imageGCHighThresholdPercent": 100,
        "resolvConf": "",
        "syncFrequency": "10s",
        "tlsCertFile": "kubelet.crt",
        "tlsPrivateKeyFile": "kubelet.key",
    }
    addresses = {
        "type": "host-local",
        "ranges": [[{"subnet": "10.244.0.0/24"}]],
        "routes": [{"dst": "0.0.0.0/0"}],
    }
    bridge = {
        "type": "bridge",
        "bridge": "pods",
        "isGateway": True,
        "hairpinMode": True,
        "ipam": addresses,
    }
    return {
        "containerd.toml": f"""
version = 2
root = "{folder}/containerd"
state = "/run/containerd"
[grpc]
  address = "/run/containerd/containerd.sock"
[plugins."io.containerd.grpc.v1.cri"]
  restrict_oom_score_adj = true
  sandbox_image = "{PAUSE}"
  [plugins."io.containerd.grpc.v1.cri".cni]
    bin_dir = "/usr/lib/cni"
    conf_dir = "{folder}/cni"
  [plugins."io.containerd.grpc.v1.cri".containerd.runtimes.runc]
    runtime_type = "io.containerd.runc.v2"
""",
        "kubelet.json": json.dumps(kubelet),
        "cni/bridge.conflist": json.dumps(
            {"cniVersion": "0.4.0", "name": "pods", "plugins": [bridge]}
        ),
    }
