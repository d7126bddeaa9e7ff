"""`plateau scale slurm` where there is no Slurm: what it says, and what it refuses."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.ledger.totals import Demand
from plateau.scale.report import Report
from plateau.scale.tasks import ScalingPlan, Snapshot, Task, TaskState


def say(*arguments: str, code: int, **environment: str) -> str:
    done = CliRunner().invoke(app, ["scale", "slurm", *arguments], env=environment)
    assert done.exit_code == code, done.output
    return done.stderr


def test_without_slurms_commands_it_says_which_are_missing(tmp_path: Path) -> None:
    (tmp_path / "squeue").touch(mode=0o755)
    told = say("--max", "1", code=1, PATH=str(tmp_path))
    assert told.startswith(
        "plateau: these commands of Slurm are not on the PATH: sbatch, scancel. Run"
    )


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "Missing option '--max'"),
        (("--max", "1", "--min", "2"), "--min 2 is more than --max 1"),
        (("--max", "1", "--sbatch-option", "nice=5"), "is not an option of sbatch"),
        (("--max", "1", "--worth", "0"), "0"),
    ],
)
def test_what_cannot_be_meant_is_refused(options: tuple[str, ...], words: str) -> None:
    assert words in say(*options, code=2)


@pytest.fixture
def with_commands(tmp_path: Path) -> str:
    """A PATH with commands that are found, and never run."""
    for name in ("sbatch", "squeue", "scancel"):
        (tmp_path / name).touch(mode=0o755)
    return str(tmp_path)


def test_a_file_that_will_not_do_is_named(with_commands: str, tmp_path: Path) -> None:
    told = say("--max", "1", "--script", "/nowhere/w.sbatch", code=1, PATH=with_commands)
    assert "there is no batch script /nowhere/w.sbatch" in told
    file = tmp_path / "worker.env"
    file.write_text("# the workers'\n\nPLATEAU_THREADS=4\nexport A=b\n")
    told = say("--max", "1", "--worker-env", str(file), code=1, PATH=with_commands)
    assert "line 4: 'export A=b' is not of the form NAME=VALUE" in told


def test_without_a_farm_it_says_what_to_set(
    with_commands: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PLATEAU_REDIS_URL", "PLATEAU_BLOBS"):
        monkeypatch.delenv(name, raising=False)
    assert "PLATEAU_REDIS_URL and PLATEAU_BLOBS" in say("--max", "1", code=1, PATH=with_commands)


class TestReport:
    SNAPSHOT = Snapshot(
        now_s=0,
        demand=Demand(waiting=9, left=90, work_s=170.04),
        tasks=(
            Task(id="7_1", state=TaskState.RUNS),
            Task(id="7_2", state=TaskState.WAITS, why="Resources"),
            Task(id="7_3", state=TaskState.LEAVES),
        ),
        workers={},
        others=1,
    )

    def test_tells_people_what_there_is_and_what_is_done(self) -> None:
        report = Report.of(self.SNAPSHOT, ScalingPlan(wanted=4, have=2, submit=2, end=("7_1",)))
        assert report.in_words() == (
            "4 workers needed for 170 s of work, 2 there or coming; 1 waiting (Resources), "
            "1 running, 1 not yet heard from; 1 worker from elsewhere; 1 asked to leave: 7_1; "
            "2 to be submitted"
        )

    def test_tells_programs_all_of_it(self) -> None:
        report = Report.of(self.SNAPSHOT, ScalingPlan(wanted=4, have=2, held_s=30))
        told = json.loads(report.as_json())
        assert (told["wanted"], told["waiting_for"], told["held_s"]) == (4, ["Resources"], 30)
        assert told["time"].endswith("+00:00")
        assert "nothing is submitted for 30 s" in report.in_words()

    def test_has_no_news_while_only_the_work_gets_less(self) -> None:
        plan = ScalingPlan(wanted=4, have=4)
        less = Snapshot(
            now_s=10,
            demand=Demand(waiting=5, left=80, work_s=150),
            tasks=self.SNAPSHOT.tasks,
            workers={},
            others=1,
        )
        assert Report.of(self.SNAPSHOT, plan).news() == Report.of(less, plan).news()
