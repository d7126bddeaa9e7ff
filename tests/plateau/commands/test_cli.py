"""The command line: what it says, and with which code it exits."""

import json
import re
from importlib.metadata import version
from pathlib import Path

import pytest
import redis

from plateau.commands import app
from plateau.commands.options.spec_fields import spec_fields
from plateau.commands.options.spec_options import spec_from_options
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.spec import PLACES, JobSpec
from plateau.farm.model.states import JobState
from plateau.metric import View
from tests.support.farms.staged_job import StagedJob
from tests.support.processes.commands import plateau

COMMANDS = [command.name or command.callback.__name__ for command in app.registered_commands]


def test_a_file_whose_name_has_a_colon_is_a_file(tmp_path: Path) -> None:
    code, _, error = plateau("render", str(tmp_path / "scenes:box"))
    assert (code, "there is no such file" in error) == (1, True)


#: These answer nothing, but for one whose answer is a file of a form of its own.
SILENT = {"up", "api", "monitor", "worker", "redis-acl"}


class TestHelp:
    @pytest.mark.parametrize("command", COMMANDS)
    def test_of_every_command_teaches_with_an_example_and_offers_json(self, command: str) -> None:
        code, out, _ = plateau(command, "--help")
        assert code == 0
        assert re.search(rf"For example:\n +(PLATEAU_\S+ )*plateau {command}", out)
        assert ("--json" in out) is (command not in SILENT)

    def test_lists_the_exit_codes(self) -> None:
        code, out, _ = plateau("--help")
        assert code == 0
        codes = re.findall(r"^    (\d+) ", out, re.MULTILINE)
        assert codes == ["0", "1", "2", "3", "4", "76", "130"]

    def test_of_the_version(self) -> None:
        assert plateau("--version") == (0, f"plateau {version('plateau')}\n", "")


