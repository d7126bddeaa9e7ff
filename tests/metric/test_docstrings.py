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


@pytest.mark.parametrize(
    "name",
    [
        "plateau.metric.csf",
        "plateau.metric.display",
        "plateau.metric.pyramid",
        "plateau.metric.vdp",
    ],
)
def test_every_public_function_of_the_numerics_has_an_example(name):
    module = importlib.import_module(name)
    functions = {
        f"{name}.{key}"
        for key, value in vars(module).items()
        if callable(value)
        and getattr(value, "__module__", None) == name
        and not isinstance(value, type)
        and not key.startswith("_")
        and key != "as_image"  # a check, not a quantity
    }
    shown = {test.name for test in doctest.DocTestFinder().find(module) if test.examples}
    assert functions <= shown
