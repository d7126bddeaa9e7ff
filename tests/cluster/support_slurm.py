"""A real Slurm of two nodes on one machine: munged, slurmctld, and a slurmd for each node."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import psutil

from tests.support.processes.ports import free_ports
from tests.support.until import until

NODES = ("n1", "n2")

_CONFIGURATION = """
ClusterName=plateau
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
AuthType=auth/munge
CryptoType=crypto/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd-%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd-%n.log
MpiDefault=none
SwitchType=switch/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
AccountingStoreFlags=job_comment
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_interval=2,bf_interval=2
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
ReturnToService=2
KillWait=5
SlurmdTimeout=6
SlurmdParameters=config_overrides
MailProg=/bin/true
{nodes}
PartitionName=farm Nodes=ALL Default=YES MaxTime=INFINITE State=UP
PartitionName=urgent Nodes=ALL MaxTime=INFINITE State=UP PriorityTier=10
"""


class Slurm:
    """A cluster of the nodes `NODES`, with two processors each, until it is closed.

    Parameters
    ----------
    folder
        For all that it writes; a short path, since sockets lie in it.
    tool
        Finds programs.
    """

    def __init__(self, folder: Path, tool: Callable[[str], Path]) -> None:
        self.folder = folder
        self._tool = tool
        ports = free_ports(1 + len(NODES))
        host = socket.gethostname().partition(".")[0]
        nodes = "\n".join(
            f"NodeName={node} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=2 "
            "RealMemory=2000"
            for node, port in zip(NODES, ports[1:], strict=True)
        )
        (folder / "state").mkdir()
        for node in NODES:
            (folder / f"spool-{node}").mkdir()
        configuration = folder / "slurm.conf"
        configuration.write_text(
            _CONFIGURATION.format(host=host, port=ports[0], folder=folder, nodes=nodes)
        )
        self.environment = {"SLURM_CONF": str(configuration)}
        self._daemons: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Slurm":
        try:
            self._start_munge()
            self._start("slurmctld", "-D", "-c")
            for node in NODES:
                self.start_node(node)
            until(
                lambda: self.states() == dict.fromkeys(NODES, "idle"),
                complaint=self.logs,
                every_s=0.1,
            )
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        if error[0] is not None:
            print(self.logs())
        self._stop()

    def _stop(self) -> None:
        jobs = [one for node in NODES if node in self._daemons for one in self._family(node)]
        for name in reversed(self._daemons):
            self._daemons[name].terminate()
        for process in self._daemons.values():
            process.wait(60)
        for one in jobs:
            with contextlib.suppress(psutil.NoSuchProcess):
                one.kill()
        psutil.wait_procs(jobs, timeout=60)

    def run(self, *command: str, check: bool = True, **environment: str) -> str:
        """What a command of Slurm's prints."""
        done = subprocess.run(
            [str(self._tool(command[0])), *command[1:]],
            env={**os.environ, **self.environment, **environment},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0 or not check, done.stderr
        return done.stdout.strip()

    def states(self) -> dict[str, str]:
        """The state of each node; without a mark that it does not answer."""
        rows = self.run("sinfo", "--noheader", "-N", "-p", "farm", "-o", "%N %T", check=False)
        return {row.split()[0]: row.split()[1].rstrip("*") for row in rows.splitlines()}

    def jobs(self, *options: str) -> dict[str, str]:
        """The state of each job, and of each task of an array."""
        rows = self.run("squeue", "--noheader", "--array", "-o", "%i %T", *options)
        return dict(row.split() for row in rows.splitlines())

    def empty(self) -> None:
        """Cancel everything, and wait until it is gone."""
        self.run("scancel", "--user=root")
        until(lambda: not self.jobs())

    def end_of(self, job: str) -> tuple[str, str]:
        """How a job ended: its state and its exit code."""
        told = self.run("scontrol", "--oneliner", "show", "job", job)
        fields = dict(one.partition("=")[::2] for one in told.split())
        return fields["JobState"], fields["ExitCode"]

    def stop_controller(self) -> None:
        """Stop slurmctld, as for an upgrade."""
        controller = self._daemons.pop("slurmctld")
        controller.terminate()
        controller.wait(60)

    def start_controller(self) -> None:
        """Start slurmctld with what it knew."""
        self._start("slurmctld", "-D")

    def start_node(self, node: str) -> None:
        """Start a node's slurmd."""
        self._start("slurmd", "-D", "-N", node, name=node)

    def kill_node(self, node: str) -> None:
        """Have a node die as from a power loss: its slurmd and all that it has started."""
        slurmd = self._daemons.pop(node)
        family = self._family(node)
        slurmd.send_signal(signal.SIGKILL)
        for one in family:
            with contextlib.suppress(psutil.NoSuchProcess):
                one.kill()
        slurmd.wait()
        psutil.wait_procs(family, timeout=30)

    def processes(self) -> list[psutil.Process]:
        """Every process of a job on any node."""
        return [one for node in NODES for one in self._family(node)]

    def _family(self, node: str) -> list[psutil.Process]:
        """What a node has started: its jobs, all that those have started, and their keepers."""
        found: dict[int, psutil.Process] = {}
        for one in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                told = one.environ()
                if told.get("SLURMD_NODENAME") == node and self.environment.items() <= told.items():
                    keeper = one.parent()
                    family = [one, *one.children(recursive=True)]
                    if keeper is not None and keeper.name() == "slurmstepd":
                        family.append(keeper)
                    found.update((member.pid, member) for member in family)
        return list(found.values())

    def logs(self) -> str:
        """The last lines of every log, for a test that has failed."""
        return "\n".join(
            f"--- {log.name}\n" + "\n".join(log.read_text(errors="replace").splitlines()[-25:])
            for log in sorted(self.folder.glob("*.log"))
        )

    def _start_munge(self) -> None:
        """A munged of our own, as its own user, who alone may look into its folder."""
        key, where = self.folder / "munge.key", self.folder
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        shutil.chown(key, "munge")
        self._start(
            "munged",
            "--foreground",
            "--force",
            f"--key-file={key}",
            f"--socket={where}/munge.socket",
            f"--pid-file={where}/munge.pid",
            f"--log-file={where}/munged.log",
            f"--seed-file={where}/munge.seed",
        )
        until((where / "munge.socket").exists, complaint=self.logs)

    def _start(self, program: str, *arguments: str, name: str = "") -> None:
        with (self.folder / f"{name or program}.out.log").open("ab") as log:
            self._daemons[name or program] = subprocess.Popen(
                [str(self._tool(program)), *arguments],
                env={**os.environ, **self.environment},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )


if __name__ == "__main__":  # runs a command beside such a Slurm: python -m … COMMAND
    with tempfile.TemporaryDirectory() as made:
        Path(made).chmod(0o755)
        path = f"{os.environ['PATH']}:/usr/sbin:/sbin"
        with Slurm(Path(made), lambda name: Path(shutil.which(name, path=path) or name)) as slurm:
            done = subprocess.run(sys.argv[1:], env={**os.environ, **slurm.environment})
            slurm.empty()
    sys.exit(done.returncode)
