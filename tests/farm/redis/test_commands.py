"""A command is one dataclass and one Lua function, and what it carries comes back to the bit."""

import importlib
import math
import pkgutil
from collections.abc import Iterator
from typing import Any

import pytest
import redis

from plateau.farm.ledger.jobs import Jobs
from plateau.farm.ledger.ownership import Ownerships
from plateau.farm.ledger.queue import SliceQueue
from plateau.farm.model.job import CurvePoint
from plateau.farm.model.spec import JobSpec
from plateau.farm.redis import commands
from plateau.farm.redis.commands.command import Command
from plateau.farm.redis.commands.owners import Renew
from plateau.farm.redis.commands.scenes import RememberScene
from plateau.farm.redis.scripts import Scripts
from tests.support.farms.ledger_farm import lease_scalar, own, record_of
from tests.support.redis.redis_commands import commands as lua_commands

#: Numbers of which fewer digits would be others.
EXACT = [0.1 + 0.2, math.pi * 1e-300, 1 / 3, 12345.678901234567, 5e-324]
NOTHING: dict[str, object] = {"estimate_pixels": None, "estimate_fraction": None}
WORDS = 'a "quoted" word, a \\ and a /, ünïcode, 🎨, \x00 and \x7f'


def _kinds(base: type[Command[Any]] = Command) -> Iterator[type[Command[Any]]]:
    for kind in base.__subclasses__():
        if kind.__module__.startswith(commands.__name__):
            yield kind
            yield from _kinds(kind)


def test_each_command_is_one_dataclass_and_one_function_in_lua() -> None:
    for module in pkgutil.iter_modules(commands.__path__, f"{commands.__name__}."):
        importlib.import_module(module.name)
    names = [kind.lua_name() for kind in _kinds() if not kind.__name__.endswith("Command")]
    assert sorted(names) == sorted(lua_commands())


def test_a_slice_comes_back_to_the_bit(client: redis.Redis) -> None:
    jobs, owners, queue = Jobs(client), Ownerships(client, 60), SliceQueue(client, "w", 60)
    job = jobs.create(JobSpec(slice_spp=25), name=WORDS, scene_sha256="00").job
    owners.plan(own(owners, job.id), range(len(EXACT)))
    records = []
    for index, number in enumerate(EXACT):
        lease = lease_scalar(queue)
        seeds = (2**32 - 10 * (index + 1), 2**32 - 10 * index - 1)
        blob = f"partial {index} {WORDS}"
        record = record_of(lease, seeds, blob=blob, sha256="ab" * 32, render_s=number)
        records.append(record)
        done = queue.commit(lease, record, width=8, height=4, notes=(WORDS,), said=WORDS)
        assert done == "committed"
    assert owners.committed(job.id, range(99)) == records
    assert [one["render_s"] for one in jobs.ledger(job.id).values()] == EXACT
    found = jobs.get(job.id)
    assert (found.name, found.notes) == (WORDS, (WORDS,))
    assert {one.text for one in jobs.log(job.id)} == {WORDS}


def test_a_point_comes_back_to_the_bit(client: redis.Redis) -> None:
    jobs, owners = Jobs(client), Ownerships(client, 60)
    job = jobs.create(JobSpec(), name="box", scene_sha256="00").job
    owned = own(owners, job.id)
    values = {"visible_pixels": 2**53 + 1, "visible_fraction": 0.1 + 0.2, "slope": 1 / 3}
    owners.append_point(owned, 100, {"spp": 100, **values, **NOTHING})
    (point,) = jobs.curve(job.id)
    assert {name: getattr(point, name) for name in values} == values
    # Who follows the job hears of the very same point
    (told,) = [one.data for one in jobs.events(job.id) if one.type == "point"]
    assert CurvePoint.model_validate(told) == point
    assert jobs.get(job.id).visible_fraction == 0.1 + 0.2


def test_what_has_no_items_comes_back_as_such(client: redis.Redis) -> None:
    assert Scripts(client).run(Renew(lease_ms=1000, owned=())) == ()
    assert Scripts(client).run_each([]) == []


def test_what_json_cannot_say_is_refused(client: redis.Redis) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        Scripts(client).run(RememberScene(sha256="00", summary=math.nan))  # type: ignore[arg-type]
