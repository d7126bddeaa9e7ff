"""Python writes nothing to Redis by itself: every write is a script, and looks at the layout."""

import ast
from collections.abc import Iterator

import pytest
import redis

from plateau.farm.ledger.totals import note_sweep, take_census
from tests.support.redis import redis_writes
from tests.support.redis.redis_writes import READS, ROOT, RUNS_SCRIPTS

#: Functions that open a link to Redis.
OPENERS = {"connect", "connect_to_renew", "open_link", "pipeline"}
#: Methods of redis-py whose name is not the command's, and those that send any command.
OTHER_NAMES = {
    *("delete", "execute_command", "eval", "evalsha", "eval_ro", "evalsha_ro", "fcall"),
    *("register_script", "script_load", "function_load", "lock", "transaction"),
}


def test_what_all_modules_may_send_writes_nothing(client: redis.Redis) -> None:
    known = client.command()
    assert {name for name in READS if "write" in known[name.lower()]["flags"]} == set()


def test_no_module_has_a_call_that_writes(client: redis.Redis) -> None:
    """Whatever is a link to Redis by its type or its making has methods called on it that read."""
    known = client.command()
    writes = {name for name, about in known.items() if "write" in about["flags"]} | OTHER_NAMES
    modules = list((ROOT / "plateau").rglob("*.py"))
    found = [
        f"{module}:{line} {method}"
        for path in modules
        if (module := path.relative_to(ROOT).as_posix()) not in RUNS_SCRIPTS
        for line, method in _called_on_links(path.read_text())
        if method in writes
    ]
    assert found == []


def test_the_look_at_calls_finds_them() -> None:
    source = (
        "class Keys:\n"
        "    def __init__(self, client: redis.Redis):\n"
        "        self._store = client\n"
        "    def act(self):\n"
        "        self._store.set('a', 1)\n"
        "        pipe = self._store.pipeline()\n"
        "        pipe.hset('b', 'c', 1)\n"
        "with connect(url) as link, open(name) as file:\n"
        "    link.delete('d')\n"
        "    file.rename('e')\n"
    )
    assert {method for _, method in _called_on_links(source)} == {
        *("set", "pipeline", "hset", "delete")
    }


def test_a_write_is_found_when_it_is_sent(client: redis.Redis) -> None:
    # Given code of Plateau's that writes by itself
    note = compile("client.hset('a', 'b', 1)", str(ROOT / "plateau" / "notes.py"), "exec")
    with pytest.raises(AssertionError, match=r"plateau/notes.py:1 sends HSET to Redis by itself"):
        exec(note, {"client": client})
    assert redis_writes.found.pop().startswith("plateau/notes.py:1")
    # But not what a script writes, or a test
    note_sweep(client)
    client.hset("a", "b", 1)
    assert take_census(client).swept_at is not None


def _called_on_links(source: str) -> Iterator[tuple[int, str]]:
    """Line and name of each method that is called on what the source shows to be a link to Redis.

    That is what an annotation says is one, what a function that opens links returns, and each name
    and attribute that is given such a thing.
    """
    tree = ast.parse(source)
    links: set[str] = {"client", "pipe"}
    for node in ast.walk(tree):
        annotation = node.annotation if isinstance(node, ast.arg | ast.AnnAssign) else None
        if annotation is not None and "Redis" in ast.unparse(annotation):
            links.add(node.arg if isinstance(node, ast.arg) else _name(node.target))
    before = set[str]()
    while before != links:
        before = set(links)
        for target, value in _given(tree):
            if _is_link(value, links):
                links.add(_name(target))
    for node in ast.walk(tree):
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute) and _is_link(called.value, links):
            yield called.lineno, called.attr


def _given(tree: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                yield target, node.value
        elif isinstance(node, ast.AnnAssign | ast.NamedExpr) and node.value is not None:
            yield node.target, node.value
        elif isinstance(node, ast.withitem) and node.optional_vars is not None:
            yield node.optional_vars, node.context_expr


def _is_link(value: ast.expr, links: set[str]) -> bool:
    if isinstance(value, ast.Call):
        name = _name(value.func)
        return name in OPENERS or (name == "enter_context" and _is_link(value.args[0], links))
    return _name(value) in links


def _name(expression: ast.expr) -> str:
    """The last word of a name or an attribute: ``client`` of ``self.client``."""
    if isinstance(expression, ast.Attribute):
        return expression.attr
    return expression.id if isinstance(expression, ast.Name) else ""
