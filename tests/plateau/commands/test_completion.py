"""What the shell offers on Tab, by the protocol of the scripts that it loads."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
import redis

from plateau.commands import main
from plateau.commands.options import complete
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.renderers import variants
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from plateau.rules import rules
from tests.support.farms.staged_job import StagedJob
from tests.support.path_programs import put_on_path

Run = Callable[..., list[str]]
Offers = Callable[..., list[str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """The lines that the completion of these words prints; the last one is the current one."""
    monkeypatch.setattr("gc.set_threshold", lambda _: None)  # this process lives on
    monkeypatch.setattr("atexit.register", lambda _: None)
    monkeypatch.setattr("plateau.commands.standard_streams", nullcontext)  # pytest has them
    monkeypatch.setattr("sys.argv", ["plateau"])
    monkeypatch.chdir(tmp_path)

    def run(shell: str, *words: str, **environment: str) -> list[str]:
        protocol = (
            {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)}
            if shell == "bash"
            else {
                "_TYPER_COMPLETE_ARGS": " ".join(words),
                "_TYPER_COMPLETE_FISH_ACTION": "get-args",
            }
        )
        nobody = {"PLATEAU_URL": "http://127.0.0.1:9", "_PLATEAU_COMPLETE": f"complete_{shell}"}
        for name, value in {**nobody, **protocol, **environment}.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit):
            main()
        said = capsys.readouterr()
        assert said.err == ""
        return [line for line in said.out.splitlines() if line]

    return run


@pytest.fixture
def answered(run: Run, api: str) -> Run:
    """The same of a service, asked again where a busy machine took more than its second."""
    return lambda *words: next(filter(None, (run(*words, PLATEAU_URL=api) for _ in range(10))), [])


@pytest.fixture
def offers(run: Run) -> Offers:
    """What bash is offered for the words."""
    return lambda *words, **environment: run("bash", "plateau", *words, **environment)


def test_states_rules_and_variants_are_offered(offers: Offers) -> None:
    assert offers("list", "--state", "") == [state.value for state in JobState]
    assert offers("submit", "a.xml", "--rule", "my") == ["myszkowski"]
    assert {name for name, about in complete.rules("") if about} == rules().keys()
    assert [name for name, _ in complete.variants("")] == ["auto", *variants()]


def test_jobs_are_offered_where_something_can_be_done_with_them(
    client: redis.Redis, answered: Run
) -> None:
    jobs: dict[str, str] = {"queued": StagedJob(client).id}
    for state in ("rendering", "paused", "converged"):
        staged = StagedJob(client)
        staged.commit()
        jobs[state] = staged.id
        if state == "paused":
            Jobs(client).pause(staged.id)
        if state == "converged":
            staged.end()
    jobs["deleted"] = Jobs(client).cancel(StagedJob(client).id).id
    Deletions(client).set(jobs["deleted"], deleted=True)
    for command, states in {
        "show": ("queued", "rendering", "paused", "converged"),
        "cancel": ("queued", "rendering", "paused"),
        "pause": ("rendering",),
        "resume": ("paused",),
        "delete": ("converged",),
    }.items():
        offered = set(answered("bash", "plateau", command, ""))
        assert offered == {jobs[state] for state in states}, command
    assert set(answered("bash", "plateau", "delete", "--undo", "")) == {jobs["deleted"]}
    job_id = jobs["rendering"]
    assert job_id in answered("bash", "plateau", "watch", job_id[:6])


@pytest.mark.parametrize("shell", ["zsh", "fish", "bash"])
def test_names_that_others_choose_bring_nothing_that_a_shell_would_run(
    shell: str, client: redis.Redis, answered: Run
) -> None:
    hostile = "\\$(touch run)`touch run`\"';x.xml"
    Jobs(client).create(JobSpec(), name=hostile, scene_sha256="0" * 64)
    offered = answered(shell, "plateau", "show", "")
    assert offered
    assert not re.search(r"touch run|\$\(|`", "".join(offered))


def test_silence_is_all_that_a_service_that_is_away_costs(offers: Offers) -> None:
    assert offers("show", "") == []
    assert offers("show", "", PLATEAU_URL="not a url") == []


def test_bash_itself_completes_by_the_script(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Given a bash that has loaded the script, and a `plateau` on its path
    put_on_path(tmp_path / "plateau", f'exec "{sys.executable}" -m plateau "$@"', monkeypatch)
    program = """
        eval "$(_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION=1 plateau --show-completion bash)"
        COMP_WORDS=(plateau list --state q) COMP_CWORD=3
        _plateau_completion plateau
        printf '%s\\n' "${COMPREPLY[@]}"
    """
    done = subprocess.run(
        ["bash", "--norc", "-c", program],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["queued"]
