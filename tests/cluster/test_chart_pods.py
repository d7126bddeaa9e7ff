"""What the chart's pods may do, are told, and whom they may talk to."""

import hashlib
import os
import re
from typing import Any

import pytest
import typer.main

from plateau.commands import app
from plateau.farm.model.scene_roots import read_roots
from plateau.farm.process.settings import Settings
from tests.cluster import support_chart as chart
from tests.cluster.support_chart import Manifest

#: What the environment of a process says beside Plateau's own settings, and who reads it.
FOREIGN = {
    "AWS_ACCESS_KEY_ID": "obstore",
    "AWS_SECRET_ACCESS_KEY": "obstore",
    "AWS_REGION": "obstore",
    "AWS_ENDPOINT_URL": "obstore",
    "AWS_ALLOW_HTTP": "obstore",
    "NUMBA_CACHE_DIR": "numba: where compiled kernels are kept",
    "NVIDIA_DRIVER_CAPABILITIES": "NVIDIA's container runtime",
}


class TestEveryPod:
    """By the restricted Pod Security Standard, and a read-only root filesystem beyond it."""

    def test_is_nobody(self, found: list[Manifest]) -> None:
        for name, pod in chart.pods(found):
            context = pod["securityContext"]
            assert context["runAsNonRoot"] is True, name
            assert context["runAsUser"] > 0, name
            assert context["runAsGroup"] > 0, name
            assert context["seccompProfile"] == {"type": "RuntimeDefault"}, name
            assert pod["automountServiceAccountToken"] is False, name
            assert pod["enableServiceLinks"] is False, name
            assert not {"hostNetwork", "hostPID", "hostIPC"} & pod.keys(), name
            kinds = {kind for volume in pod["volumes"] for kind in volume.keys() - {"name"}}
            assert kinds <= {"emptyDir", "persistentVolumeClaim", "secret", "configMap"}, name

    def test_can_neither_rise_nor_write_where_it_should_not(self, found: list[Manifest]) -> None:
        for name, container in chart.containers(found):
            assert container["securityContext"] == {
                "allowPrivilegeEscalation": False,
                "readOnlyRootFilesystem": True,
                "capabilities": {"drop": ["ALL"]},
            }, name

    def test_has_bounds(self, found: list[Manifest]) -> None:
        for name, container in chart.containers(found):
            assert {"cpu", "memory"} <= container["resources"]["requests"].keys(), name
            assert "memory" in container["resources"]["limits"], name
        for name, pod in chart.pods(found):
            for volume in pod["volumes"]:
                if "emptyDir" in volume:
                    assert volume["emptyDir"]["sizeLimit"], name

    def test_is_probed_and_has_time_to_end(self, found: list[Manifest]) -> None:
        for name, pod in chart.pods(found):
            assert pod["terminationGracePeriodSeconds"] >= 30, name
            for container in pod["containers"]:
                assert {"startupProbe", "livenessProbe", "readinessProbe"} <= container.keys(), name

    def test_mounts_what_it_names(self, found: list[Manifest]) -> None:
        for _, pod in chart.pods(found):
            given = {volume["name"] for volume in pod["volumes"]}
            given |= {"data"} if "redis-server" in str(pod) else set()  # by the StatefulSet
            every = (*pod.get("initContainers", ()), *pod["containers"])
            assert {mount["name"] for one in every for mount in one["volumeMounts"]} == given

    def test_has_a_budget_but_redis(self, found: list[Manifest]) -> None:
        covered = [
            one["spec"]["selector"]["matchLabels"]
            for one in chart.of_kind(found, "PodDisruptionBudget")
        ]
        for one in chart.of_kind(found, "Deployment"):
            assert one["spec"]["selector"]["matchLabels"] in covered


def test_targets_of_notifications_are_mounted_where_they_are_named_and_used() -> None:
    for name, pod in chart.pods(chart.rendered("external")):
        volumes = {one["name"]: one for one in pod["volumes"]}
        is_told = name.endswith(("-api", "-monitor"))
        assert ("notify" in volumes) == is_told, name
        if is_told:
            assert volumes["notify"]["secret"]["secretName"] == "farm-notify"
            [container] = pod["containers"]
            [file] = [one for one in container["env"] if one["name"] == "PLATEAU_NOTIFY_FILE"]
            [mount] = [one for one in container["volumeMounts"] if one["name"] == "notify"]
            assert file["value"] == f"{mount['mountPath']}/targets"


