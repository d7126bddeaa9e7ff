"""What Mitsuba says of a scene, and raises, as people are to read it.

Part of the render child: imports Mitsuba.
"""

import fcntl
import os
import stat
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import mitsuba as mi

from plateau.worker.renderers.causes import first_words, without_details, without_folders
from plateau.worker.renderers.contract import SceneError

#: `scene_errors` itself and the function that uses it: Mitsuba's C++ has no frames of its own.
_OUR_FRAMES = 2

#: In what Mitsuba and Dr.Jit say where their C++ has no memory.
_OUT_OF_MEMORY: Final = ("std::bad_alloc", "jit_malloc(): out of memory")

_MOST_LOG_BYTES: Final = 2**24


@contextmanager
def scene_errors(*folders: Path) -> Iterator[None]:
    """Turn what Mitsuba raises into `SceneError`, save for `MemoryError`, which passes.

    Whatever it is, the same scene would raise it again. Where Python code of Mitsuba's or of a
    plugin raises it, the traceback is printed for the slice's log, and the message is one line.

    Parameters
    ----------
    folders : Path
        Where this machine keeps the scene; messages are told without them.
    """
    try:
        yield
    except (SceneError, MemoryError):
        raise
    except Exception as error:
        message = without_folders(str(error).strip(), folders) or type(error).__name__
        if lack := next(filter(_is_lack_of_memory, _causes(error)), None):
            raise MemoryError(str(lack)) from error
        first = first_words(message)
        if len(traceback.extract_tb(error.__traceback__)) > _OUR_FRAMES:
            traceback.print_exception(error)
            first = f"{type(error).__name__}: {' '.join(first.split())}"
        elif first != message:
            print(message, file=sys.stderr, flush=True)
        raise SceneError(first) from error


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """The error, and those that led to it: a loop of Dr.Jit's tells only of another."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def _is_lack_of_memory(error: BaseException) -> bool:
    return any(words in str(error) for words in _OUT_OF_MEMORY)


@contextmanager
def mitsuba_log() -> Iterator[Callable[[], str]]:
    """Have Mitsuba print what it loads; yield what returns that.

    Should the process die, its supervisor finds there at which file. Else warnings alone are left.
    """
    words = 1  # Mitsuba writes there, whatever Python's standard output is
    begin, mode = os.fstat(words).st_size, fcntl.fcntl(words, fcntl.F_GETFL) & os.O_ACCMODE
    if not stat.S_ISREG(os.fstat(words).st_mode) or mode != os.O_RDWR:  # it is no child's log
        yield lambda: ""
        return

    def said() -> str:
        return os.pread(words, _MOST_LOG_BYTES, begin).decode(errors="replace")

    mi.set_log_level(mi.LogLevel.Debug)
    try:
        yield said
    finally:
        mi.set_log_level(mi.LogLevel.Warn)
        left = without_details(said())
        if os.fstat(words).st_size > begin:
            os.ftruncate(words, begin)
            os.lseek(words, 0, os.SEEK_END)
        print(left, end="", flush=True)


def explained(message: str, state: Any, nodes: Sequence[Any]) -> str:
    """Return an error of Mitsuba's with what it does not say: the node, its file, what to do."""
    nodes = list(nodes)
    for index, node in enumerate(nodes[1:], 1):
        place = mi.parser.file_location(state, node)
        if place in message:
            message = message.replace(place, f"{place}, {_path_to(index, nodes)}")
            file = Path(str(node.props.get("filename", ""))).name
            message += f" ({file})" if file not in message else ""
            break
    if "unreferenced propert" in message:
        message += "\nThe plugin knows no such property: correct its name, or delete it."
    return message


def _path_to(index: int, nodes: Sequence[Any]) -> str:
    """Return a node's names from the scene down, or its type where it has no name: ball.bsdf."""
    node = nodes[index]
    for above, parent in enumerate(nodes):
        for key in parent.props.keys():  # noqa: SIM118 - a Mitsuba object, and no mapping
            value = parent.props[key]
            if isinstance(value, mi.Properties.ResolvedReference) and value.index() == index:
                name = node.props.id() or ("" if key.startswith("_arg") else key)
                path = f"{_path_to(above, nodes)}." if above else ""
                return path + (name or node.props.plugin_name())
    return str(node.props.plugin_name())
