"""What the shell offers on Tab, by the protocol of the scripts that it loads."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import redis
from hypothesis import given
from hypothesis import strategies as st

from plateau import scenes
from plateau.commands.options import complete
from plateau.commands.options.bash_completion import joined
from plateau.farm.ledger.deletions import Deletions
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.model.renderers import variants
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JobState
from tests.support.farms.staged_job import StagedJob

Offers = Callable[..., list[str]]


def run(shell: str, words: list[str], folder: Path, **environment: str) -> list[str]:
    """The lines that the completion of these words prints; the last one is the current one."""
    protocol = (
        {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)}
        if shell == "bash"
        else {"_TYPER_COMPLETE_ARGS": " ".join(words), "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    )
    done = subprocess.run(
        [sys.executable, "-m", "plateau"],
        env={
            **os.environ,
            "PYTHONPATH": str(Path(__file__).parents[3]),
            "PLATEAU_URL": "http://127.0.0.1:9",  # nobody is there
            "_PLATEAU_COMPLETE": f"complete_{shell}",
            **protocol,
            **environment,
        },
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return [line for line in done.stdout.splitlines() if line]


def run_till_answered(*arguments: object, **environment: str) -> list[str]:
    """The same, asked again where a busy machine did not answer within the second that it has."""
    for _ in range(10):
        if lines := run(*arguments, **environment):  # type: ignore[arg-type]
            return lines
    return []


@pytest.fixture
def offers(tmp_path: Path) -> Offers:
    """What bash is offered for the words."""
    return lambda *words, **environment: run("bash", ["plateau", *words], tmp_path, **environment)


def test_commands_and_options_are_offered(offers: Offers) -> None:
    assert {"render", "resume"} <= set(offers("re"))
    assert offers("prio") == ["priority"]
    assert {"--out", "--no-curve", "--json"} <= set(offers("watch", "--"))


def test_scenes_are_offered_by_name_beside_files_and_folders(
    offers: Offers, tmp_path: Path
) -> None:
    (tmp_path / "my").mkdir()
    for name in ("room.xml", "room.zip", "notes.txt", ".hidden.xml"):
        (tmp_path / name).touch()
    ours = [f"scenes:{name}" for name in scenes.NAMES]
    assert offers("render", "") == [*ours, "my/", "room.xml", "room.zip"]
    assert offers("submit", "sce") == ours
    # Where ours are out of the question the shell completes paths, which it does best
    assert offers("render", "roo") == []


def test_names_are_completed_behind_the_colon_at_which_bash_takes_words_apart(
    offers: Offers,
) -> None:
    assert offers("render", "scenes", ":") == list(scenes.NAMES)
    assert offers("render", "scenes", ":", "b") == ["bar", "box"]
    # and a URL before does not confuse it
    assert offers("submit", "--url", "http", ":", "//127.0.0.1", ":", "9", "scenes", ":", "o") == [
        "oculist"
    ]


def test_states_rules_and_variants_are_offered(offers: Offers) -> None:
    assert offers("list", "--state", "") == [state.value for state in JobState]
    assert offers("submit", "a.xml", "--rule", "my") == ["myszkowski"]
    assert {name for name, _ in complete.rules("")} == {
        "fixed",
        "successive",
        "multiple",
        "reverse",
        "myszkowski",
        "visible",
        "jod",
    }
    for name, about in complete.rules(""):
        assert JobSpec.model_validate({"rule": {"name": name}})
        assert about
    assert [name for name, _ in complete.variants("")] == ["auto", *variants()]


def test_jobs_are_offered_where_something_can_be_done_with_them(
    client: redis.Redis, api: str, tmp_path: Path
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
    put_away = Jobs(client).cancel(StagedJob(client).id).id
    Deletions(client).set(put_away, deleted=True)
    for command, states in {
        "show": ("queued", "rendering", "paused", "converged"),
        "cancel": ("queued", "rendering", "paused"),
        "pause": ("rendering",),
        "resume": ("paused",),
        "delete": ("converged",),
    }.items():
        words = ["plateau", command, ""]
        offered = set(run_till_answered("bash", words, tmp_path, PLATEAU_URL=api))
        assert offered == {jobs[state] for state in states}, command
    words = ["plateau", "restore", ""]
    assert set(run_till_answered("bash", words, tmp_path, PLATEAU_URL=api)) == {put_away}
    job_id = jobs["rendering"]
    words = ["plateau", "watch", job_id[:6]]
    assert job_id in run_till_answered("bash", words, tmp_path, PLATEAU_URL=api)
    # An address on the line counts for more than that of the settings
    words = ["plateau", "show", "--url", api, ""]
    assert len(run_till_answered("bash", words, tmp_path)) == 4


@pytest.mark.parametrize("shell", ["zsh", "fish", "bash"])
def test_names_that_others_choose_bring_nothing_that_a_shell_would_run(
    shell: str, client: redis.Redis, api: str, tmp_path: Path
) -> None:
    hostile = "\\$(touch run)`touch run`\"';x.xml"
    (tmp_path / hostile).touch()
    Jobs(client).create(JobSpec(), name=hostile, scene_sha256="0" * 64)
    for words in (["show", ""], ["render", ""]):
        offered = run_till_answered(shell, ["plateau", *words], tmp_path, PLATEAU_URL=api)
        assert offered
        assert not re.search(r"touch run|\$\(|`", "".join(offered))


def test_silence_is_all_that_a_service_that_is_away_costs(offers: Offers) -> None:
    assert offers("show", "") == []
    assert offers("show", "", PLATEAU_URL="not a url") == []


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_offered_what_each_thing_is(shell: str, tmp_path: Path) -> None:
    said = "\n".join(run(shell, ["plateau", "list", "--state", "ca"], tmp_path))
    assert "cancelled" in said
    said = "\n".join(run(shell, ["plateau", "submit", "a.xml", "--rule", "fi"], tmp_path))
    assert "fixed" in said
    assert "Stop at a number of samples" in said


@pytest.mark.parametrize(
    ("shell", "words"),
    [
        ("bash", "complete -o default -F _plateau_completion plateau"),
        ("zsh", "compdef _plateau_completion plateau"),
        ("fish", "complete --command plateau"),
    ],
)
def test_each_shell_gets_its_script(shell: str, words: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "plateau", "--show-completion", shell],
        env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert words in done.stdout


def test_bash_itself_completes_by_the_script(tmp_path: Path) -> None:
    # Given a bash that has loaded the script, and a `plateau` on its path
    command = tmp_path / "plateau"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m plateau "$@"\n')
    command.chmod(0o755)
    program = """
        eval "$(_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION=1 plateau --show-completion bash)"
        COMP_WORDS=(plateau render scenes : b) COMP_CWORD=4
        _plateau_completion plateau
        printf '%s\\n' "${COMPREPLY[@]}"
    """
    done = subprocess.run(
        ["bash", "--norc", "-c", program],
        env={
            **os.environ,
            "PATH": f"{tmp_path}:{os.environ['PATH']}",
            "PYTHONPATH": str(Path(__file__).parents[3]),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["bar", "box"]


@given(st.lists(st.from_regex(r"[a-z/]+(:[a-z]+)*:?", fullmatch=True), min_size=1, max_size=6))
def test_words_are_put_together_as_they_were(words: list[str]) -> None:
    # Given a line as bash takes it apart; a word that ends with a colon must be the last
    words = [*(word.rstrip(":") for word in words[:-1]), words[-1]]
    apart: list[str] = []
    for word in words:
        first, *others = word.split(":")
        apart.append(first)
        for other in others:
            apart += [":", other] if other else [":"]
    assert joined(apart, len(apart) - 1) == (words, len(words) - 1)
