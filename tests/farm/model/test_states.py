"""Every state against every move: what the table allows happens, all else is refused."""

import itertools
import re
from pathlib import Path

import pytest
import redis

import plateau
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.model.errors import IllegalTransition
from plateau.farm.model.spec import JobSpec
from plateau.farm.model.states import JOB_MOVES, EndedBy, JobState
from plateau.farm.redis import keys
from tests.support.farms.ledger_farm import own

ENDS = [state for state in JobState if state.ended]


@pytest.mark.parametrize(("start", "target"), list(itertools.product(JobState, ENDS)))
def test_a_job_ends_only_along_the_table(
    client: redis.Redis, start: JobState, target: JobState
) -> None:
    # Given a job in some state, owned by a monitor
    jobs, owners = Jobs(client), Ownerships(client, lease_s=15)
    job = jobs.create(JobSpec(), name="box", scene_sha256="00").job
    owned = own(owners, job.id)
    client.hset(keys.job(job.id), "state", start.value)
    # When it is to end
    if target in JOB_MOVES[start] or target is start:
        owners.end(owned, target, "farm", "because")
        # Then it has; ending twice in the same way is harmless
        assert jobs.get(job.id).state is target
    else:
        # Or it is refused and stays as it was
        with pytest.raises(IllegalTransition, match=f"is {start.value} and cannot become"):
            owners.end(owned, target, "farm", "because")
        assert jobs.get(job.id).state is start


@pytest.mark.parametrize(
    ("target", "ended_by", "outcome"),
    [
        (JobState.CONVERGED, "rule", "converged"),
        (JobState.EXHAUSTED, "cap", "reached its cap"),
        (JobState.EXHAUSTED, "time_limit", "reached its time limit"),
        (JobState.FAILED, "image", "failed"),
    ],
)
def test_what_ended_a_job_is_a_field_whatever_its_name_and_its_reason_say(
    client: redis.Redis, target: JobState, ended_by: EndedBy, outcome: str
) -> None:
    misleading = "slice 3 failed: reached its time limit, the budget of reached the cap"
    jobs, owners = Jobs(client), Ownerships(client, lease_s=15)
    job = jobs.create(JobSpec(name=misleading), name=misleading, scene_sha256="00").job
    assert (job.outcome, job.ended_by) == ("queued", None)
    owned = own(owners, job.id)
    client.hset(keys.job(job.id), "state", "rendering")
    owners.end(owned, target, ended_by, misleading)
    ended = jobs.get(job.id)
    assert (ended.outcome, ended.ended_by, ended.failed_slice) == (outcome, ended_by, None)
    assert [event.data.get("ended_by") for event in jobs.events(job.id)] == [None, ended_by]


#: A program that compares or searches a job's reason.
_READS_A_SENTENCE = re.compile(
    r"\bin (\w+\.)*reason\b|reason\.(startswith|endswith|includes|match|search|indexOf|find)"
    r"|\.(exec|test|search|match|fullmatch)\((\w+\.)*reason\b"
)


def test_no_program_matches_a_sentence() -> None:
    root = Path(plateau.__file__).parent
    sources = [path for kind in ("*.py", "*.js", "*.lua") for path in root.rglob(kind)]
    assert len(sources) > 300
    found = [str(path) for path in sources if _READS_A_SENTENCE.search(path.read_text("utf-8"))]
    assert found == []
