"""Hosts with addresses of their own, in network namespaces around a router that can fail.

What a network loses it loses in the router, so that no host is told of it: a packet is sent and
does not come. A test run that is killed leaves its namespaces, and processes in them, behind: the
next one ends and removes them.
"""

import contextlib
import fcntl
import os
import re
import secrets
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Final

Rule = tuple[str, ...]

_PREFIX: Final = "plateau-"
_ROUTER: Final = "router"
_NAME: Final = re.compile(rf"{_PREFIX}([0-9a-f]{{6}})-\S+")


class Network:
    """Hosts around a router; needs root.

    Parameters
    ----------
    tool
        Finds ``ip`` and ``iptables-legacy``.
    hosts
        Their names, of at most fifteen letters.
    """

    def __init__(self, tool: Callable[[str], Path], *hosts: str) -> None:
        self._ip = str(tool("ip"))
        self._iptables = str(tool("iptables-legacy"))
        self._ss = str(tool("ss"))
        self.hosts = hosts
        self._rules: dict[str, list[Rule]] = {}
        self._token = secrets.token_hex(3)
        _remove_stale(self._ip)

    def __enter__(self) -> "Network":
        self._lock = _lock_file(self._token).open("w")
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        try:
            self._build()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        _remove(self._ip, self._token)
        self._lock.close()

    def _build(self) -> None:
        self._add(_ROUTER)
        self._run(*self._inside(_ROUTER), "sh", "-c", "echo 1 > /proc/sys/net/ipv4/ip_forward")
        for number, host in enumerate(self.hosts, 1):
            self._add(host)
            gateway = f"10.77.{number}.1"
            self._in(_ROUTER, "link", "add", "name", host, "type", "veth",
                     "peer", "name", "eth0", "netns", self._space(host))  # fmt: skip
            self._in(_ROUTER, "addr", "add", f"{gateway}/24", "dev", host)
            self._in(_ROUTER, "link", "set", "dev", host, "up")
            self._in(host, "addr", "add", f"{self.address(host)}/24", "dev", "eth0")
            self._in(host, "link", "set", "dev", "eth0", "up")
            self._in(host, "route", "add", "default", "via", gateway)

    def address(self, host: str) -> str:
        """The host's address."""
        return f"10.77.{self.hosts.index(host) + 1}.2"

    def on(self, host: str) -> tuple[str, ...]:
        """What a command begins with that is to run on the host."""
        return self._inside(host)

    # Faults. Each lasts until its host is healed.

    def cut(self, host: str) -> None:
        """Lose whatever goes to the host or comes from it."""
        self.cut_from(host)
        self.cut_to(host)

    def cut_from(self, host: str) -> None:
        """Lose what comes from the host; it still hears the others."""
        self._drop(host, "-i", host)

    def cut_to(self, host: str) -> None:
        """Lose what goes to the host; the others still hear it."""
        self._drop(host, "-o", host)

    def lose(self, host: str, share: float) -> None:
        """Lose this share of the packets to and from the host, by chance."""
        chance = ("-m", "statistic", "--mode", "random", "--probability", f"{share:g}")
        self._drop(host, "-i", host, *chance)
        self._drop(host, "-o", host, *chance)

    def forget_connections(self, host: str) -> int:
        """Lose what belongs to the TCP connections that the host has now; returns how many.

        As a firewall or a NAT does that was restarted: new connections come through, and of the old
        ones nobody is told.
        """
        lines = self._run(*self._inside(host), self._ss, "-tnH", "state", "established")
        connections = [line.split()[2:4] for line in lines.splitlines()]
        for ours, theirs in connections:
            port, (address, other_port) = ours.rpartition(":")[2], theirs.rsplit(":", 1)
            self._drop(host, "-i", host, "-p", "tcp", "--sport", port,
                       "-d", address, "--dport", other_port)  # fmt: skip
            self._drop(host, "-o", host, "-p", "tcp", "--dport", port,
                       "-s", address, "--sport", other_port)  # fmt: skip
        return len(connections)

    def heal(self, *hosts: str) -> None:
        """End what ails these hosts, or all."""
        for host in hosts or self.hosts:
            for rule in self._rules.pop(host, []):
                self._filter("-D", rule)

    def _drop(self, host: str, *rule: str) -> None:
        self._filter("-A", rule)
        self._rules.setdefault(host, []).append(rule)

    def _filter(self, action: str, rule: Rule) -> None:
        command = (self._iptables, "-w", "20", action, "FORWARD", *rule, "-j", "DROP")
        self._run(*self._inside(_ROUTER), *command)

    def _space(self, host: str) -> str:
        return f"{_PREFIX}{self._token}-{host}"

    def _inside(self, host: str) -> tuple[str, ...]:
        return ("nsenter", f"--net=/run/netns/{self._space(host)}")

    def _add(self, host: str) -> None:
        self._run(self._ip, "netns", "add", self._space(host))
        self._in(host, "link", "set", "dev", "lo", "up")

    def _in(self, host: str, *command: str) -> None:
        self._run(self._ip, "-n", self._space(host), *command)

    @staticmethod
    def _run(*command: str) -> str:
        return subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout


def _lock_file(token: str) -> Path:
    """Who has these namespaces keeps a lock on it, which the kernel takes from the dead."""
    return Path(tempfile.gettempdir()) / f"plateau-network-{token}.lock"


def _remove_stale(ip: str) -> None:
    """Remove the namespaces of runs that were killed, and end what they left running there."""
    tokens = {token for token, _ in _spaces(ip)}
    for token in tokens:
        with _lock_file(token).open("a") as file:
            if _locks(file):
                _remove(ip, token)


def _locks(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _spaces(ip: str) -> Iterator[tuple[str, str]]:
    """Token and name of each namespace of ours."""
    listed = subprocess.run([ip, "netns", "list"], check=True, text=True, stdout=subprocess.PIPE)
    for line in listed.stdout.splitlines():
        match = _NAME.match(line)
        if match:
            yield match[1], match[0]


def _remove(ip: str, token: str) -> None:
    for known, name in list(_spaces(ip)):
        if known == token:
            pids = subprocess.run([ip, "netns", "pids", name], check=True, stdout=subprocess.PIPE)
            for pid in pids.stdout.split():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(int(pid), signal.SIGKILL)
            subprocess.run([ip, "netns", "delete", name], check=True)
    _lock_file(token).unlink(missing_ok=True)
