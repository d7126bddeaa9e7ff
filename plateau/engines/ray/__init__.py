"""Workers by Ray: an actor for each, which runs a node's interpreter and waits for its end.

Ray ends the actors of a program that has died, and so this one has nothing to watch.
"""

import argparse
import json
import os
import signal
import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any, Final, NoReturn

from plateau.engines.contract import Crew, Task, TaskState, refuse_several_gpus
from plateau.errors import CommandFailed, needs

_ANSWER_S: Final = 5.0  #: for the head's first answer


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise CommandFailed(f"--on ray: {message}; it takes {self.format_usage()[7:].strip()}")


class Ray:
    """The workers of one run; `plateau.engines.contract.Engine` explains the methods.

    Without ``--num-cpus`` and threads, a worker takes all CPUs of the smallest node that has what
    it needs: one worker a node, where nodes are equal. Nodes that come later are used, too.
    """

    def __init__(self, options: Sequence[str], crew: Crew) -> None:
        parser = _Parser(prog="ray", add_help=False)
        parser.add_argument("--address", default=os.environ.get("RAY_ADDRESS", "auto"))
        parser.add_argument("--num-cpus", type=float)
        parser.add_argument("--num-gpus", type=float, default=0)
        parser.add_argument("--resources", type=json.loads, default={}, metavar="JSON")
        given = parser.parse_args(options)
        if given.num_gpus > 1:
            refuse_several_gpus(f"--num-gpus={given.num_gpus:g}")
        with needs("ray"):
            import ray

            from plateau.engines.ray import actor
        self._ray, self._crew = ray, crew
        self._is_ours = not ray.is_initialized()
        if self._is_ours:
            _connect(ray, given.address)
        ray.cloudpickle.register_pickle_by_value(actor)  # a node may lack Plateau
        needed = {**given.resources, **({"GPU": given.num_gpus} if given.num_gpus else {})}
        cpus = given.num_cpus or crew.threads or self._cpus_of_a_node(needed)
        self._threads = crew.threads or max(1, int(cpus))
        self._needed = {"CPU": cpus, **needed}
        self._kind = ray.remote(
            num_cpus=cpus,
            num_gpus=given.num_gpus,
            resources=given.resources,
            max_restarts=0,
            scheduling_strategy="SPREAD",
        )(actor.Worker)
        self._actors: list[tuple[Any, Any, Any]] = []  # with where it is, and how it ended
        self._ended: dict[str, Task] = {}

    def ask(self, count: int) -> None:
        """Start this many actors, which wait for a node that has room."""
        environment = {**self._crew.environment, "PLATEAU_THREADS": str(self._threads)}
        for _ in range(count):
            one = self._kind.remote()
            ran = (one, one.where.remote(), one.run.remote(self._crew.python, environment))
            self._actors.append(ran)

    def tasks(self) -> Sequence[Task]:
        """All tasks, in the order in which they were asked for."""
        waits = f"for {', '.join(f'{count:g} {name}' for name, count in self._needed.items())}"
        if not self._has_room():
            waits += "; no node has as much"
        return [self._task(str(number), waits) for number in range(len(self._actors))]

    def release(self) -> None:
        """End all actors, and the connection if it is ours."""
        for one, _, _ in self._actors:
            self._ray.kill(one)
        if self._is_ours:
            self._ray.shutdown()

    def _task(self, number: str, waits: str) -> Task:
        if number in self._ended:
            return self._ended[number]
        _, where, ran = self._actors[int(number)]
        done, _ = self._ray.wait([where, ran], num_returns=2, timeout=0)
        if where not in done:
            return Task(id=number, state=TaskState.WAITS, why=waits)
        node = ""
        try:
            node = self._ray.get(where)
            if ran not in done:
                return Task(id=number, state=TaskState.RUNS, node=node)
            code, words = self._ray.get(ran)
            state = TaskState.FAILED if code else TaskState.LEFT
            ended = Task(id=number, state=state, node=node, code=code, why=words)
        except self._ray.exceptions.RayError as error:
            # The node has died or was taken away, unless the actor never began.
            state = TaskState.LEFT if node else TaskState.FAILED
            ended = Task(id=number, state=state, node=node, why=str(error).partition("\n")[0])
        self._ended[number] = ended
        return ended

    def _nodes(self) -> list[Mapping[str, float]]:
        return [one["Resources"] for one in self._ray.nodes() if one["Alive"]]

    def _has_room(self) -> bool:
        return any(
            all(node.get(name, 0) >= count for name, count in self._needed.items())
            for node in self._nodes()
        )

    def _cpus_of_a_node(self, needed: Mapping[str, float]) -> int:
        """Its share of the CPUs, of the smallest node that has all that is needed."""
        shares = []
        for node in self._nodes():
            at_once = [node.get(name, 0) // count for name, count in needed.items()]
            if node.get("CPU") and min(at_once, default=1) >= 1:
                shares.append(int(node["CPU"] // min(at_once, default=1)))
        return max(1, min(shares, default=1))  # there may be no such node yet


def _connect(ray: Any, address: str) -> None:
    """Connect this process to the cluster, and leave its signals as they are."""
    before = signal.getsignal(signal.SIGTERM)
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    try:
        if colon and "://" not in host:  # Ray itself would try for minutes
            socket.create_connection((host, int(port)), _ANSWER_S).close()
        ray.init(address, log_to_driver=False, configure_logging=False)
    except (OSError, RuntimeError, ValueError) as error:
        said = str(error).partition("\n")[0].rstrip(":")
        raise CommandFailed(
            f"no Ray cluster answers at {address!r} ({said}); name its head, as in "
            "--on 'ray --address=HOST:6379', or start one on this machine by --address=local"
        ) from error
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, before)
