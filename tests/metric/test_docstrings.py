"""Every example in a docstring of the package is run, and gives what it says."""

import doctest
import importlib
import pkgutil

import pytest

from plateau import metric

MODULES = [
    "plateau.metric",
    *(m.name for m in pkgutil.walk_packages(metric.__path__, "plateau.metric.")),
]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_hold(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0
