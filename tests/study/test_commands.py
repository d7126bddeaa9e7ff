"""`plateau study create | list | export | delete`: studies from the command line."""

import json
from functools import partial
from pathlib import Path

import pytest
import redis

from plateau.client import ApiError, Client
from plateau.commands import meet_extensions
from plateau.errors import CommandFailed
from plateau.farm.model.job import CurvePoint, WatchedValue
from plateau.farm.wire import examples
from plateau.farm.wire.views import JobView
from plateau.study.client import StudyCalls
from plateau.study.commands import levels_at_stops
from plateau.study.model import Screen
from tests.support.farms.live_api import live_api
from tests.support.farms.noise_farm import NoiseFarm
from tests.support.farms.studies import SCREEN, ended_job, sees
from tests.support.processes.commands import plateau as command

meet_extensions()

plateau = partial(command, "study")


def test_a_study_from_the_command_line(
    client: redis.Redis, redis_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    farm = NoiseFarm(client, redis_url, tmp_path)
    job = ended_job(farm, slices=8, slice_spp=10)
    truth = ended_job(farm, slices=10, slice_spp=20, seed=1)
    with live_api(redis_url, farm.store) as url, Client(url) as service:
        monkeypatch.setenv("PLATEAU_URL", url)
        assert "there are no studies" in plateau("list")[2]
        levels = ("--level", "10", "--level", "40", "--level", "80")
        code, out, said = plateau("create", job.id[:8], "--reference", truth.id[:8], *levels)
        assert code == 0
        study_id = out.strip()
        assert said == f"plateau: observers go to {url}/studies/{study_id}/observe\n"
        # One that is made of its own reference is warned of
        code, out, said = plateau("create", job.id, "--method", "limits", *levels, "--json")
        assert json.loads(out)["method"] == "limits"
        assert "name a job with another seed" in plateau("create", job.id, *levels)[2]
        # One of where rules disagree needs rules that do
        code, _, said = plateau("create", job.id, "--at-stops")
        assert (code, "do not disagree: its curve has no point; watch" in said) == (1, True)
        assert plateau("create", job.id, "--at-stops", *levels)[0] == 2

        for name in ("o-1", "o-2", "o-3", "o-4", "o-5"):
            observer = StudyCalls(service).take_part(study_id, name, Screen.model_validate(SCREEN))
            for trial in observer.trials:
                test = trial.left if trial.reference == "right" else trial.right
                spp = int(test.rpartition("/")[2].removesuffix(".png"))
                seen = sees(name, spp, trial.reference, threshold=40, spread=12)
                StudyCalls(service).answer(study_id, name, trial.trial, seen=seen, seconds=1)
        listed = plateau("list")[1].splitlines()
        assert len(listed) == 3
        row = [study_id, "noise", "constant", "10–80 spp", "5 of 5", "30"]
        assert listed[-1].split("\t")[:6] == row

        trials = tmp_path / "trials.csv"
        assert plateau("export", study_id, "-o", str(trials)) == (0, "", "")
        assert trials.read_text() == plateau("export", study_id)[1]
        assert trials.read_text().count("\n") == 31
        assert json.loads(plateau("export", study_id, "--json")[1])["result"]["answers"] == 30
        fitted = plateau("fit", str(trials))[1].splitlines()
        assert fitted[0].split()[:3] == ["scene", "answers", "observers"]
        assert fitted[1].split()[:3] == ["noise", "30", "5"]

        assert plateau("delete", study_id) == (0, "", "")
        code, _, said = plateau("export", study_id)
        assert (code, said.count("\n")) == (1, 1)
        with pytest.raises(ApiError, match="there is no study"):
            StudyCalls(service).get(study_id)


class TestLevelsAtStops:
    def levels(self, visible: int, jod: int) -> list[int]:
        job = JobView.model_validate(examples.JOB)
        spec = job.spec.model_copy(update={"slice_spp": 10})
        job = job.model_copy(update={"spec": spec, "committed_spp": 900})
        points = [
            CurvePoint(
                spp=spp,
                visible_pixels=0,
                visible_fraction=0,
                slope=None,
                estimate_pixels=None,
                estimate_fraction=None,
                rules={
                    "visible": WatchedValue(value=1.0, stop=spp >= visible),
                    "jod": WatchedValue(value=1.0, stop=spp >= jod),
                },
                at=job.created_at,
            )
            for spp in range(100, 1000, 100)
        ]
        return levels_at_stops(job, points)

    def test_are_at_and_around_the_stops_of_rules_that_disagree(self) -> None:
        assert self.levels(visible=200, jod=400) == [100, 200, 280, 400, 800]
        # As far as there are samples
        assert self.levels(visible=800, jod=200) == [100, 200, 400, 800]

    @pytest.mark.parametrize(
        ("jod", "says"), [(300, "jod stopped at 300 spp, visible"), (9999, "jod never stopped")]
    )
    def test_of_rules_that_agree_are_refused(self, jod: int, says: str) -> None:
        with pytest.raises(CommandFailed, match=says):
            self.levels(visible=300, jod=jod)
