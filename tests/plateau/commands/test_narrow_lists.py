"""Lists on a narrow terminal: whatever is left out, an id is whole, for it is what one copies."""

from contextlib import closing

import pytest
import redis

from tests.support.farms.staged_job import StagedJob
from tests.support.processes.terminal import Terminal


@pytest.mark.parametrize("columns", [80, 40])
def test_no_id_is_cut(api: str, client: redis.Redis, columns: int) -> None:
    # Given jobs of a batch with a long name, one with a point of its curve
    jobs = [StagedJob(client, batch="a-sequence-of-frames", max_spp=100_000) for _ in range(2)]
    jobs[0].commit(4)
    jobs[0].point(100, visible=9)
    # When they are listed on a terminal
    with closing(Terminal("list", "--url", api, columns=columns)) as terminal:
        assert terminal.exit_code() == 0
        text = terminal.written.decode()
    # Then each line begins with a whole id, and at the usual width none is broken
    listed = [line for line in text.splitlines() if "/100000" in line]
    assert [line.split()[0] for line in listed] == [job.id for job in jobs[::-1]]
    if columns == 80:
        assert max(map(len, listed)) <= columns
        assert "0.1 %" in listed[1]  # the noise left, not what changed since the first image
