"""From ``--on`` to a fleet: the engine that it names, and what its nodes need of this machine."""

import os
import secrets
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

from plateau.engines.blob_server import serving
from plateau.engines.contract import GROUP, Crew, Engine
from plateau.engines.fleet import Fleet
from plateau.engines.front import Front
from plateau.errors import CommandFailed
from plateau.extensions import offered
from plateau.farm.blobs.store import Blobs
from plateau.farm.ledger.pairing import check_pair
from plateau.farm.ledger.workers import Workers
from plateau.farm.redis.link import connect
from plateau.processes.tree import Tree


@contextmanager
def nodes(on: str, tree: Tree, workers: int) -> Iterator[Fleet]:
    """Workers of an engine for the tree, which has a secret, while the context lasts."""
    with ExitStack() as stack:
        engine, options = named(on)
        client = stack.enter_context(connect(tree.redis_url))
        blobs = Blobs(tree.blobs)
        check_pair(client, blobs)  # no node may mark a store
        port = stack.enter_context(serving(blobs, tree.secret))
        front = Front.here(tree.redis_port, port, tree.secret)
        crew = Crew(
            name=f"plateau-{secrets.token_hex(4)}",
            python=os.environ.get("PLATEAU_PYTHON") or sys.executable,
            environment=front.environment(tree.settings),
            threads=tree.settings.threads,
        )
        yield stack.enter_context(
            Fleet(engine(options, crew), front, crew, workers, Workers(client).living)
        )


def named(on: str) -> tuple[Callable[[Sequence[str], Crew], Engine], list[str]]:
    """The engine that ``--on`` names, and the options that follow; `CommandFailed` for none."""
    try:
        name, *options = shlex.split(on) or [""]
    except ValueError as error:
        raise CommandFailed(f"{on!r} names no engine: {error}") from None
    engines = {entry.name: engine for entry, engine in offered(GROUP)}
    if name not in engines:
        raise CommandFailed(f"there is no engine {name!r}; there are {', '.join(sorted(engines))}")
    return engines[name], options
