"""Children that end with their parent."""

from tests.support.processes.relatives import orphan_of

PARENT = """
import os, signal, subprocess, time
from plateau.farm.process.lifecycle import die_with_parent
signal.signal(signal.SIGTERM, print)
parent, arrange = os.getpid(), die_with_parent()
def late():
    os.write(1, b"%d\\n" % os.getpid())
    while os.getppid() == parent: time.sleep(0.01)
    arrange()
subprocess.run(["sleep", "300"], preexec_fn=late)
"""


def test_a_child_whose_parent_is_killed_before_it_is_a_program_ends() -> None:
    orphan_of(PARENT).wait(60)
