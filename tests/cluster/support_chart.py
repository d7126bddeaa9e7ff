"""The Helm chart, rendered by helm and held against strict schemas."""

import json
import re
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema_rs
import yaml

ROOT = Path(__file__).parents[2]
CHART = ROOT / "deploy" / "kubernetes"
EXAMPLES = sorted(path.stem for path in (CHART / "examples").glob("*.yaml"))
HELM = ROOT / ".cluster-tools" / "bin" / "helm"
SCHEMAS = ROOT / ".cluster-tools" / "schemas"
#: The oldest that Chart.yaml admits, and the newest with schemas.
KUBERNETES = ("v1.27.0", "v1.37.0")
NAMESPACE = "render"

#: The same as the safe one, and ten times as fast, where PyYAML was built with it.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

Manifest = dict[str, Any]
Find = Callable[[str], Path]


def helm(*arguments: str, fails: bool = False) -> str:
    """What helm prints; on standard error where it has to fail."""
    assert HELM.exists(), "helm is missing: run `make test-cluster PARTS=chart`, which builds it"
    done = subprocess.run(
        [HELM, *arguments], cwd=CHART, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode != 0) == fails, done.stdout + done.stderr
    return done.stderr if fails else done.stdout


@cache
def rendered(example: str) -> list[Manifest]:
    """The objects that helm makes of the chart and the example's values."""
    text = helm(
        *("template", "farm", ".", f"--namespace={NAMESPACE}"),
        *(f"--kube-version={KUBERNETES[-1]}", f"--values=examples/{example}.yaml"),
    )
    return [found for found in yaml.load_all(text, _LOADER) if found]


def of_kind(found: list[Manifest], *kinds: str) -> list[Manifest]:
    """Those of some kinds."""
    return [manifest for manifest in found if manifest["kind"] in kinds]


def named(found: list[Manifest], kind: str, name: str) -> Manifest:
    """The one of this kind and name."""
    [manifest] = [one for one in of_kind(found, kind) if one["metadata"]["name"] == name]
    return manifest


def pods(found: list[Manifest]) -> Iterator[tuple[str, Manifest]]:
    """The name and the pod's specification of each object that starts pods."""
    for manifest in of_kind(found, "Deployment", "StatefulSet", "DaemonSet", "Job", "CronJob"):
        yield manifest["metadata"]["name"], manifest["spec"]["template"]["spec"]


def containers(found: list[Manifest]) -> Iterator[tuple[str, Manifest]]:
    """Each container, those that come first too, and what it is called."""
    for name, pod in pods(found):
        for container in (*pod.get("initContainers", ()), *pod["containers"]):
            yield f"{name}/{container['name']}", container


def errors(manifest: Manifest, version: str) -> list[str]:
    """What is wrong with it, by a schema that knows all fields; none where it is right."""
    found = _validator(manifest["apiVersion"], manifest["kind"], version).iter_errors(manifest)
    return [f"{'/'.join(map(str, error.instance_path))}: {error.message}" for error in found]


@cache
def _validator(api_version: str, kind: str, version: str) -> Any:
    group, _, of_group = api_version.rpartition("/")
    if "." in group and not group.endswith(".k8s.io"):
        return jsonschema_rs.validator_for(_of_crd(group, of_group, kind))
    folder = SCHEMAS / "kubernetes_validate" / "kubernetes-json-schema" / f"{version}-local-strict"
    short = group.partition(".")[0]
    file = folder / "-".join(filter(None, (kind.lower(), short, f"{of_group}.json")))
    assert file.exists(), f"Kubernetes {version} has no {api_version} {kind}"
    return jsonschema_rs.validator_for(
        json.loads(file.read_text()),
        base_uri="file:///schema.json",
        retriever=lambda uri: json.loads((folder / Path(uri).name).read_text()),
    )


def _of_crd(group: str, version: str, kind: str) -> Any:
    """The schema of a custom resource, made strict."""
    for path in SCHEMAS.glob("*.yaml"):
        crd = yaml.load(path.read_text(), _LOADER)
        if crd["spec"]["group"] == group and crd["spec"]["names"]["kind"] == kind:
            [schema] = [
                one["schema"]["openAPIV3Schema"]
                for one in crd["spec"]["versions"]
                if one["name"] == version
            ]
            return _strict({**schema, "required": ["apiVersion", "kind", "metadata", "spec"]}, ())
    raise AssertionError(f"there is no schema of {group} {kind}: run `make test-cluster`")


def _strict(schema: Any, at: tuple[str, ...]) -> Any:
    """The same, where fields that it does not name are wrong; metadata is checked by others."""
    if not isinstance(schema, dict):
        return schema
    changed = {name: _inside(name, value, at) for name, value in schema.items()}
    if schema.get("x-kubernetes-int-or-string"):
        changed.pop("type", None)
    closed = "properties" in schema and not schema.get("x-kubernetes-preserve-unknown-fields")
    if closed and "additionalProperties" not in schema and at != ("metadata",):
        changed["additionalProperties"] = False
    return changed


def _inside(name: str, value: Any, at: tuple[str, ...]) -> Any:
    if name == "properties":
        return {field: _strict(inner, (*at, field)) for field, inner in value.items()}
    return _strict(value, (*at, name)) if name in {"items", "additionalProperties"} else value


#: Values that are maps of the user's own.
MAPS = re.compile(
    r"settings|sceneRoots|workers|workerDefaults\.(environment|affinity)|.*\.(annotations|nodeSelector|labels)"
    r"|.*\.resources"
)
