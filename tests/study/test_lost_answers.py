"""Every write of a study may be repeated, and looks at the layout, as all of the farm's."""

from collections.abc import Callable
from typing import Any, Final

import pytest
import redis

from plateau.farm.model import versions
from plateau.farm.model.errors import Incompatible
from plateau.farm.redis import keys as farm_keys
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.scripts import Scripts
from plateau.study import keys, redis_commands
from plateau.study.ledger import Studies
from plateau.study.model import Screen
from plateau.study.redis_commands import BeginStudy, ForgetStudy
from tests.farm.redis.test_lost_answers import do_and_lose_the_answer, proxy, state, world
from tests.support.faults.redis_proxy import RedisProxy
from tests.support.redis.lost_answers import World
from tests.support.redis.redis_commands import commands

__all__ = ["proxy", "world"]

STUDY: Final[dict[str, Any]] = {
    "name": "s", "method": "constant", "job_id": "a" * 12, "reference_job_id": "b" * 12,
    "independent": True, "levels": [50, 100], "reference_spp": 1000, "slice_spp": 50,
    "exposure_ev": 0.0, "width": 32, "height": 32,
}  # fmt: skip
SCREEN: Final = Screen(viewing_distance_cm=60, pixel_pitch_mm=0.25)
OWN: Final = commands(more=keys.script()) - commands()

Case = tuple[Callable[[World], Callable[[], object]], Callable[[Any], bool]]


def _made(world: World) -> str:
    studies = Studies(world.direct)
    return studies.create(studies.begin(), {"job": "a"}, "", STUDY).id


def _begin(world: World) -> Callable[[], object]:
    begin = BeginStudy(study="a" * 12, making_ms=60_000)
    return lambda: Scripts(world.lossy, keys.script()).run(begin)


def _create(world: World) -> Callable[[], object]:
    study = Studies(world.direct).begin()
    return lambda: Studies(world.lossy).create(study, {"job": "a"}, "", STUDY)


def _join(world: World) -> Callable[[], object]:
    study = Studies(world.direct).get(_made(world))
    return lambda: Studies(world.lossy).join(study, "ada", SCREEN)


def _answer(world: World) -> Callable[[], object]:
    direct = Studies(world.direct)
    study = direct.get(_made(world))
    ada = direct.join(study, "ada", SCREEN)
    return lambda: Studies(world.lossy).answer(study, ada, 0, seen=True, seconds=1.0)


def _forget(world: World) -> Callable[[], object]:
    forget = ForgetStudy(study=_made(world))
    return lambda: Scripts(world.lossy, keys.script()).run(forget)


CASES: dict[str, Case] = {
    "begin_study": (_begin, lambda answer: answer is None),
    "create_study": (_create, lambda study: study.levels == (50, 100)),
    "join_study": (_join, lambda observer: observer.number == 0),
    "answer_study": (_answer, lambda answer: answer.seen),
    "forget_study": (_forget, lambda answer: answer is None),
}


@pytest.mark.parametrize("name", CASES)
def test_a_write_whose_answer_was_lost_may_be_repeated(
    client: redis.Redis, world: World, proxy: RedisProxy, name: str
) -> None:
    Scripts(client, keys.script()).load()
    prepare, is_answered = CASES[name]
    write = prepare(world)
    before = state(client)
    do_and_lose_the_answer(world, proxy, write)
    once = state(client)
    assert once != before
    # When the caller does it again, then all is as it was after the first time
    assert is_answered(write())
    assert state(client) == once


@pytest.mark.parametrize("name", CASES)
def test_a_write_to_another_layout_is_refused(client: redis.Redis, name: str) -> None:
    write = CASES[name][0](World(client, client))
    client.set(farm_keys.SCHEMA, versions.LAYOUT + 1)
    before = state(client)
    with pytest.raises(Incompatible, match=f"has layout {versions.LAYOUT + 1}, and this Plateau"):
        write()
    assert state(client) == before


def test_each_command_is_one_dataclass_and_one_function_in_lua_and_has_its_case() -> None:
    kinds = [one for one in vars(redis_commands).values() if isinstance(one, type)]
    names = {one.lua_name() for one in kinds if issubclass(one, Command) and one is not Command}
    assert names == OWN == CASES.keys()
