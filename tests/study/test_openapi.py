"""The examples of the routes' parameters are understood."""

import httpx
import redis

from plateau.study import examples
from plateau.study.ledger import Studies
from plateau.study.model import Screen, Study
from plateau.study.routes import router
from tests.service.api.test_openapi import (
    Operation,
    check_parameters_are_understood,
    document,
    operations,
)

__all__ = ["document", "operations"]

#: What is told of a study when it is made; the rest is Redis's own.
ABOUT = Study.model_fields.keys() - {"id", "owner", "created_at"}


def test_the_examples_of_parameters_are_understood(
    http: httpx.Client, client: redis.Redis, operations: list[Operation]
) -> None:
    # Given a study without pictures, with the observer of the examples
    studies = Studies(client)
    about = {name: examples.STUDY[name] for name in ABOUT}
    study = studies.create(studies.begin(), {}, "", about)
    screen = Screen.model_validate(examples.OBSERVER["screen"])
    studies.join(study, examples.OBSERVER["name"], screen)
    own = {route.path for route in router.routes}
    for method, path, described in operations:
        if method == "GET" and path in own:
            check_parameters_are_understood(http, path, described, study_id=study.id)
