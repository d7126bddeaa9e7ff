"""What a rule keeps of the images that it is shown: what it says, and nothing beside it."""

import gc
import math
from types import FunctionType, ModuleType

import numpy as np
import pytest

from plateau.metric import Evidence, Half, VisibleDifferences, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.rules import rules
from tests.support.images import PAPER

SIDE = 96
PIXELS = SIDE * SIDE
#: Bytes a pixel: an image as float32, and a percept with its eight levels, two chromas and a mask.
IMAGE, PERCEPT = 12, 41
EVALUATIONS = 12

MAKERS = {
    **{name: lambda name=name: create_rule(name) for name in rules()},
    "multiple, window 8": lambda: create_rule("multiple", window=8),
    "myszkowski, alpha 0.3": lambda: create_rule("myszkowski", alpha=0.3),
}


def evidence(number, metric):
    """A noisy grey that gets better, in two halves."""
    noise = np.random.default_rng(number).normal(0, 0.3 / number**0.5, (2, SIDE, SIDE, 3))
    even, odd = (np.float32(0.35) + noise).astype(np.float32)
    halves = Half(even, 50 * number), Half(odd, 50 * number)
    return Evidence(100 * number, (even + odd) / 2, halves, metric)


def held_bytes(rule):
    """The size of all arrays that can be reached from the rule, each once."""
    seen, arrays, todo = set(), {}, [rule]
    while todo:
        one = todo.pop()
        if id(one) in seen or isinstance(one, (type, ModuleType, FunctionType)):
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):
                one = one.base
            arrays[id(one)] = one
        else:
            todo += gc.get_referents(one)
    return sum(array.nbytes for array in arrays.values())


def stored_images(rule, evaluations):
    if rule.name == "myszkowski":  # all from a share of the samples on, and the one before
        return evaluations - max(math.floor(rule.alpha * evaluations) - 1, 0)
    most = {"successive": 1, "reverse": 1, "multiple": getattr(rule, "window", 0)}
    return min(evaluations, most.get(rule.name, 0))


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_its_memory_holds_as_many_images_as_it_says(make):
    rule, metric = make(), VisibleDifferences(PAPER)
    assert stored_images(rule, 0) == len(rule.memory().images) == 0
    for number in range(1, EVALUATIONS + 1):
        rule.judge(evidence(number, metric))
        images = rule.memory().images.values()
        assert len(images) == stored_images(rule, number)
        assert all(image.nbytes == IMAGE * PIXELS for image in images)


@pytest.mark.parametrize("predictor", [VisibleDifferences, CompiledVisibleDifferences])
@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_and_its_process_no_more_than_these(make, predictor):
    rule, metric = make(), predictor(PAPER)
    # `reverse` works its one image out once and for all.
    percept = PERCEPT if rule.name == "reverse" else 0
    for number in range(1, EVALUATIONS + 1):
        rule.judge(evidence(number, metric))
        images = IMAGE * stored_images(rule, number)
        # Half a byte a pixel is left for what does not grow with the image.
        assert images * PIXELS <= held_bytes(rule) <= (images + percept + 0.5) * PIXELS
