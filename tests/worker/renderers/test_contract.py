"""Messages of a render child: each survives its line, and no other line is taken."""

import json

import pytest

from plateau.worker.renderers import contract
from plateau.worker.renderers.contract import (
    NotUnderstood,
    answer_line,
    read_answer,
    read_request,
    request_line,
)

REQUESTS = [
    contract.Load(
        id=1,
        folder="/a",
        entry="scene.xml",
        parameters={"width": "8"},
        sensor=2,
        aovs=("depth", "shape_id"),
        threads=2,
    ),
    contract.Render(id=2, passes=((4, 7), (1, 8)), glimpse=True),
    contract.Cancel(id=2),
]
ANSWERS = [
    contract.Ready(stays_open=("the kernel has no Landlock",)),
    contract.Loaded(width=3, height=2, notes=("a note",), look="1.0 AAAA"),
    contract.Loaded(
        width=3, height=2, channels=(*contract.CHANNELS, "Z", "id.shape"), ids=("id.shape",)
    ),
    contract.Working(),
    contract.FirstPass(at=96, spp=4),
    contract.InputDone(at=96, spp=4),
    contract.SumDone(at=0, render_s=0.5),
    contract.Stopped(),
    contract.SceneRefused(message="no such plugin"),
    contract.DiskFull(message="No space left on device"),
    contract.Failed(message="out of memory: std::bad_alloc"),
]


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda one: one.kind)
def test_a_request_is_one_line_and_comes_back(request_):
    line = request_line(request_)
    assert line.count("\n") == 1
    assert request_line(read_request(line)) == line
    assert isinstance(read_request(line), type(request_))


@pytest.mark.parametrize("answer", ANSWERS, ids=lambda one: one.kind)
def test_an_answer_is_one_line_and_comes_back(answer):
    line = answer_line(answer)
    assert line.count("\n") == 1
    assert read_answer(line) == answer


def test_every_message_of_the_documentation_is_read():
    lines = [line.strip() for line in str(contract.__doc__).splitlines()]
    requests = [line for line in lines if line.startswith('{"do"')]
    answers = [line for line in lines if line.startswith('{"is"')]
    filled = [line.replace("[[spp, seed], …]", "[]").replace("[…]", "[]") for line in answers]
    kinds = {json.loads(line.replace("…", "0"))["is"] for line in filled}
    assert kinds == {one.kind for one in ANSWERS}
    assert {type(read_answer(line.replace("…", "0"))) for line in filled} == set(map(type, ANSWERS))
    told = [line.replace("[[spp, seed], …]", "[]").replace("…}", "}") for line in requests]
    assert [type(read_request(line.replace("…", '""'))) for line in told] == [
        type(one) for one in REQUESTS
    ]


@pytest.mark.parametrize(
    "line",
    [
        "",
        "Segmentation fault",
        "[]",
        "null",
        "{}",
        '{"is": "done"}',
        '{"is": ["pass"]}',
        '{"is": "rendered"}',
        '{"is": "pass", "at": 1}',
    ],
)
def test_any_other_line_is_not_understood(line):
    with pytest.raises(NotUnderstood, match="no message of a render child"):
        read_answer(line)
