"""The Helm chart renders, and what it renders is what Kubernetes, KEDA and Prometheus know."""

import copy
import json
from typing import Any

import pytest
import yaml

from tests.cluster import support_chart as chart
from tests.cluster.support_chart import EXAMPLES, KUBERNETES, Manifest


@pytest.mark.parametrize("example", EXAMPLES)
def test_helm_finds_nothing_to_complain_of(example: str) -> None:
    said = chart.helm("lint", ".", "--strict", "--quiet", f"--values=examples/{example}.yaml")
    assert "ERROR" not in said
    assert "WARNING" not in said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("keda.enabeld=false", "additional properties 'enabeld' not allowed"),
        ("workers.cpu.variants={vulkan}", "value must be one of 'cuda_ad_mono'"),
        ("workers.Big_One.max=3", "'Big_One' does not match pattern"),
        ("settings.PLATEAU_BLOBS=/tmp", "'not' failed"),
        ("redis.enabled=false", "redis.existingSecret: name the Secret with the URL"),
        ("blobs.s3.url=s3://b/p", "blobs.s3.existingSecret: name the Secret with"),
        ("api.ingress.enabled=true", "api.ingress.host: say under which name"),
        ("workerDefaults.resources.limits.cpu=null", "missing property 'cpu'"),
    ],
)
def test_helm_refuses_values_that_make_no_farm(given: str, words: str) -> None:
    version = f"--kube-version={KUBERNETES[-1]}"
    assert words in chart.helm("template", ".", version, "--set", given, fails=True)


class TestStrictSchemas:
    @pytest.mark.parametrize("version", KUBERNETES)
    def test_know_every_field(self, found: list[Manifest], version: str) -> None:
        wrong = {
            f"{one['kind']} {one['metadata']['name']}": chart.errors(one, version) for one in found
        }
        assert not {name: why for name, why in wrong.items() if why}

    @pytest.mark.parametrize(
        ("kind", "path", "value", "words"),
        [
            ("Deployment", "spec/template/spec/securityContxt", {}, "'securityContxt' was unexp"),
            ("NetworkPolicy", "spec/ingres", [], "'ingres' was unexpected"),
            ("ScaledObject", "spec/triggers/0/metadat", {}, "'metadat' was unexpected"),
            ("ScaledObject", "spec/maxReplicaCount", "ten", 'is not of type "integer"'),
            ("TriggerAuthentication", "spec/secretTargetRef/0/nme", "k", "'nme' was unexpected"),
        ],
    )
    def test_find_a_planted_error(self, kind: str, path: str, value: object, words: str) -> None:
        manifest = copy.deepcopy(chart.of_kind(chart.rendered("full"), kind)[0])
        *way, last = path.split("/")
        inner: Any = manifest
        for step in way:
            inner = inner[int(step) if step.isdigit() else step]
        inner[last] = value
        [error] = chart.errors(manifest, KUBERNETES[-1])
        assert words in error

    def test_find_what_is_missing(self) -> None:
        manifest = copy.deepcopy(chart.of_kind(chart.rendered("full"), "ScaledObject")[0])
        del manifest["spec"]["scaleTargetRef"]
        [error] = chart.errors(manifest, KUBERNETES[-1])
        assert '"scaleTargetRef" is a required property' in error


def test_a_trigger_says_what_its_scaler_of_keda_knows() -> None:
    scalers = json.loads((chart.SCHEMAS / "scalers-schema.json").read_text())["scalers"]
    found = chart.rendered("full")
    triggers = [one["spec"]["triggers"] for one in chart.of_kind(found, "ScaledObject")]
    for trigger in (trigger for these in triggers for trigger in these):
        [scaler] = [one for one in scalers if one["type"] == trigger["type"]]
        known = {one["name"]: one for one in scaler["parameters"]}
        assert trigger["metadata"].keys() <= known.keys()
        for name, value in trigger["metadata"].items():
            assert isinstance(value, str)
            assert value in known[name].get("allowedValue", [value])
        name = trigger["authenticationRef"]["name"]
        [secret] = chart.named(found, "TriggerAuthentication", name)["spec"]["secretTargetRef"]
        assert known[secret["parameter"]]["triggerAuthenticationVariableReadable"]


def test_a_copy_of_the_chart_has_all_of_it() -> None:
    links = [path for path in chart.CHART.rglob("*") if path.is_symlink()]
    assert links == []


def test_values_have_a_schema_that_knows_no_others() -> None:
    schema = json.loads((chart.CHART / "values.schema.json").read_text())
    values = yaml.safe_load((chart.CHART / "values.yaml").read_text())
    assert _unlike(values, schema) == []


def _unlike(values: dict[str, Any], schema: dict[str, Any], above: str = "") -> list[str]:
    """Where values and schema have not the same names."""
    known = schema.get("properties", {})
    if not known or chart.MAPS.fullmatch(above.rstrip(".")):
        return []
    wrong = [f"{above}{name}" for name in values.keys() ^ known.keys() - {"global"}]
    assert schema["additionalProperties"] is False
    for name in values.keys() & known.keys():
        if isinstance(values[name], dict):
            wrong += _unlike(values[name], known[name], f"{above}{name}.")
    return wrong
