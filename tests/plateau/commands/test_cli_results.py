"""Commands that fetch what a job has come to, and name jobs by the beginning of their ids."""

import json
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path

import pytest
import redis

from plateau.client import BadId, Client
from plateau.commands.listing import WORKER_COLUMNS, worker_row
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.states import JobState
from plateau.farm.model.worker import Worker
from plateau.farm.redis import keys
from plateau.farm.wire.job_text import share_of
from plateau.service.api.process import listen
from tests.support.farms.ledger_farm import about, live_on
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import plateau
from tests.support.scenes.bundles import scene

pytestmark = pytest.mark.usefixtures("_service")


@pytest.fixture
def job(client: redis.Redis) -> Iterator[StagedJob]:
    """A rendering job with two points of its curve."""
    job = StagedJob(client)
    job.commit(8)
    job.point(100, 5)
    job.point(200, 9, slope=0.5)
    return job


class TestCurve:
    def test_is_lines_or_csv_or_json(self, job: StagedJob, plateau_client: Client) -> None:
        code, out, _ = plateau("show", "--curve", job.id)
        assert code == 0
        assert [line.split()[0] for line in out.splitlines()] == ["100", "200"]
        assert "changed 9 px (1.2 %)  slope 0.5 px/spp" in out
        assert plateau("show", job.id, "--csv")[1] == plateau_client.curve_csv(job.id)
        points = json.loads(plateau("show", "--curve", job.id, "--json")[1])
        assert [point["visible_pixels"] for point in points] == [5, 9]
        code, _, err = plateau("show", job.id, "--json", "--csv")
        assert (code, "choose one" in err) == (2, True)

    def test_that_has_no_point_yet_says_when_it_will(self, client: redis.Redis) -> None:
        new = StagedJob(client, step=50)
        none = "the curve has no point yet: the first comes at 50 spp\n"
        assert plateau("show", "--curve", new.id) == (0, "", none)
        assert plateau("show", "--curve", new.id, "--json") == (0, "[]\n", "")


class TestShow:
    """How long a job has taken by now, and for how long it will go on."""

    def test_tells_of_a_job_that_runs(self, client: redis.Redis) -> None:
        job = StagedJob(client, rule={"name": "visible"})
        job.commit(8)
        job.point(200, 9, expected_spp=1000)
        # Given that it was submitted 100 s ago, and has rendered for 50 s up to its only point
        created = moments(client, job, created=-100, started=-50)
        client.hset(keys.job(job.id), "latest_at", created + 100_000)
        minutes, seconds = re.findall(r"\d+", shown(job)["time"].partition(";")[0])
        assert 100 <= 60 * int(minutes) + int(seconds) < 400
        # Then the 800 spp to come take four times as long as the first 200
        assert shown(job)["to come"] == "about 3 min left, forecast 1,000 spp"
        # And 100 spp later, half a step further, less
        job.commit(4)
        assert shown(job)["to come"] == "about 3 min left, forecast 1,000 spp"
        job.commit(20)
        assert shown(job)["to come"] == "about 50 s left, forecast 1,000 spp"

    def test_tells_at_most_where_nothing_is_forecast(self, client: redis.Redis) -> None:
        job = StagedJob(client, max_spp=1000, rule={"name": "reverse"})
        job.commit(20)
        moments(client, job, created=-40_000, started=-36_000)
        assert shown(job)["to come"] == "at most 10 h left"
        client.hset(keys.job(job.id), "state", "paused")
        assert "to come" not in shown(job)

    def test_a_list_says_the_same(self, client: redis.Redis) -> None:
        job = StagedJob(client)
        job.commit()
        moments(client, job, created=-3661, started=-50)
        assert plateau("list")[1].split("\t")[4] == "1 h 01 min"


def shown(job: StagedJob) -> dict[str, str]:
    """The lines of what is shown of the job, by their names."""
    return dict(re.findall(r"^([a-z ]+): +(.+)$", plateau("show", job.id)[1], re.MULTILINE))


def moments(client: redis.Redis, job: StagedJob, **ago_s: float) -> float:
    """Move the job's times in the past; returns its creation in ms."""
    seconds, micros = client.time()
    now = seconds * 1000 + micros / 1000
    client.hset(
        keys.job(job.id), mapping={f"{what}_at": now + 1000 * s for what, s in ago_s.items()}
    )
    return now + 1000 * ago_s["created"]


