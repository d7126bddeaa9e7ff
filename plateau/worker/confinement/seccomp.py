"""A seccomp filter: the system calls that rendering has no use for fail with ``EPERM``.

A filter needs no privilege, binds root too, and holds for every thread. It sees numbers and
arguments, not what these point to, so files are left to `plateau.worker.confinement.landlock`.
"""

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from plateau.farm.process.lifecycle import c_call
from plateau.worker.confinement.capabilities import refuse_new_privileges

# <linux/seccomp.h>
_SECCOMP_SET_MODE_FILTER: Final = 1
_SECCOMP_FILTER_FLAG_TSYNC: Final = 1  # all threads of the process, not the caller's alone
_ALLOW: Final = 0x7FFF0000
_FAIL_WITH: Final = 0x00050000

# <linux/bpf_common.h>: the four instructions that a filter is made of
_LOAD: Final = 0x20  # a word of `struct seccomp_data`, by its offset
_JUMP_IF_EQUAL: Final = 0x15
_JUMP_IF_AT_LEAST: Final = 0x35
_JUMP_IF_ANY_BIT: Final = 0x45
_AND: Final = 0x54
_RETURN: Final = 0x06

# `struct seccomp_data`: int nr; u32 arch; u64 instruction_pointer; u64 args[6]. Little-endian.
_NUMBER: Final = 0
_ARCHITECTURE: Final = 4
_FIRST_ARGUMENT: Final = 16
_SECOND_ARGUMENT: Final = 24

_CLONE_THREAD: Final = 0x00010000

# <sys/socket.h>
_AF_UNIX: Final = 1
_SOCK_SEQPACKET: Final = 5
_KIND_OF_SOCKET: Final = 0xF  # flags stand above it


@dataclass(frozen=True)
class _Machine:
    """An architecture, as the kernel's filters see it."""

    architecture: int  #: AUDIT_ARCH_*
    column: int  #: its numbers in the tables below
    seccomp: int
    clone: int
    #: x86_64 alone: the same calls under the x32 numbers, from here on
    foreign_from: int | None = None


_MACHINES: Final = {
    "x86_64": _Machine(0xC000003E, column=0, seccomp=317, clone=56, foreign_from=0x40000000),
    "aarch64": _Machine(0xC00000B7, column=1, seccomp=277, clone=220),
}

_CLONE3: Final = 435

#: Calls by their numbers on x86_64 and aarch64 (`asm/unistd.h`); 0 where there is none.
_REFUSED: Final = {
    # other programs and processes
    "fork": (57, 0),
    "vfork": (58, 0),
    "execve": (59, 221),
    "execveat": (322, 281),
    # sockets, of which `_SOCKET` is one more; io_uring could open them, too
    "socketpair": (53, 199),
    "io_uring_setup": (425, 425),
    # looking into other processes
    "ptrace": (101, 117),
    "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271),
    "process_madvise": (440, 440),
    "process_mrelease": (448, 448),
    "pidfd_open": (434, 434),
    "pidfd_getfd": (438, 438),
    "kcmp": (312, 272),
    # signals, other than by the calls below
    "tkill": (200, 130),
    "rt_sigqueueinfo": (129, 138),
    "pidfd_send_signal": (424, 424),
    # the scheduling of other processes of the same user, and the place of their memory
    "setpriority": (141, 140),
    "ioprio_set": (251, 30),
    "sched_setscheduler": (144, 119),
    "sched_setparam": (142, 118),
    "sched_setattr": (314, 274),
    "migrate_pages": (256, 238),
    "move_pages": (279, 239),
    # memory, semaphores, messages and keys that processes share without a file
    "shmget": (29, 194),
    "shmat": (30, 196),
    "shmctl": (31, 195),
    "semget": (64, 190),
    "semctl": (66, 191),
    "semop": (65, 193),
    "semtimedop": (220, 192),
    "msgget": (68, 186),
    "msgctl": (71, 187),
    "msgsnd": (69, 189),
    "msgrcv": (70, 188),
    "mq_open": (240, 180),
    "mq_unlink": (241, 181),
    "keyctl": (250, 219),
    "add_key": (248, 217),
    "request_key": (249, 218),
    # namespaces, in which it would be root again
    "unshare": (272, 97),
    "setns": (308, 268),
    # files without their names: Landlock sees no folder around them
    "open_by_handle_at": (304, 265),
    # large parts of the kernel that rendering does not need
    "bpf": (321, 280),
    "perf_event_open": (298, 241),
    "userfaultfd": (323, 282),
    # owners, permissions and times of files, which Landlock does not cover
    "utime": (132, 0),
    "utimes": (235, 0),
    "futimesat": (261, 0),
    "utimensat": (280, 88),
    "chmod": (90, 0),
    "fchmod": (91, 52),
    "fchmodat": (268, 53),
    "fchmodat2": (452, 452),
    "chown": (92, 0),
    "lchown": (94, 0),
    "fchown": (93, 55),
    "fchownat": (260, 54),
    "setxattr": (188, 5),
    "lsetxattr": (189, 6),
    "fsetxattr": (190, 7),
    "setxattrat": (463, 463),
    "removexattr": (197, 14),
    "lremovexattr": (198, 15),
    "fremovexattr": (199, 16),
    "removexattrat": (466, 466),
}

