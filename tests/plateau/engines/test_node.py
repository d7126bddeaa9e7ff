"""A node of a run: it joins the front, says what keeps it from that, and ends when that is gone."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path

import psutil
import pytest

from plateau.engines import node as module
from plateau.engines.blob_server import serving
from plateau.engines.front import Front
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.schema import check_schema
from plateau.farm.ledger.workers import Workers
from plateau.farm.redis import keys
from plateau.farm.redis.embedded import EmbeddedRedis
from plateau.farm.redis.link import connect
from tests.support.processes.commands import plateau
from tests.support.until import until

#: A node that looks often, and is in a hurry once it has a signal.
PROGRAM = """
import signal
import plateau.engines.node as node
node._SEEK_S, node._ASK_S, node.SILENCE_S = 60.0, 0.1, 60.0
signal.signal(signal.SIGUSR1, lambda *_: setattr(node, "SILENCE_S", 1.0))
node.main()
"""
Start = Callable[[Front], "subprocess.Popen[str]"]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[EmbeddedRedis]:
    """The front's Redis."""
    server = EmbeddedRedis(tmp_path / "redis", secret="ours")
    yield server
    server.stop()


@pytest.fixture
def front(server: EmbeddedRedis, tmp_path: Path) -> Iterator[Front]:
    """A front with nothing to do, which has an address that answers and one that does not."""
    blobs = Blobs(str(tmp_path / "blobs"))
    with connect(server.url, 120.0) as client, serving(blobs, "ours") as port:
        check_schema(client)
        check_pair(client, blobs)
        yield replace(Front.here(server.port, port, "ours"), hosts=("nowhere.invalid", "127.0.0.1"))


@pytest.fixture
def start(cache: Path) -> Iterator[Start]:
    """Starts nodes; none outlives its test."""
    started: list[subprocess.Popen[str]] = []

    def start(front: Front) -> "subprocess.Popen[str]":
        told = {"PLATEAU_FRONT": json.dumps(asdict(front)), "PLATEAU_CACHE": str(cache)}
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM],
            env={**os.environ, **told},
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


def test_it_works_for_the_front_until_that_is_silent(
    front: Front, server: EmbeddedRedis, start: Start
) -> None:
    node = start(front)
    with connect(server.url, 120.0) as client:
        (worker,) = until(lambda: Workers(client).living())
        assert worker.pid == node.pid
        # A Redis that is away for a moment is no front that has gone
        server.process.kill()
        server.process.wait()
        server.start()
        client.delete(keys.WORKERS)  # what it said before
        (worker,) = until(lambda: Workers(client).living())
    family = psutil.Process(node.pid).children(recursive=True)
    server.stop()
    node.send_signal(signal.SIGUSR1)
    _, said = node.communicate(timeout=120)
    assert "the machine of the run has been silent for 1 s: the run is over" in said
    _, alive = psutil.wait_procs(family, timeout=60)
    assert not alive


def test_it_says_what_keeps_it_away_and_the_front_says_it_in_words(
    front: Front, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "_SEEK_S", 0.0)  # each address is tried once
    monkeypatch.setattr(module, "_ANSWER_S", 60.0)
    closed = 1  # no test listens at it
    for case, code, words in (
        (replace(front, secret="guessed"), 77, "what answers is not the Redis of this run"),
        (replace(front, redis_port=closed), 69, "tried 127.0.0.1 (Redis cannot be reached: "),
        (replace(front, blobs_port=closed), 69, "tried 127.0.0.1 (the blob store failed: "),
        (replace(front, version="0.0.9"), 76, "the run is Plateau 0.0.9's"),
    ):
        with pytest.raises(SystemExit) as ended:
            module._join(case)
        said = capsys.readouterr().err
        assert (ended.value.code, words in said) == (code, True), said
        assert "exit code" not in case.unfit(code, "python3")
    told = replace(front, redis_port=closed).unfit(69, "python3")
    assert f"nowhere.invalid:{closed}, 127.0.0.1:{closed}, and the port {front.blobs_port}" in told


def test_an_engine_that_is_not_there_is_refused_before_anything_starts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for on, words in (
        ("pbs --queue=x", "there is no engine 'pbs'; there are ray, slurm"),
        ("", "there is no engine ''"),
        ("slurm '", "names no engine: No closing quotation"),
        ("ray --num-gpus=2", "a worker renders on one GPU: in place of --num-gpus=2 ask for one,"),
        ("slurm --gres=nvme:1,gpu:a100:4", "in place of --gres=nvme:1,gpu:a100:4 ask for one,"),
        ("slurm --clusters=b", "leave out -M and --clusters"),
        ("slurm --gpus-per-task 2 --mem=8G", "in place of --gpus-per-task 2 ask for one,"),
    ):
        code, _, said = plateau("render", "scenes:box", "--on", on)
        assert (code, words in said) == (1, True), said
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, said = plateau(
        "render",
        "scenes:box",
        "--on",
        "slurm --gres=gpu:1,nvme:2 --comment=--gpus=2 --cluster-constraint=x",
    )
    assert code == 1
    assert "these commands of Slurm are not on the PATH: sbatch, squeue, scontrol, scancel" in said
