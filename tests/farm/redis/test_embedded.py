"""The embedded Redis: private, durable, gone with its parent."""

from pathlib import Path

import psutil
import pytest

from plateau.farm.model.errors import StoreUnavailable
from plateau.farm.redis import embedded
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.support.processes.relatives import orphan_of
from tests.support.until import until


def test_it_keeps_its_data_over_a_restart_and_a_kill(tmp_path: Path) -> None:
    first = EmbeddedRedis(tmp_path)
    connect(first.url, 120.0).set("a", "1")
    first.process.kill()
    first.stop()
    second = EmbeddedRedis(tmp_path)
    client = connect(second.url, 120.0)
    assert client.get("a") == "1"
    assert client.config_get("append*")["appendfsync"] == "always"
    assert client.config_get("port") == {"port": "0"}  # nobody else can connect
    client.close()
    second.stop()
    assert not psutil.pid_exists(second.process.pid)


def test_a_log_that_is_mostly_history_is_written_anew_at_the_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def log_bytes(server: EmbeddedRedis) -> int:
        with connect(server.url, 120.0) as client:
            assert client.get("kept") == "x" * 1000
            return int(client.info("persistence")["aof_current_size"])

    server = EmbeddedRedis(tmp_path)
    with connect(server.url, 120.0) as client:
        client.config_set("appendfsync", "no")
        pipe = client.pipeline(transaction=False)
        for number in range(8000):
            pipe.set("kept", str(number % 10) * 1000)
        pipe.set("kept", "x" * 1000)
        pipe.execute()
    long = log_bytes(server)
    # Given a server that is restarted before its log is twice as long as at its start
    server.process.kill()
    server.process.wait()
    server.start()
    assert log_bytes(server) >= long  # Redis 7 counts an empty snapshot at its beginning, too
    # When its log counts as long
    monkeypatch.setattr(embedded, "_LONG_LOG_BYTES", 1_000_000)
    server.process.kill()
    server.process.wait()
    server.start()
    # Then it becomes short, and the data are there, now and after another restart
    until(lambda: log_bytes(server) < 10_000)
    server.stop()
    server.start()
    assert log_bytes(server) < 10_000
    server.stop()


@pytest.mark.parametrize("name", ["long" * 30, "me@home%41?#"])
def test_a_data_folder_with_any_path_will_do(tmp_path: Path, name: str) -> None:
    server = EmbeddedRedis(tmp_path / name)
    assert connect(server.url, 120.0).ping()
    server.stop()


def test_one_that_does_not_start_says_why(tmp_path: Path) -> None:
    (tmp_path / "appendonly.aof").write_text("this is no append-only file")
    (tmp_path / "appendonlydir").write_text("nor a folder of them")
    with pytest.raises(StoreUnavailable, match="did not start"):
        EmbeddedRedis(tmp_path)


def test_it_dies_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path\n"
        "from plateau.farm.redis.embedded import EmbeddedRedis\n"
        "print(EmbeddedRedis(Path(sys.argv[1])).process.pid, flush=True); time.sleep(60)"
    )
    orphan_of(program, tmp_path).wait(60)