_SOCKET: Final = {"socket": (41, 198)}

#: Calls that concern the process of their first argument: only 0 and its own id are allowed.
_ABOUT_ITSELF_ALONE: Final = {
    "kill": (62, 129),
    "tgkill": (234, 131),
    "rt_tgsigqueueinfo": (297, 240),
    "prlimit64": (302, 261),
    "sched_setaffinity": (203, 122),
}


def refuse_calls(*, but_packets: bool = False) -> None:
    """Refuse these calls to all threads of this process, for good.

    Open sockets and running threads are not affected, and new threads can start.

    Parameters
    ----------
    but_packets : bool
        Allow sockets of one sort: of packets within this machine (``AF_UNIX``, ``SOCK_SEQPACKET``).
        They reach no server that listens for streams, as Redis, D-Bus and Docker do.

    Raises
    ------
    OSError
        No filter exists for this machine, or the kernel refuses it.
    """
    machine = _MACHINES.get(platform.machine())
    if not sys.platform.startswith("linux") or machine is None or sys.maxsize < 2**32:
        where = f"{sys.platform} on {platform.machine()}"
        raise OSError(errno.ENOSYS, f"there is no filter for {where}")
    program = b"".join(_program(machine, but_packets))
    code = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: unsigned short len; struct sock_filter *filter
    header = struct.pack("@HP", len(program) // 8, ctypes.addressof(code))
    refuse_new_privileges()
    numbers = (machine.seccomp, _SECCOMP_SET_MODE_FILTER, _SECCOMP_FILTER_FLAG_TSYNC)
    arguments = (*map(ctypes.c_long, numbers), ctypes.c_char_p(header))
    if c_call("syscall", *arguments, what="seccomp") != 0:
        raise OSError(errno.ESRCH, "seccomp: a thread cannot take the filter")


def _program(machine: _Machine, but_packets: bool) -> Iterator[bytes]:
    """Yield the filter's instructions: `struct sock_filter` {u16 code; u8 jt, jf; u32 k}."""
    refuse = _instruction(_RETURN, _FAIL_WITH | errno.EPERM)
    allow = _instruction(_RETURN, _ALLOW)
    # Another architecture's calls have other numbers (int 0x80 on x86_64): refuse them all.
    yield _instruction(_LOAD, _ARCHITECTURE)
    yield _instruction(_JUMP_IF_EQUAL, machine.architecture, over_if=1)
    yield refuse
    yield _instruction(_LOAD, _NUMBER)
    if machine.foreign_from is not None:
        yield _instruction(_JUMP_IF_AT_LEAST, machine.foreign_from, over_unless=1)
        yield refuse
    for number in _numbers(_REFUSED, machine):
        yield _instruction(_JUMP_IF_EQUAL, number, over_unless=1)
        yield refuse
    for number in _numbers(_SOCKET, machine):
        if but_packets:
            yield _instruction(_JUMP_IF_EQUAL, number, over_unless=7)
            yield _instruction(_LOAD, _FIRST_ARGUMENT)
            yield _instruction(_JUMP_IF_EQUAL, _AF_UNIX, over_unless=3)
            yield _instruction(_LOAD, _SECOND_ARGUMENT)
            yield _instruction(_AND, _KIND_OF_SOCKET)
            yield _instruction(_JUMP_IF_EQUAL, _SOCK_SEQPACKET, over_if=1)
            yield refuse
            yield allow
        else:
            yield _instruction(_JUMP_IF_EQUAL, number, over_unless=1)
            yield refuse
    for number in _numbers(_ABOUT_ITSELF_ALONE, machine):
        yield _instruction(_JUMP_IF_EQUAL, number, over_unless=5)
        yield _instruction(_LOAD, _FIRST_ARGUMENT)
        yield _instruction(_JUMP_IF_EQUAL, 0, over_if=2)
        yield _instruction(_JUMP_IF_EQUAL, os.getpid(), over_if=1)
        yield refuse
        yield allow
    # clone3 has its flags in memory, which a filter cannot read. glibc then falls back on clone.
    yield _instruction(_JUMP_IF_EQUAL, _CLONE3, over_unless=1)
    yield _instruction(_RETURN, _FAIL_WITH | errno.ENOSYS)
    yield _instruction(_JUMP_IF_EQUAL, machine.clone, over_unless=3)
    yield _instruction(_LOAD, _FIRST_ARGUMENT)
    yield _instruction(_JUMP_IF_ANY_BIT, _CLONE_THREAD, over_if=1)
    yield refuse
    yield allow


def _numbers(table: dict[str, tuple[int, int]], machine: _Machine) -> list[int]:
    return [numbers[machine.column] for numbers in table.values() if numbers[machine.column]]


def _instruction(code: int, operand: int, over_if: int = 0, over_unless: int = 0) -> bytes:
    """Pack one instruction; a jump skips this many, if its condition holds or if it does not."""
    return struct.pack("=HBBI", code, over_if, over_unless, operand)