def test_fetch_takes_what_there_is_of_a_job_that_runs(
    job: StagedJob, store: Blobs, tmp_path: Path
) -> None:
    job.picture(store, "image.png", b"a picture")
    out = tmp_path / "out"
    code, said, _ = plateau("fetch", job.id, "-o", str(out))
    assert code == 0
    written = {Path(line).name for line in said.splitlines()}
    assert written == {"image.png", "curve.csv", "curve.svg", "summary.txt", "summary.json"}
    assert (out / "image.png").read_bytes() == b"a picture"
    about = json.loads(plateau("fetch", job.id, "-o", str(out), "--json")[1])
    assert (about["state"], len(about["files"])) == ("rendering", 5)


def test_watch_streams_events_as_lines_of_json(job: StagedJob) -> None:
    job.end(JobState.CANCELLED, "cancelled by a user")
    job.finish(200)
    code, out, err = plateau("watch", job.id, "--events")
    assert (code, err) == (4, "")
    events = [json.loads(line) for line in out.splitlines()]
    last = [event["type"] for event in events][-5:]
    assert last == ["point", "point", "state", "image", "finished"]
    assert events[-4]["data"]["visible_pixels"] == 9
    for more in (["--json"], ["-o", "out"]):
        code, _, err = plateau("watch", job.id, "--events", *more)
        assert (code, "--events cannot be combined" in err) == (2, True)


class TestFarm:
    def test_scenes_are_listed(self, plateau_client: Client, tmp_path: Path) -> None:
        assert plateau("list", "scenes") == (0, "", "no scene is stored\n")
        assert plateau("list", "scenes", "--json") == (0, "[]\n", "")
        path = tmp_path / "box.xml"
        path.write_bytes(scene())
        sha256 = plateau_client.submit(path).scene_sha256
        row = plateau("list", "scenes")[1].rstrip("\n").split("\t")
        assert row[:2] == [sha256, "box.xml"]
        assert json.loads(plateau("list", "scenes", "--json")[1])[0]["sha256"] == sha256

    def test_memory_in_use_keeps_its_unit_where_that_differs(self) -> None:
        assert share_of(812e6, 33.6e9) == "812.0 MB of 33.6 GB"
        assert share_of(0, 1e9) == "0 bytes of 1.0 GB"

    def test_workers_are_listed(self) -> None:
        code, out, err = plateau("list", "workers")
        assert (code, out) == (0, "")
        assert "plateau worker" in err
        assert plateau("list", "workers", "--json") == (0, "[]\n", "")

    def test_a_worker_is_drained(self, client: redis.Redis) -> None:
        SliceQueue(client, "w-1", 60).heartbeat(about("w-1"), ())
        live_on(client, "w-1")
        assert plateau("drain", "w-1") == (0, "w-1 drained\n", "")
        assert json.loads(plateau("drain", "w-1", "--json")[1])["drained"]
        assert plateau("drain", "w-1", "--undo") == (0, "w-1 takes slices\n", "")
        code, _, err = plateau("drain", "w-2")
        assert (code, "there is no worker 'w-2'" in err) == (1, True)

    def test_a_worker_is_a_row(self) -> None:
        now = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
        worker = Worker(
            id="vm-1-a",
            host="vm",
            pid=1,
            variants=("llvm_ad_rgb", "scalar_rgb"),
            threads=8,
            job="3b52dbb3a017",
            slice=16,
            slices_done=12,
            samples_per_s=2.7e6,
            plateau="0.1.0",
            last_error="slice 3: SIGSEGV",
            started_at=now.replace(hour=11),
            seen_at=now,
            machine={
                "cores": 8,
                "load": 0.934,
                "memory_bytes": 33.6e9,
                "memory_used_bytes": 9.1e9,
                "disk_bytes": 250e9,
                "disk_free_bytes": 812e6,
                "temperature_c": 71.5,
            },
            core_hours=0.25,
        )
        shown = dict(zip(WORKER_COLUMNS, worker_row(worker, now), strict=True))
        assert shown == {
            "id": "vm-1-a",
            "host": "vm",
            "variant": "llvm_ad_rgb",
            "threads": "8",
            "pool": "default",
            "renders": "3b52dbb3a017/16",
            "rate": "2.70 Msamples/s",
            "done": "12",
            "load": "93.4 %",
            "memory": "9.1 of 33.6 GB",
            "disk free": "812.0 MB",
            "°C": "72",
            "core hours": "0.25",
            "up": "1 h 00 min",
            "version": "0.1.0",
            "trouble": "slice 3: SIGSEGV",
        }


@pytest.fixture
def plateau_client(plateau: Client) -> Client:
    return plateau


