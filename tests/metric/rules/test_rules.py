"""What all rules have in common, and the simplest of them."""

import io
import json

import numpy as np
import pytest

from plateau.metric import Evidence, Half, VisibleDifferences, create_rule
from plateau.metric.compiled import CompiledVisibleDifferences
from plateau.metric.rules.base import Memory
from plateau.metric.rules.fixed import Fixed
from plateau.metric.rules.reverse import Reverse
from plateau.rules import rules
from tests.support.images import PAPER

METRIC = VisibleDifferences(PAPER)
GREY = np.full((8, 8, 3), 0.35, np.float32)


def evidence(spp, halves=None):
    return Evidence(spp, GREY, halves, METRIC)


def noisy(spp, sigma):
    """A grey with so much noise in each of two halves."""
    noise = np.random.default_rng(spp).normal(0, sigma, (2, 24, 32, 3))
    even, odd = (np.float32(0.35) + noise).astype(np.float32)
    return Evidence(spp, (even + odd) / 2, (Half(even, spp // 2), Half(odd, spp // 2)), METRIC)


class TestCreateRule:
    def test_a_rule_is_named_and_takes_the_papers_values(self):
        assert create_rule("reverse") == Reverse(window=5, epsilon=0.1)
        assert create_rule("fixed") == Fixed(spp=10_000)
        assert create_rule("reverse", window=8, epsilon=0.5) == Reverse(window=8, epsilon=0.5)

    @pytest.mark.parametrize(
        ("name", "parameter", "value", "words"),
        [
            ("revers", "window", 5, r"no rule 'revers'; .* fixed, .*reverse"),
            ("reverse", "windw", 5, "no parameter 'windw'; it has window, epsilon"),
            ("reverse", "_points", [], "no parameter '_points'"),
            ("fixed", "spp", 2.5, "spp|'fixed'"),
            ("fixed", "spp", True, "spp|'fixed'"),
            ("reverse", "window", 5.0, "window|'reverse'"),
            ("reverse", "window", "5", "window|'reverse'"),
            ("reverse", "epsilon", "0.1", "epsilon|'reverse'"),
        ],
    )
    def test_what_it_does_not_have_is_refused(self, name, parameter, value, words):
        with pytest.raises(ValueError, match=words):
            create_rule(name, **{parameter: value})


@pytest.mark.parametrize("name", rules())
class TestEveryRule:
    def test_a_rule_that_was_told_nothing_remembers_nothing(self, name):
        memory = create_rule(name).memory()
        assert (memory.numbers, memory.images) == ({}, {})
        create_rule(name).recall(memory)

    def test_its_verdict_and_memory_can_be_written_as_json(self, name):
        rule = create_rule(name)
        verdict = rule.judge(evidence(100))
        assert json.loads(json.dumps(verdict.numbers)) == verdict.numbers
        assert json.loads(json.dumps(rule.memory().numbers)) == rule.memory().numbers
        assert verdict.reason

    def test_what_it_remembers_does_not_change_with_the_monitors_own_image(self, name):
        # The compiled predictor reads an image when it is compared, and not before.
        metric = CompiledVisibleDifferences(PAPER)
        rng = np.random.default_rng(6)
        images = [GREY + rng.normal(0, 0.2 / n, GREY.shape).astype("f4") for n in range(1, 9)]
        verdicts = {}
        for reuse in (False, True):
            rule, buffer = create_rule(name), np.empty_like(GREY)
            verdicts[reuse] = []
            for number, image in enumerate(images, start=1):
                if reuse:
                    buffer[:] = image
                shown = Evidence(100 * number, buffer if reuse else image, None, metric)
                verdicts[reuse].append(rule.judge(shown).value)
        assert verdicts[True] == verdicts[False]

    def test_a_memory_of_something_else_is_refused(self, name):
        with pytest.raises(ValueError, match=f"not a memory of the rule '{name}'"):
            create_rule(name).recall(Memory({"something": "else"}))


@pytest.mark.parametrize("restart", [0, 1, 4, 9])
@pytest.mark.parametrize(
    ("name", "parameters"),
    [*((one, {}) for one in rules()), ("multiple", {"window": 3}), ("myszkowski", {"alpha": 0.3})],
)
def test_another_process_goes_on_to_the_very_same_verdicts(name, parameters, restart):
    story = [noisy(100 * number, 0.3 / number**0.5) for number in range(1, 12)]
    undisturbed, before, after = (create_rule(name, **parameters) for _ in range(3))
    expected = [undisturbed.judge(seen) for seen in story]
    verdicts = [before.judge(seen) for seen in story[:restart]]
    memory, file = before.memory(), io.BytesIO()
    np.savez(file, **memory.images)
    file.seek(0)
    with np.load(file) as images:
        after.recall(Memory(json.loads(json.dumps(memory.numbers)), dict(images)))
    verdicts += [after.judge(seen) for seen in story[restart:]]
    assert verdicts == expected


def test_fixed_stops_when_the_cap_is_reached():
    rule = Fixed(spp=300)
    verdicts = [rule.judge(evidence(spp)) for spp in (100, 200, 300, 400)]
    assert [verdict.stop for verdict in verdicts] == [False, False, True, True]
    assert [verdict.value for verdict in verdicts] == [100, 200, 300, 400]
    assert verdicts[0].reason == "the fixed 300 spp are not yet reached: 100 spp"
    assert verdicts[2].reason == "the fixed 300 spp are reached: 300 spp"


class TestEvidence:
    def test_the_percept_and_the_estimate_are_worked_out_once(self):
        seen = evidence(10, (Half(GREY, 6), Half(GREY, 4)))
        assert seen.percept is seen.percept
        assert seen.estimate is seen.estimate
        assert seen.estimate is not None
        assert seen.estimate.pixels == 0
        assert seen.pixels == 64

    def test_without_halves_there_is_no_estimate(self):
        assert evidence(10).estimate is None

    def test_halves_that_are_not_the_whole_are_refused(self):
        with pytest.raises(ValueError, match="halves of 6 and 5 spp do not make 10 spp"):
            evidence(10, (Half(GREY, 6), Half(GREY, 5)))

    def test_an_evaluation_without_samples_is_refused(self):
        with pytest.raises(ValueError, match="at least 1 spp"):
            evidence(0)
