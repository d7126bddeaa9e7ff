"""What most tests need: a real Redis, empty, and a blob store, empty."""

import functools
import logging
import os
import random
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import redis
import typer.testing
from hypothesis import settings

from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.api_keys import ApiKeys
from plateau.farm.ledger.jobs import Jobs
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect

# No example has a deadline, and all runs have the same examples.
settings.load_profile("ci")

pytest.register_assert_rewrite("tests.support", "tests.soak")

# The repository is on sys.path. Its links into the package could be imported by their own names,
# and a module would be loaded a second time. None makes Python refuse that.
sys.modules.update(dict.fromkeys(("metric", "scenes", "service", "worker")))


@functools.cache
def _built(app: typer.Typer, _commands: int, _groups: int) -> Any:
    return typer.main.get_command(app)


# Each invocation would build all commands anew.
typer.testing._get_command = lambda app: _built(
    app, len(app.registered_commands), len(app.registered_groups)
)

#: For Redis, which a busy disk stops. Plateau's processes ask again sooner, which no test does.
_ANSWER_S = 120.0

_COMPILING = pytest.StashKey[subprocess.Popen[bytes]]()

#: Folders whose files take long: one that began last would end minutes after all others.
_LONG = ("faults", "acceptance", "bench", "page", "statistical", "worker", "plateau", "service")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--file-order", type=int, metavar="SEED", help="shuffle the files of tests")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """For ``-n auto``: one process more than cores, since a test waits as long as it computes.

    No more than six, for each of them starts farms of its own.
    """
    return min((os.cpu_count() or 1) + 1, 6)


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Give a process of ``-n`` a folder with a short name: sockets lie in it, see unix(7)."""
    number: str | None = getattr(config, "workerinput", {}).get("workerid")
    if number is not None:
        theirs = Path(config.option.basetemp)
        config.option.basetemp = str(theirs.with_name(number.removeprefix("gw")))
    # A shell's background ignores SIGINT and nohup ignores SIGHUP. What we start would inherit it,
    # and has to hear of both; a hang-up still ends no test run under nohup.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)  # which no program inherits
    from tests.support.processes.forked import end_fork_server
    from tests.support.processes.own_processes import own_processes

    stack = ExitStack()
    if "TESTS_CACHE" not in os.environ:  # shared by all processes of ``-n``, which inherit it
        # What was killed may still write into it at the end.
        for name in ("TESTS_CACHE", "TESTS_TEMPORARY"):
            folder = tempfile.TemporaryDirectory(prefix="tests-", ignore_cleanup_errors=True)
            os.environ[name] = stack.enter_context(folder)
    stack.enter_context(own_processes())
    if config.getoption("numprocesses", None):
        # Once, while others look for tests, and before many tests wait for it: 25 s of a core
        compile_ = "from plateau.picture.judge import warm_up; warm_up()"
        config.stash[_COMPILING] = subprocess.Popen([sys.executable, "-c", compile_])
    stack.callback(end_fork_server)
    config.add_cleanup(stack.close)


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> None:
    compiling = session.config.stash.get(_COMPILING, None)
    assert compiling is None or compiling.wait() == 0


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put long tests first; let each have a name of its own: of two ``-n`` would run but one."""
    seed: int | None = config.getoption("--file-order")
    if seed is None:
        items.sort(key=_turn)
    else:
        files = sorted({item.path for item in items})
        random.Random(seed).shuffle(files)
        place = {file: index for index, file in enumerate(files)}
        items.sort(key=lambda item: place[item.path])
    twice = [name for name, count in Counter(item.nodeid for item in items).items() if count > 1]
    if twice:
        raise pytest.UsageError(f"tests that share a name: {twice}")


def _turn(item: pytest.Item) -> int:
    folder = item.path.relative_to(Path(__file__).parent).parts[0]
    return _LONG.index(folder) if folder in _LONG else len(_LONG)


@pytest.fixture(autouse=True)
def _logging_as_it_was() -> Iterator[None]:
    """A command that is run in this process says where log lines go: to a stream of its test's."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)


@pytest.fixture(scope="session", autouse=True)
def _writes_are_watched() -> Iterator[None]:
    from tests.support.redis.redis_writes import watching  # its assertions are rewritten first

    with watching():
        yield


@pytest.fixture(autouse=True)
def _python_writes_nothing_to_redis() -> Iterator[None]:
    """Also in a thread whose errors nobody hears of."""
    from tests.support.redis.redis_writes import found

    yield
    writes = [found.pop() for _ in range(len(found))]
    assert writes == []


@pytest.fixture(scope="session")
def embedded_redis(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EmbeddedRedis]:
    """One server for all tests of a process. Those of durability start their own, which syncs."""
    server = EmbeddedRedis(tmp_path_factory.mktemp("redis"))
    client = connect(server.url, _ANSWER_S)
    client.config_set("appendfsync", "no")
    client.close()
    yield server
    server.stop()


@pytest.fixture
def redis_url(embedded_redis: EmbeddedRedis) -> str:
    client = connect(embedded_redis.url, _ANSWER_S)
    client.flushall()
    client.close()
    return embedded_redis.url


@pytest.fixture
def client(redis_url: str) -> Iterator[redis.Redis]:
    client = connect(redis_url, _ANSWER_S)
    yield client
    client.close()


@pytest.fixture
def jobs(client: redis.Redis) -> Jobs:
    return Jobs(client)


@pytest.fixture
def keys(client: redis.Redis) -> ApiKeys:
    return ApiKeys(client)


@pytest.fixture(scope="session")
def cache() -> Path:
    """A cache for whoever renders: what was found of this machine, and what Mitsuba compiled."""
    return Path(os.environ["TESTS_CACHE"])


@pytest.fixture
def store(tmp_path: Path) -> Blobs:
    return Blobs(str(tmp_path / "blobs"))
