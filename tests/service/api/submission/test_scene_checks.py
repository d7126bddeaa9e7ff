"""Checks of scenes cost what they may and no more, whoever sends what, and however many at once."""

import asyncio
import socket
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from urllib.parse import urlsplit

import psutil
import pytest

from plateau.farm.bundle import BundleError, BundleLimits
from plateau.service.api.scene_checks.pool import (
    MOST_WAITING,
    Checked,
    Gone,
    IsGone,
    SceneChecks,
    TooManyChecks,
)
from plateau.service.api.scene_checks.process import CheckBudget, CheckEnded
from tests.support.farms.real_farm import RealFarm
from tests.support.processes.commands import starting
from tests.support.scenes.bundles import scene, zipped
from tests.support.until import until


def dear(tags: int) -> bytes:
    """Some megabytes that take seconds: parameters put into so many attributes."""
    tag = " ".join(["<a", *(f'a{number}="$w"' for number in range(40_000)), "/>"])
    content = scene('<default name="w" value="1"/>', *[tag] * tags)
    return zipped({"scene.xml": content}, zipfile.ZIP_STORED).getvalue()


def many_entries() -> bytes:
    """As many entries as may be, with long names."""
    return zipped({f"{'x' * 200}/{number}{'x' * 250}": b"" for number in range(10_000)}).getvalue()


@pytest.fixture(scope="module")
def farm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealFarm]:
    folder = tmp_path_factory.mktemp("checks")
    with RealFarm(folder, folder / "cache") as farm:
        yield farm


def family(pid: int) -> list[psutil.Process]:
    api = psutil.Process(pid)
    return [api, *api.children()]


class TestTheProcess:
    def test_ends_the_check_of_a_client_that_has_gone(self, farm: RealFarm) -> None:
        # Given an upload whose check takes seconds
        pid = farm.processes[0].pid
        content = dear(tags=60)
        body = (
            b'--edge\r\nContent-Disposition: form-data; name="scene"; filename="a.zip"\r\n\r\n'
            + content
            + b"\r\n--edge--\r\n"
        )
        head = (
            "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: "
            f"{len(body)}\r\nContent-Type: multipart/form-data; boundary=edge\r\n\r\n"
        )
        address = urlsplit(farm.url)
        with socket.create_connection((address.hostname or "", address.port or 0)) as client:
            since = {one.pid: one.cpu_times().user for one in family(pid)[1:]}
            client.sendall(head.encode() + body)
            [checking] = until(lambda: busy(pid, since))
            checking.suspend()  # so that it is not done before the client has gone
        # When the client goes, then so does the process, which else would serve the next
        until(lambda: not checking.is_running())
        # And no job was made, and the next upload is checked
        assert [job for job in farm.client.all_jobs() if job.name == "a"] == []
        assert farm.submit().state == "queued"

    def test_knows_no_credentials_and_ends_with_an_api_that_is_killed(self, farm: RealFarm) -> None:
        farm.submit()
        api = farm.processes[0]
        [child, *_] = children = psutil.Process(api.pid).children()
        assert "PLATEAU_REDIS_URL" in farm.environment
        assert not any(name.startswith("PLATEAU") for name in child.environ())
        farm.kill(api)
        _, alive = psutil.wait_procs(children, timeout=60)
        assert not alive


def busy(pid: int, since: dict[int, float]) -> list[psutil.Process]:
    """Processes of the API that have worked for longer since then than it takes to start one."""
    children = family(pid)[1:]
    return [one for one in children if one.cpu_times().user > since.get(one.pid, 0.0) + 0.5]


async def stays() -> bool:
    return False


@pytest.fixture
def make() -> Iterator[Callable[..., SceneChecks]]:
    """Makes checks with limits that bound nothing, so that the budget has to."""
    limits = BundleLimits(max_xml_bytes=2**40, max_xml_elements=2**40, max_substitutions=2**40)
    yield from starting(lambda **budget: closing(SceneChecks(limits, CheckBudget(**budget))))


async def check(
    checks: SceneChecks, content: bytes, *, is_gone: IsGone = stays, values: int = 1
) -> Checked:
    """What is found in the upload with the same values so many times."""
    with tempfile.TemporaryFile() as file:
        file.write(content)
        file.flush()
        async with checks.slot(is_gone) as check:
            return await check(file, [({}, 0)] * values)


GOOD = scene()


class TestTheBudget:
    @pytest.mark.parametrize(
        ("budget", "content", "says"),
        [
            ({"cpu_s": 1.0}, lambda: dear(tags=100), "more than 1 s of CPU time"),
            ({"deadline_s": 1.0}, lambda: dear(tags=100), "more than 1 s to check"),
            ({"memory_bytes": 24 * 2**20}, many_entries, "more than 24 MiB of memory"),
        ],
        ids=["CPU time", "deadline", "memory"],
    )
    def test_is_kept_whatever_the_scene(
        self,
        make: Callable[..., SceneChecks],
        budget: dict[str, float],
        content: Callable[[], bytes],
        says: str,
    ) -> None:
        checks = make(**{"deadline_s": 600.0} | budget)

        async def story() -> None:
            # Given a scene that costs more, its check is ended
            with pytest.raises(BundleError, match=says) as refused:
                await check(checks, content())
            assert refused.value.code == "xml-too-large"
            if "deadline_s" not in budget:  # a busy machine may take so long to begin
                # And the next one is made as ever
                assert (await check(checks, GOOD)).sizes == [(768, 576)]

        asyncio.run(story())

    def test_of_many_values_is_one_and_those_known_by_then_are_told(
        self, make: Callable[..., SceneChecks]
    ) -> None:
        checks = make(total_s=0.3)
        found = asyncio.run(check(checks, dear(tags=2), values=1000))
        assert 1 <= len(found.sizes) < 1000
        assert found.error is None


class TestATurn:
    def test_is_refused_where_too_many_wait_and_given_up_by_who_has_gone(
        self, make: Callable[..., SceneChecks]
    ) -> None:
        checks = make()
        has_gone = asyncio.Event()

        async def is_gone() -> bool:
            return has_gone.is_set()

        async def story() -> None:
            # Given as many checks as there are slots, and as many more as may wait
            contents = [dear(tags=100)] * 2 + [GOOD] * MOST_WAITING
            tasks = [
                asyncio.create_task(check(checks, content, is_gone=is_gone)) for content in contents
            ]
            await asyncio.sleep(0)
            # When one more comes, it is refused
            with pytest.raises(TooManyChecks):
                await check(checks, GOOD)
            # When all have gone, their checks end
            has_gone.set()
            ended = await asyncio.gather(*tasks, return_exceptions=True)
            assert {type(one) for one in ended} == {Gone}
            # And there is a slot for who comes now
            assert (await check(checks, GOOD)).sizes == [(768, 576)]

        asyncio.run(story())

    def test_ends_without_a_verdict_where_somebody_ends_the_process(
        self, make: Callable[..., SceneChecks]
    ) -> None:
        checks = make()

        async def story() -> None:
            others = set(psutil.Process().children())
            await check(checks, GOOD)
            [child] = set(psutil.Process().children()) - others
            task = asyncio.create_task(check(checks, dear(tags=100)))
            before_s = child.cpu_times().user
            while child.cpu_times().user <= before_s:
                await asyncio.sleep(0.01)
            child.kill()
            with pytest.raises(CheckEnded):
                await task
            assert (await check(checks, GOOD)).sizes == [(768, 576)]

        asyncio.run(story())
