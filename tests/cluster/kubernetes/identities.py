"""Who is who in the cluster: certificates of an authority of its own, and what clients show."""

import json
from pathlib import Path
from typing import Final

import trustme

#: Clients by their file, with their name and group.
_CLIENTS: Final = {
    "admin": ("admin", "system:masters"),
    "kube-controller-manager": ("system:kube-controller-manager", None),
    "kube-proxy": ("system:kube-proxy", None),
    "kube-scheduler": ("system:kube-scheduler", None),
}


def identities(folder: Path, url: str, node: str, address: str) -> None:
    """Write certificates, keys and the configuration of each client into the folder."""
    cluster, aggregation = trustme.CA(), trustme.CA()
    cluster.cert_pem.write_to_path(folder / "cluster.crt")
    aggregation.cert_pem.write_to_path(folder / "aggregation.crt")

    def issue(
        file: str, name: str, group: str | None, *hosts: str, by: trustme.CA = cluster
    ) -> None:
        made = by.issue_cert(*hosts or [file], common_name=name, organization_name=group)
        made.cert_chain_pems[0].write_to_path(folder / f"{file}.crt")
        made.private_key_pem.write_to_path(folder / f"{file}.key")
        access = {
            "apiVersion": "v1",
            "kind": "Config",
            "clusters": [
                {"name": "one", "cluster": {"server": url, "certificate-authority": "cluster.crt"}}
            ],
            "users": [
                {
                    "name": name,
                    "user": {"client-certificate": f"{file}.crt", "client-key": f"{file}.key"},
                }
            ],
            "contexts": [{"name": "one", "context": {"cluster": "one", "user": name}}],
            "current-context": "one",
        }
        (folder / f"{file}.conf").write_text(json.dumps(access))

    for file, (name, group) in _CLIENTS.items():
        issue(file, name, group)
    issue("kubelet", f"system:node:{node}", "system:nodes", node, address)
    service = ["kubernetes", "kubernetes.default", "kubernetes.default.svc"]
    issue("apiserver", "kube-apiserver", None, *service, address, "10.96.0.1")
    issue("front", "front", None, by=aggregation)
    trustme.CA().private_key_pem.write_to_path(folder / "accounts.pem")