class TestShortIds:
    def test_that_several_jobs_have_do_nothing(
        self, client: redis.Redis, plateau_client: Client, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        jobs = [plateau_client.job(StagedJob(client).id) for _ in range(2)]
        alike = [
            job.model_copy(update={"id": f"abcd0000000{number}"}) for number, job in enumerate(jobs)
        ]
        monkeypatch.setattr(plateau_client, "all_jobs", lambda **_: iter(alike))
        with pytest.raises(BadId, match="abcd may be abcd00000000, abcd00000001: give more"):
            plateau_client.whole_id("abcd")
        assert plateau_client.whole_id("abcd00000001") == "abcd00000001"

    @pytest.mark.parametrize("given", ["abc", "nope", "../jobs", "0123456789ab", "abcdefg"])
    def test_other_words_are_left_to_the_service(self, given: str) -> None:
        code, _, err = plateau("show", given)
        assert code == 1
        assert err.startswith(f"plateau: there is no job {given!r}; `plateau list`") or given == (
            "../jobs"
        )


class TestErrorsSayWhatToDo:
    @pytest.mark.parametrize("command", ["show", "log", "cancel", "show --curve", "fetch", "watch"])
    def test_of_a_job_that_is_not_there(self, command: str) -> None:
        code, out, err = plateau(*command.split(), "0123456789ab")
        assert (code, out) == (1, "")
        said = "there is no job '0123456789ab'; `plateau list` shows the jobs"
        assert err == f"plateau: {said}\n"

    @pytest.mark.parametrize(
        ("command", "words"),
        [
            ("list workers --state rendering", "choose jobs, not workers"),
            ("show", "give the id of a job, or --batch NAME"),
            ("show --batch walk --curve", "show one job, not a batch"),
            ("show 0123456789ab --frames", "--frames shows a shot: give --batch NAME"),
        ],
    )
    def test_of_options_that_do_not_fit(self, command: str, words: str) -> None:
        code, _, err = plateau(*command.split())
        assert (code, words in " ".join(err.split())) == (2, True)

    @pytest.mark.parametrize(
        "command", ["list", "list workers", "list scenes", "show x", "submit scenes:box"]
    )
    def test_of_a_service_that_is_not_there(self, command: str) -> None:
        with listen("127.0.0.1", 0) as silent:  # it is nobody else's port, and nobody listens
            port = silent.getsockname()[1]
            code, _, err = plateau(*command.split(), "--url", f"http://127.0.0.1:{port}")
        assert code == 1
        assert "start one with `plateau up`, or name it by --url or PLATEAU_URL" in err
        assert len(err.splitlines()) == 1

    def test_of_a_file_that_cannot_be_written(self, job: StagedJob, tmp_path: Path) -> None:
        (tmp_path / "out").write_text("a file, where a folder should be")
        code, _, err = plateau("fetch", job.id, "-o", str(tmp_path / "out"))
        file = tmp_path / "out"
        told = f"plateau: -o needs a folder, and {file} is a file: name another one\n"
        assert (code, err) == (1, told)
        # And where it is a folder above that is none
        code, _, err = plateau("render", "scenes:box", "-o", str(file / "of" / "today"))
        assert (code, err) == (1, told)

    def test_of_a_disk_that_takes_no_more(self, api: str, job: StagedJob, tmp_path: Path) -> None:
        out = tmp_path / "out"
        # It takes what is tried before anything is fetched, but no report
        done = subprocess.run(
            [sys.executable, "-m", "plateau", "fetch", job.id, "-o", str(out), "--url", api],
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)),
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (1, f"plateau: {out}: File too large\n")
        assert list(out.iterdir()) == []

    def test_of_a_job_that_is_not_there_before_its_folder_is(self, tmp_path: Path) -> None:
        code, _, err = plateau("watch", "0123456789ab", "-o", str(tmp_path / "out"))
        assert (code, "there is no job '0123456789ab'" in err) == (1, True)
        assert not (tmp_path / "out").exists()

    def test_of_a_file_that_cannot_be_written_before_the_job_is_watched(
        self, job: StagedJob, tmp_path: Path
    ) -> None:
        (tmp_path / "summary.txt").mkdir()
        # The job never ends: to watch it would be for ever
        code, _, err = plateau("watch", job.id, "-o", str(tmp_path))
        assert (code, f"{tmp_path / 'summary.txt'} is a folder" in err) == (1, True)
        for watched in ([job.id], ["--batch", "walk"]):
            code, _, err = plateau("watch", *watched, "-o", "/proc")
            assert (code, "cannot write into /proc" in err) == (1, True)