class TestOptions:
    def test_that_are_left_out_have_the_defaults_that_the_help_shows(self) -> None:
        assert spec_from_options() == JobSpec()
        _, out, _ = plateau("submit", "--help")
        shown = dict(re.findall(r"--([\w-]+) <[^\[]*\[default: \((.*?)\)\]", " ".join(out.split())))
        spec = JobSpec()
        assert shown == {
            "step": str(spec.step),
            "slice-spp": str(spec.slice_spp),
            "max-spp": str(spec.max_spp),
            "time-limit": "none",
            "min-spp": "none",
            "name": "as its scene is",
            "rule": spec.rule.name,
            "allocation": spec.allocation.name,
            "denoise": spec.denoise.name,
            "window": "5",
            "epsilon": "0.1",
            "spp": "10000",
            "seed": str(spec.seed),
            "variant": spec.variant,
            "sensor": str(spec.sensor),
            "exr-precision": spec.exr.precision,
            "exr-compression": spec.exr.compression,
            "exposure": f"{spec.view.exposure_ev:g}",
            "white-luminance": f"{spec.view.white_luminance:g}",
            "contrast": f"{spec.view.contrast:g}",
            "ambient-lux": f"{spec.view.ambient_lux:g}",
            "field-of-view": "none",
            "pixels-per-degree": f"{spec.view.pixels_per_degree:g}",
            "primaries": spec.view.primaries,
            "priority": str(spec.priority),
            "pool": spec.pool,
        }
        assert "default: (http://127.0.0.1:8713)" in " ".join(out.split())

    @pytest.mark.usefixtures("_service")
    @pytest.mark.parametrize(
        ("options", "rule"),
        [
            ("--window 8", {"name": "reverse", "window": 8, "epsilon": 0.1}),
            ("--epsilon 0.2", {"name": "reverse", "window": 5, "epsilon": 0.2}),
            ("--spp 50", {"name": "fixed", "spp": 50}),
            ("--rule fixed --spp 50", {"name": "fixed", "spp": 50}),
            ("--rule reverse:window=9 --epsilon 1", {"name": "reverse", "window": 9, "epsilon": 1}),
            ("--rule multiple --window 8", {"name": "multiple", "window": 8, "threshold": 1}),
        ],
    )
    def test_of_one_rule_mean_that_rule(self, box: str, options: str, rule: dict) -> None:
        _, out, _ = plateau("submit", box, *options.split(), "--json")
        assert json.loads(out)["spec"]["rule"] == rule

    def test_make_the_spec(self) -> None:
        spec = spec_from_options(
            define=["width=64", "text=a=b"],
            rule="fixed:spp=50",
            exposure=-1.5,
            primaries="adobe1998",
            time_limit=60,
            aov=["depth", "albedo"],
            exr_precision="half",
            background="0.5,1,0",
        )
        assert spec.parameters == {"width": "64", "text": "a=b"}
        assert spec.rule.model_dump() == {"name": "fixed", "spp": 50}
        assert (spec.view.exposure_ev, spec.view.primaries) == (-1.5, "adobe1998")
        assert spec.time_limit_s == 60
        assert spec.aovs == ("depth", "albedo")
        assert (spec.exr.precision, spec.exr.compression) == ("half", "zip")
        assert spec.view.background == (0.5, 1, 0)

    def test_set_a_place_from_which_the_image_is_seen(self) -> None:
        view = spec_from_options(seen="cinema", contrast=1500).view
        assert (view.pixels_per_degree, view.white_luminance, view.contrast) == (57, 48, 1500)
        # Every place is one that the metric knows, and pixels per degree replace an angle
        for place in PLACES:
            View(**spec_from_options(seen=place).view.of_display())
        assert spec_fields(pixels_per_degree=9)["view"]["field_of_view_deg"] is None

    def test_of_a_preset_count_after_those_that_are_given(self) -> None:
        paper = JobSpec(rule="reverse", allocation="frame", view="paper")
        assert spec_from_options(preset="paper") == paper
        other = spec_from_options(preset="paper", rule="fixed", seen="desk")
        assert other == JobSpec(rule="fixed", allocation="frame", view="desk")

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            (["--min-spp", "300", "--max-spp", "200"], "min_spp must not be above max_spp"),
            (["--step", "-1"], "--step: must be at least 1"),
            (["--exposure", "101"], "--exposure: "),
            (["--field-of-view", "180"], "--field-of-view: "),
            (["--pixels-per-degree", "0"], "--pixels-per-degree: must be at least 0.1"),
            (
                ["--seen", "moon"],
                "--seen takes one of screen, desk, phone, cinema, paper, not 'moon'",
            ),
            (["--seen", "desk", "--field-of-view", "20"], "give one of them"),
            (["--rule", "guess"], "--rule: must be fixed, "),
            (["--rule", ""], "--rule: must be fixed, "),
            (["--watch", "guess"], "--watch: must be fixed, "),
            (["--denoise", "guess"], "--denoise: must be none or oidn"),
            (["--denoise", "oidn:sharp=1"], "--denoise oidn:sharp: there is no such parameter"),
            (["--allocation", "zones:size=17"], "--allocation zones:size: must be a multiple of"),
            (["--name", ""], "--name: must not be empty"),
            (["--step", "many"], "'--step': must be a whole number"),
            (["--rule", "visible:target=2"], "--rule visible:target: must be at most 0.99"),
            (["--rule", "fixed:target=2"], "--rule fixed:target: there is no such"),
            (["--rule", "fixed", "--window", "3"], "--window is not an option of the rule fixed"),
            (
                ["--variant", "cuda"],
                "--variant: must be auto, scalar_rgb, llvm_ad_rgb, cuda_ad_rgb, scalar_spectral, ",
            ),
            (
                ["--aov", "fog"],
                "--aov: must be albedo, normal, depth, position, uv, shape_id or primitive_id",
            ),
            (["--aov", "uv", "--aov", "uv"], "--aov: each AOV may be named once"),
            (["--exr-precision", "double"], "--exr-precision: must be float or half"),
            (["--exr-compression", "dwaa"], "--exr-compression: must be none, rle, zips, zip or"),
            (["--background", "white"], "--background: takes R,G,B, not 'white'"),
            (["--background", "0,0,-1"], "--background: must be at least 0"),
            (["-D", "width"], "NAME=VALUE"),
            (["-D", "=3"], "NAME=VALUE"),
        ],
    )
    def test_that_are_wrong_are_named(self, box: str, options: list[str], words: str) -> None:
        code, _, err = plateau("submit", box, *options)
        assert code == 2
        assert words in " ".join(err.split())

    @pytest.mark.parametrize(
        ("command", "option", "absurd"),
        [
            ("gc", "--results-older-than", "1e300"),
            ("keys create me", "--upload-gb", "1e308"),
            ("keys create me", "--open-jobs", "9" * 30),
        ],
    )
    def test_that_no_clock_and_no_disk_could_hold_are_named(
        self,
        command: str,
        option: str,
        absurd: str,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setenv("PLATEAU_DATA", str(tmp_path))
        code, out, err = plateau(*command.split(), option, absurd)
        assert (code > 0, out, option in err) == (True, "", True)
        assert list(tmp_path.glob("blobs")) == []

    @pytest.mark.parametrize(
        ("command", "names"),
        [
            ("render", "pool require priority batch shot"),
            ("judge", "pool require priority batch shot keep-slices"),
            ("judge", "define time-limit seed variant sensor"),
        ],
    )
    def test_that_would_mean_nothing_are_not_taken(self, command: str, names: str) -> None:
        of_submit = plateau("submit", "--help")[1]
        for name in names.split():
            assert f"--{name}" in of_submit
            code, _, err = plateau(command, "scenes:box", f"--{name}", "1")
            assert (code, f"No such option: --{name}" in " ".join(err.split())) == (2, True)

    def test_may_begin_a_path_at_home(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, box: str
    ) -> None:
        # As a shell leaves them that finds them in quotes, or after a =
        monkeypatch.setenv("HOME", str(tmp_path))
        code, _, error = plateau("judge", "~/box.xml", "--out=~/judged")
        assert (code, f"{box} is not a folder" in error) == (1, True)
        code, _, error = plateau("diff", "~/a.exr", "~/b.exr")
        assert str(tmp_path / "a.exr") in error


@pytest.mark.usefixtures("_service")
class TestTalkingToAService:
    def test_list_is_for_grep_and_cut(self, box: str) -> None:
        called = (("--name", "Kitchen v1.2"), (), ("--slice-spp", "20", "--max-spp", "10"))
        made = [plateau("submit", box, *name)[1].strip() for name in called]
        plateau("cancel", made[0])
        code, out, err = plateau("list")
        assert code == 0
        assert err.splitlines() == [
            f"plateau: job {job} waits for a worker: there is none that takes work"
            for job in made[:0:-1]
        ]
        rows = [line.split("\t") for line in out.splitlines()]
        assert [row[0] for row in rows] == made[::-1]
        assert rows[-1][1:3] == ["cancelled", "0/10000"]
        assert [row[-1] for row in rows] == [*[Path(box).stem] * 2, "Kitchen v1.2"]
        assert plateau("list", "--state", "cancelled")[1].split("\t")[0] == made[0]
        assert len(json.loads(plateau("list", "--limit", "2", "--json")[1])) == 2
        assert "note:       slice_spp is 5 in place of 20" in plateau("show", made[2])[1]
        assert plateau("list", "--batch", "none") == (0, "", "no jobs\n")
        code, _, err = plateau("list", "--state", "happy")
        assert (code, "the states are queued, rendering" in err) == (1, True)

    def test_show_tells_the_story(self, client: redis.Redis, api: str) -> None:
        job = StagedJob(client)
        job.die("the render process was ended by SIGSEGV")
        job.commit()
        job.end(JobState.CONVERGED, "levelled off")
        lines = plateau("show", job.id)[1].splitlines()
        assert f"{api}/v1/jobs/{job.id}/image.png" in " ".join(lines)
        story = lines[lines.index("story:") + 1 : lines.index("links:")]
        assert [line.split("UTC  ")[1] for line in story] == [
            "queued: created",
            "rendering: rendering with scalar_rgb",
            "  slice 0, worker worker-1: the render process was ended by SIGSEGV",
            "converged: levelled off",
        ]

    def test_log_tells_of_each_try(self, client: redis.Redis) -> None:
        job = StagedJob(client)
        assert plateau("log", job.id) == (0, "", "nothing yet\n")
        job.commit()
        job.die("SIGSEGV")
        job.commit(said="WARN: odd\nWARN: very odd")
        code, out, _ = plateau("log", job.id)
        assert code == 0
        assert [line.partition("UTC  ")[2] or line for line in out.splitlines()] == [
            "slice 0  committed after 0.5 s by worker-1",
            "slice 1  died after 0.2 s by worker-1: SIGSEGV",
            "slice 1  committed after 0.5 s by worker-1",
            "    WARN: odd",
            "    WARN: very odd",
        ]
        # Of one slice, and as JSON
        assert len(plateau("log", job.id, "--slice", "0")[1].splitlines()) == 1
        shown = json.loads(plateau("log", job.id, "--slice", "1", "--json")[1])
        assert [one["what"] for one in shown["entries"]] == ["died", "committed"]
        assert len(json.loads(plateau("log", job.id, "--json")[1])["entries"]) == 3
        code, _, err = plateau("log", job.id, "--slice", "400")
        assert (code, "has no slice 400" in err) == (1, True)

    def test_what_was_deleted_is_listed_apart_and_comes_back(self, client: redis.Redis) -> None:
        job = StagedJob(client, batch="walk", name="lamp")
        assert plateau("delete", job.id)[0] == 1
        job.end(JobState.CANCELLED)
        assert plateau("delete", job.id) == (0, f"{job.id} cancelled, deleted\n", "")
        assert plateau("list") == (0, "", "no jobs\n")
        assert plateau("list", "--deleted")[1].startswith(f"{job.id}\tcancelled\t")
        assert f"`plateau delete --undo {job.id}` undoes it" in plateau("show", job.id)[1]
        assert plateau("delete", "--undo", job.id[:6]) == (0, f"{job.id} cancelled\n", "")
        assert plateau("list", "--search", "LAMP walk")[1].startswith(job.id)
        assert plateau("delete", "--batch", "walk") == (0, f"{job.id} cancelled\n", "")
        assert plateau("show", "--batch", "walk")[0] == 1
        assert (
            plateau("delete", "--undo", "--batch", "walk")[0]
            == plateau("show", "--batch", "walk")[0]
            == 0
        )

    def test_cancel_may_be_repeated_but_not_too_late(self, client: redis.Redis) -> None:
        job = StagedJob(client)
        for _ in range(2):
            assert plateau("cancel", job.id) == (0, f"{job.id} cancelled\n", "")
        late = StagedJob(client)
        late.commit()
        late.end()
        code, _, err = plateau("cancel", late.id)
        assert (code, "is converged" in err) == (1, True)

    def test_pause_and_resume_may_be_repeated_and_are_in_the_story(
        self, client: redis.Redis
    ) -> None:
        job = StagedJob(client)
        code, out, err = plateau("pause", job.id)
        assert (code, out, "is queued; only a job that is rendering" in err) == (1, "", True)
        job.commit()
        for _ in range(2):
            assert plateau("pause", job.id) == (0, f"{job.id} paused\n", "")
        shown = plateau("show", job.id)[1]
        for words in (
            "state:      paused",
            "paused:     since 20",
            "UTC  paused: paused by a user",
        ):
            assert words in shown
        assert plateau("list", "--state", "paused")[1].split("\t")[0] == job.id
        for _ in range(2):
            assert plateau("resume", job.id) == (0, f"{job.id} rendering\n", "")
        assert json.loads(plateau("resume", job.id, "--json")[1])["state"] == "rendering"
        shown = plateau("show", job.id)[1]
        for words in ("paused:     for ", "UTC  rendering: resumed by a user"):
            assert words in shown
        job.end()
        code, _, err = plateau("resume", job.id)
        assert (code, "is converged; only a paused job can be resumed" in err) == (1, True)

    def test_priority_takes_a_number_below_zero_too(self, client: redis.Redis) -> None:
        job = StagedJob(client)
        for number in ("10", "-10"):
            said = f"{job.id} queued, priority {number}\n"
            assert plateau("priority", job.id, number) == (0, said, "")
        assert json.loads(plateau("priority", job.id, "3", "--json")[1])["spec"]["priority"] == 3
        for wrong in ("1001", "urgent", "--urgent"):
            assert plateau("priority", job.id, wrong)[0] == 2
        job.commit()
        job.end()
        code, _, err = plateau("priority", job.id, "4")
        assert (code, "only a job that has not ended can be changed" in err) == (1, True)

    @pytest.mark.parametrize(
        ("state", "code"),
        [
            (JobState.CONVERGED, 0),
            (JobState.EXHAUSTED, 0),
            (JobState.FAILED, 1),
            (JobState.CANCELLED, 4),
        ],
    )
    def test_watch_exits_as_the_job_ended(
        self, client: redis.Redis, store: Blobs, tmp_path: Path, state: JobState, code: int
    ) -> None:
        job = StagedJob(client)
        job.commit(4)
        job.point(100, 5)
        job.picture(store, "image.png", b"a picture")
        job.end(state, "because")
        job.finish()
        out_folder = tmp_path / "out"
        exit_code, out, err = plateau("watch", job.id, "-o", str(out_folder))
        assert exit_code == code
        assert f"state:      {Jobs(client).get(job.id).outcome}" in out
        assert "100 spp" in err
        assert (out_folder / "image.png").read_bytes() == b"a picture"
        exit_code, out, _ = plateau("watch", job.id, "--json")
        assert exit_code == code
        assert json.loads(out)["state"] == state.value


class TestErrorsAreOneLine:
    @pytest.mark.parametrize("command", ["api", "monitor", "worker"])
    def test_of_a_process_without_a_farm(
        self, command: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("PLATEAU_REDIS_URL", raising=False)
        monkeypatch.setenv("PLATEAU_BLOBS", "/tmp/blobs")
        code, _, err = plateau(command)
        assert code == 1
        assert err.startswith("plateau: set PLATEAU_REDIS_URL: ")

    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"LEASE_S": "-1"}, "PLATEAU_LEASE_S: must be above 0"),
            ({"REDIS_URL": "nowhere", "BLOBS": "/tmp"}, "PLATEAU_REDIS_URL: "),
            ({"REDIS_URL": "redis://127.0.0.1", "BLOBS": "what://ever"}, "PLATEAU_BLOBS: "),
        ],
    )
    def test_of_a_setting(
        self, settings: dict[str, str], words: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for name, value in settings.items():
            monkeypatch.setenv(f"PLATEAU_{name}", value)
        code, _, err = plateau("monitor")
        assert (code, len(err.splitlines())) == (1, 1)
        assert err.startswith(f"plateau: {words}")
