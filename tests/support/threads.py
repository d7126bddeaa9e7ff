"""Work beside a test's own."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def working(work: Callable[[], object], stop: Callable[[], object]) -> Iterator[None]:
    """Do this in a thread, which is told to stop and has done so when the context ends."""
    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        stop()
        thread.join()


@contextmanager
def beside(work: Callable[[], None], pause_s: float) -> Iterator[None]:
    """Do this again and again in a thread, while the context lasts."""
    over, failed = threading.Event(), list[BaseException]()

    def again_and_again() -> None:
        try:
            while not over.wait(pause_s):
                work()
        except BaseException as error:
            failed.append(error)
            raise

    with working(again_and_again, over.set):
        yield
    assert not failed
