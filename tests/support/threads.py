"""Work beside a test's own."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


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

    thread = threading.Thread(target=again_and_again)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
    assert not failed