def test_scene_roots_are_mounted_to_be_read_where_scenes_are_read() -> None:
    found = chart.rendered("full")
    for name, pod in chart.pods(found):
        mounts = {
            mount["mountPath"]: mount.get("readOnly")
            for mount in pod["containers"][0].get("volumeMounts", ())
            if mount["mountPath"].startswith("/scenes/")
        }
        told = [
            one["value"]
            for one in pod["containers"][0].get("env", ())
            if one["name"] == "PLATEAU_SCENE_ROOTS"
        ]
        if "monitor" in name or "redis" in name:
            assert not mounts
            assert not told
        else:
            [roots] = map(read_roots, told)
            assert mounts == {str(root.path): True for root in roots}
            assert roots[0].elsewhere == ("/Volumes/assets", "Z:/assets")


class TestEveryProcess:
    def test_is_told_nothing_that_nobody_reads(self, found: list[Manifest]) -> None:
        settings = {f"PLATEAU_{name.upper()}" for name in Settings.model_fields}
        told = [
            (name, one["name"]) for name, c in chart.containers(found) for one in c.get("env", ())
        ]
        assert told
        for name, variable in told:
            assert variable in settings | FOREIGN.keys(), name
        for name, container in chart.containers(found):
            variables = [one["name"] for one in container.get("env", ())]
            assert len(variables) == len(set(variables)), name

    def test_is_told_values_that_settings_take(
        self, found: list[Manifest], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name in [name for name in os.environ if name.startswith("PLATEAU_")]:
            monkeypatch.delenv(name)
        for _, container in chart.containers(found):
            with monkeypatch.context() as environment:
                for one in container.get("env", ()):
                    environment.setenv(one["name"], one.get("value", "2"))
                Settings()

    def test_is_a_command_with_options_that_there_are(self, found: list[Manifest]) -> None:
        for name, container in chart.containers(found):
            if "redis" in name:
                assert container["command"] == ["redis-server", "/etc/redis/redis.conf"]
            else:
                assert parsed(_without_files(container["args"])), name

    def test_finds_its_secrets(self, found: list[Manifest]) -> None:
        made = {
            one["metadata"]["name"]: one["stringData"] for one in chart.of_kind(found, "Secret")
        }
        asked = [
            one["valueFrom"]["secretKeyRef"]
            for _, container in chart.containers(found)
            for one in container.get("env", ())
            if "secretKeyRef" in one.get("valueFrom", {})
        ]
        assert asked
        for secret in asked:
            assert not made or secret["key"] in made[secret["name"]]

    def test_is_the_user_of_redis_that_may_do_what_it_does_and_no_more(
        self, found: list[Manifest]
    ) -> None:
        for name, container in chart.containers(found):
            for one in container.get("env", ()):
                if one["name"] == "PLATEAU_REDIS_URL":
                    role = re.search(r"key|api|monitor|worker", name.removeprefix("farm-plateau-"))
                    assert role is not None
                    user = "admin" if "/key-" in name else role[0]
                    assert one["valueFrom"]["secretKeyRef"]["key"] == f"{user}-url"


def _without_files(arguments: list[str]) -> list[str]:
    """The same with a file that is here for those that are mounted there."""
    return [__file__ if word.startswith("/etc/plateau/") else word for word in arguments]


def parsed(arguments: list[str]) -> dict[str, Any]:
    """The command that is run, and its options as it would take them; raises where it would not."""
    command: Any = typer.main.get_command(app)
    name, rest = "", list(arguments)
    while hasattr(command, "commands"):
        name = rest.pop(0)
        command = command.commands[name]
    return {"command": name, **command.make_context(name, rest, resilient_parsing=False).params}


def test_a_first_try_fits_a_small_machine() -> None:
    found = chart.rendered("minimal")
    asked = {"cpu": 0.0, "memory": 0.0}
    for one in chart.of_kind(found, "Deployment", "StatefulSet"):
        for container in one["spec"]["template"]["spec"]["containers"]:
            for what in asked:
                amount = _amount(container["resources"]["requests"][what])
                asked[what] += one["spec"]["replicas"] * amount
    assert asked["cpu"] <= 2
    assert asked["memory"] <= 4 * 2**30


def _amount(quantity: str) -> float:
    """A quantity as Kubernetes writes it: cores or bytes."""
    written = re.fullmatch(r"([\d.]+)(m|Mi|Gi|)", quantity)
    assert written is not None
    return float(written[1]) * {"m": 1e-3, "Mi": 2**20, "Gi": 2**30, "": 1}[written[2]]


class TestRedis:
    def test_loses_nothing_that_it_has_acknowledged(self) -> None:
        found = chart.rendered("minimal")
        [config] = chart.of_kind(found, "ConfigMap")
        lines = config["data"]["redis.conf"].splitlines()
        assert {"appendonly yes", "appendfsync always", "maxmemory-policy noeviction"} <= set(lines)
        assert 'save ""' in lines  # its log has all: a snapshot beside it costs memory and disk
        [redis] = chart.of_kind(found, "StatefulSet")
        [claim] = redis["spec"]["volumeClaimTemplates"]
        [mount] = [
            one["mountPath"]
            for one in redis["spec"]["template"]["spec"]["containers"][0]["volumeMounts"]
            if one["name"] == claim["metadata"]["name"]
        ]
        assert f"dir {mount}" in lines

    def test_starts_again_when_its_users_may_do_something_else(self) -> None:
        [redis] = chart.of_kind(chart.rendered("minimal"), "StatefulSet")
        annotations = redis["spec"]["template"]["metadata"]["annotations"]
        users = (chart.CHART / "files" / "users.acl").read_bytes()
        assert annotations == {"checksum/users": hashlib.sha256(users).hexdigest()}

    def test_of_your_own_leaves_nothing_of_it_here(self) -> None:
        found = chart.rendered("external")
        assert not chart.of_kind(
            found, "StatefulSet", "ConfigMap", "Secret", "PersistentVolumeClaim"
        )


def test_workers_may_have_a_key_of_their_own_to_the_store() -> None:
    secrets = {
        name: {
            one["valueFrom"]["secretKeyRef"]["name"]
            for one in container["env"]
            if one["name"].startswith("AWS_") and "valueFrom" in one
        }
        for name, container in chart.containers(chart.rendered("external"))
    }
    workers = {name for name in secrets if "-worker-" in name}
    assert workers
    for name, found in secrets.items():
        assert found == {"farm-s3-workers" if name in workers else "farm-s3"}


class TestPools:
    def test_are_scaled_by_what_their_workers_can_render(self) -> None:
        found = chart.rendered("gpu")
        asked = {
            one["metadata"]["name"]: one["spec"]["triggers"][0]["metadata"]["url"].partition("?")[2]
            for one in chart.of_kind(found, "ScaledObject")
        }
        assert asked == {
            "farm-plateau-worker-cpu": "pool=default&tag=&variant=llvm_ad_rgb&variant=scalar_rgb",
            "farm-plateau-worker-gpu": "pool=default&tag=gpu&variant=cuda_ad_rgb"
            "&variant=llvm_ad_rgb&variant=scalar_rgb",
        }

    def test_leave_the_number_of_workers_to_keda(self, found: list[Manifest]) -> None:
        scaled = {
            one["spec"]["scaleTargetRef"]["name"] for one in chart.of_kind(found, "ScaledObject")
        }
        workers = [
            one
            for one in chart.of_kind(found, "Deployment")
            if "-worker-" in one["metadata"]["name"]
        ]
        assert workers
        for worker in workers:
            assert ("replicas" in worker["spec"]) != (worker["metadata"]["name"] in scaled)

    def test_say_what_differs_from_the_defaults(self) -> None:
        found = chart.rendered("gpu")
        [gpu] = [pod for name, pod in chart.pods(found) if name.endswith("worker-gpu")]
        assert gpu["containers"][0]["resources"]["limits"]["nvidia.com/gpu"] == 1
        assert gpu["runtimeClassName"] == "nvidia"
        told = {one["name"]: one.get("value") for one in gpu["containers"][0]["env"]}
        assert (told["PLATEAU_TAGS"], told["PLATEAU_POOL"]) == ("gpu", "default")
        # And a pool that is null is none
        names = [name for name, _ in chart.pods(chart.rendered("full"))]
        assert {name for name in names if "worker" in name} == {
            "farm-plateau-worker-small",
            "farm-plateau-worker-film",
        }

    def test_render_with_as_many_threads_as_they_may_have_cores(self) -> None:
        found = chart.rendered("full")
        threads = {
            name: [one for one in pod["containers"][0]["env"] if one["name"] == "PLATEAU_THREADS"]
            for name, pod in chart.pods(found)
            if "worker" in name
        }
        assert threads["farm-plateau-worker-small"] == [{"name": "PLATEAU_THREADS", "value": "2"}]
        [film] = threads["farm-plateau-worker-film"]
        assert film["valueFrom"]["resourceFieldRef"] == {"resource": "limits.cpu", "divisor": "1"}

    def test_keep_their_render_children_below_their_memory(self, found: list[Manifest]) -> None:
        for name, container in chart.containers(found):
            told = {one["name"]: one.get("value") for one in container.get("env", ())}
            if "PLATEAU_CHILD_MEMORY_GB" in told:
                gib = re.fullmatch(r"(\d+)Gi", container["resources"]["limits"]["memory"])
                assert gib is not None
                assert float(told["PLATEAU_CHILD_MEMORY_GB"]) * 1e9 < 0.8 * int(gib[1]) * 2**30, (
                    name
                )
