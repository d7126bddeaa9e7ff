"""Threads share the rows of an image, and no bit depends on how many there are."""

import os

import numpy as np
import pytest

from plateau.metric import rows
from plateau.metric.compiled.denoise import denoised
from plateau.metric.cvvdp import DISPLAYS, ColorVideoVDP


@pytest.fixture
def on_threads(monkeypatch: pytest.MonkeyPatch):
    def choose(threads: int) -> None:
        monkeypatch.setattr(rows, "LEAST_PIXELS", 1)
        monkeypatch.setattr(rows, "_threads", lambda: threads)

    return choose


@pytest.mark.parametrize("shape", [(37, 51), (4, 200), (130, 64)])
def test_the_eye_and_the_filter_see_the_same_on_any_number_of_threads(on_threads, shape):
    image, noise = np.random.default_rng(5).random((2, *shape, 3), np.float32)
    eye, found = ColorVideoVDP(DISPLAYS["standard_fhd"]), []
    for threads in (1, 2, 5, 12):
        on_threads(threads)
        percepts = eye.percept(image), eye.percept(noise)
        quality = eye.compare(*percepts, heat=True, zone_size=16)
        clean = denoised(image, noise)
        found.append(
            (quality.jod, quality.heat.tobytes(), quality.zones.tobytes(), clean.tobytes())
        )
    assert len(set(found)) == 1


def test_an_error_in_any_share_is_raised(on_threads):
    on_threads(3)

    def kernel(first: int, last: int) -> None:
        if last == 9:
            raise LookupError("the last share")

    with pytest.raises(LookupError, match="the last share"):
        rows.by_rows(kernel, (9, 4))


def test_a_forked_process_has_threads_of_its_own(on_threads):
    on_threads(3)
    out = np.zeros((9, 4))
    rows.by_rows(lambda first, last: out[first:last].fill(1), out.shape)
    child = os.fork()
    if not child:
        rows.by_rows(lambda first, last: out[first:last].fill(2), out.shape)
        assert rows.beside(lambda: 3).result(timeout=60) == 3
        os._exit(0 if (out == 2).all() else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert (out == 1).all()
