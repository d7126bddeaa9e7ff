"""Files and pipes of text are UTF-8 whatever the locale: each is opened with its encoding."""

import ast
from collections.abc import Iterator
from pathlib import Path

#: By the call: which of its arguments without a name is the encoding.
_FILES = {"read_text": 0, "write_text": 1}
_PROCESSES = {"run", "Popen", "check_output"}


def test_text_is_opened_with_its_encoding() -> None:
    folder = Path(__file__).parents[1] / "plateau"
    found = [
        f"{path}:{call.lineno}: {ast.unparse(call)}"
        for path in folder.rglob("*.py")
        for call in _without_encoding(ast.parse(path.read_text("utf-8")))
    ]
    assert found == []


def _without_encoding(tree: ast.AST) -> Iterator[ast.Call]:
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        words = {word.arg: word.value for word in call.keywords}
        is_method = isinstance(call.func, ast.Attribute)
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        if name in _FILES:
            is_text = len(call.args) <= _FILES[name]
        elif name in _PROCESSES:
            is_text = bool({"text", "universal_newlines"} & words.keys())
        elif name in {"open", "fdopen"}:
            given = call.args[0 if is_method and name == "open" else 1 :][:1]
            mode = words.get("mode", given[0] if given else ast.Constant("r"))
            is_text = isinstance(mode, ast.Constant) and "b" not in str(mode.value)
        else:
            is_text = name == "TextIOWrapper"
        if is_text and "encoding" not in words:
            yield call
