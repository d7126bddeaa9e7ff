"""What a render child may not take or do, whatever the scene in it comes to.

Resource limits bound its memory, its open files and the files that it writes; its time is bounded
by the supervisor. A seccomp filter then takes away what rendering has no use for: other programs,
other processes, sockets, and looking into other processes. (``RLIMIT_NPROC`` would not do: it
counts all of a user's processes and threads together, and does not bind root.) A filter needs no
privilege, binds root too, and holds for every thread; a refused call fails with ``EPERM``.

What is left: the child reads and writes files as the worker's user does.
"""

import ctypes
import errno
import os
import platform
import resource
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

# <linux/prctl.h>, <linux/seccomp.h>
_PR_SET_NO_NEW_PRIVS: Final = 38
_SECCOMP_SET_MODE_FILTER: Final = 1
_SECCOMP_FILTER_FLAG_TSYNC: Final = 1  # all threads of the process, not the caller's alone
_ALLOW: Final = 0x7FFF0000
_FAIL_WITH: Final = 0x00050000

# <linux/bpf_common.h>: the four instructions that a filter is made of
_LOAD: Final = 0x20  # a word of `struct seccomp_data`, by its offset
_JUMP_IF_EQUAL: Final = 0x15
_JUMP_IF_AT_LEAST: Final = 0x35
_JUMP_IF_ANY_BIT: Final = 0x45
_RETURN: Final = 0x06

# `struct seccomp_data`: int nr; u32 arch; u64 instruction_pointer; u64 args[6]. Little-endian.
_NUMBER: Final = 0
_ARCHITECTURE: Final = 4
_FIRST_ARGUMENT: Final = 16

_CLONE_THREAD: Final = 0x00010000


@dataclass(frozen=True)
class _Calls:
    """The system calls of one architecture by number (`asm/unistd.h`)."""

    architecture: int  #: AUDIT_ARCH_*
    seccomp: int
    clone: int
    clone3: int
    refused: tuple[int, ...]
    #: x86_64 alone: the same calls under the x32 numbers, from here on
    foreign_from: int | None = None


_MACHINES: Final = {
    "x86_64": _Calls(
        architecture=0xC000003E,
        seccomp=317,
        clone=56,
        clone3=435,
        refused=(
            *(57, 58, 59, 322),  # fork, vfork, execve, execveat
            *(41, 53, 425),  # socket, socketpair, io_uring_setup (which could open sockets)
            *(101, 310, 311, 438),  # ptrace, process_vm_readv, …_writev, pidfd_getfd
        ),
        foreign_from=0x40000000,
    ),
    "aarch64": _Calls(
        architecture=0xC00000B7,
        seccomp=277,
        clone=220,
        clone3=435,
        refused=(
            *(221, 281),  # execve, execveat
            *(198, 199, 425),  # socket, socketpair, io_uring_setup
            *(117, 270, 271, 438),  # ptrace, process_vm_readv, …_writev, pidfd_getfd
        ),
    ),
}


def limit_resources(memory_bytes: int, open_files: int, file_bytes: int) -> None:
    """Bound what this process can take, from now on and for good.

    Parameters
    ----------
    memory_bytes : int
        Address space; 0 for no limit (CUDA reserves far more than it uses).
    open_files : int
        Files open at a time.
    file_bytes : int
        Size of any file written: more fails with ``EFBIG``, since Python ignores ``SIGXFSZ``.
    """
    limits = [
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NOFILE, open_files),
        (resource.RLIMIT_FSIZE, file_bytes),
    ]
    if memory_bytes:
        limits.append((resource.RLIMIT_AS, memory_bytes))
    for kind, most in limits:
        _, hard = resource.getrlimit(kind)
        most = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (most, most))


def refuse_processes_and_network() -> str | None:
    """Take programs, processes and sockets away from all threads; return why not, if not.

    Sockets and threads that are there go on, and new threads can be started.

    Returns
    -------
    str or None
        None where the kernel took the filter; otherwise what is missing, as a sentence's end.
    """
    calls = _MACHINES.get(platform.machine())
    if not sys.platform.startswith("linux") or calls is None or sys.maxsize < 2**32:
        return f"there is no filter for {sys.platform} on {platform.machine()}"
    program = b"".join(_program(calls))
    code = ctypes.create_string_buffer(program, len(program))
    # struct sock_fprog: unsigned short len; struct sock_filter *filter
    header = struct.pack("@HP", len(program) // 8, ctypes.addressof(code))
    libc = ctypes.CDLL(None, use_errno=True)
    # Without this, only root could set a filter; with it, set-user-id programs stay powerless.
    if libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        return f"prctl failed: {os.strerror(ctypes.get_errno())}"
    arguments = (calls.seccomp, _SECCOMP_SET_MODE_FILTER, _SECCOMP_FILTER_FLAG_TSYNC)
    if libc.syscall(*map(ctypes.c_long, arguments), ctypes.c_char_p(header)) != 0:
        return f"seccomp failed: {os.strerror(ctypes.get_errno())}"
    return None


def _program(calls: _Calls) -> Iterator[bytes]:
    """Yield the filter's instructions: `struct sock_filter` {u16 code; u8 jt, jf; u32 k}."""
    refuse = _instruction(_RETURN, _FAIL_WITH | errno.EPERM)
    # Another architecture's calls have other numbers (int 0x80 on x86_64): refuse them all.
    yield _instruction(_LOAD, _ARCHITECTURE)
    yield _instruction(_JUMP_IF_EQUAL, calls.architecture, over_if=1)
    yield refuse
    yield _instruction(_LOAD, _NUMBER)
    if calls.foreign_from is not None:
        yield _instruction(_JUMP_IF_AT_LEAST, calls.foreign_from, over_unless=1)
        yield refuse
    for number in calls.refused:
        yield _instruction(_JUMP_IF_EQUAL, number, over_unless=1)
        yield refuse
    # clone3 has its flags in memory, where a filter cannot look. glibc then falls back on clone.
    yield _instruction(_JUMP_IF_EQUAL, calls.clone3, over_unless=1)
    yield _instruction(_RETURN, _FAIL_WITH | errno.ENOSYS)
    yield _instruction(_JUMP_IF_EQUAL, calls.clone, over_unless=3)
    yield _instruction(_LOAD, _FIRST_ARGUMENT)
    yield _instruction(_JUMP_IF_ANY_BIT, _CLONE_THREAD, over_if=1)
    yield refuse
    yield _instruction(_RETURN, _ALLOW)


def _instruction(code: int, operand: int, over_if: int = 0, over_unless: int = 0) -> bytes:
    """Pack one instruction: jumps go over so many, where the condition holds or does not."""
    return struct.pack("=HBBI", code, over_if, over_unless, operand)
