"""The docs name every setting, command, option and problem, and lead somewhere."""

import re
from functools import cache
from pathlib import Path

import typer.main
from typer.testing import CliRunner

from plateau.commands import app
from plateau.farm.process.settings import Settings
from tests import cli_manual, rule_files

ROOT = Path(__file__).parents[1]


def test_the_docs_have_every_setting_and_no_other() -> None:
    rows = re.findall(
        r"^\| `PLATEAU_(\w+)` \| [^ |]", (ROOT / "docs" / "operations.md").read_text(), re.MULTILINE
    )
    assert sorted(rows) == sorted(name.upper() for name in Settings.model_fields)


def test_the_manual_has_every_command_and_option() -> None:
    assert cli_manual.PAGE.read_text() == cli_manual.manual(), "`make manual` writes docs/cli.md"


def test_the_docs_have_every_problem() -> None:
    page = rule_files.API.read_text()
    assert page == rule_files.documented(page, rule_files.problems()), "`make manual` writes it"


@cache
def help_of_all_commands() -> str:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return "\n".join(CliRunner().invoke(app, [name, "--help"]).stdout for name in commands)


DOCUMENTS = sorted(
    path
    for pattern in ("*.md", "docs/**/*.md", "deploy/**/*.md", "plateau/**/*.md")
    for path in ROOT.glob(pattern)
)


#: Words of this house alone; docs/glossary.md has those that we keep.
HOUSE_WORDS = re.compile(
    r"\b(gone on with|go(es|ing)? on with|(?<!`)outr[au]n|spoil(s|ed)? |(?<!third-)party\b|told of)"
)


def test_help_and_docs_use_standard_words() -> None:
    texts = {str(path.relative_to(ROOT)): path.read_text() for path in DOCUMENTS}
    texts["the help of the commands"] = help_of_all_commands()
    del texts["CHANGELOG.md"]
    found = {name: HOUSE_WORDS.search(text) for name, text in texts.items()}
    assert {name: match[0] for name, match in found.items() if match} == {}


def anchors(document: Path) -> set[str]:
    """The anchors that a renderer of Markdown makes of the document's headings."""
    headings = re.findall(r"^#+ (.+)$", document.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in headings}


def test_every_link_leads_somewhere() -> None:
    for document in DOCUMENTS:
        for link in re.findall(r'(?:\]\(|src=")(?!https?:)([^)"\s]+)', document.read_text()):
            name, _, anchor = link.partition("#")
            target = document.parent / name if name else document
            assert target.exists(), (document, link)
            assert not anchor or anchor in anchors(target), (document, link)


def test_every_cell_of_the_comparison_says_where_it_was_read() -> None:
    page = ROOT / "docs" / "science" / "compare.md"
    _, ours, *others = page.read_text().split("\n## ")
    # Ours in tests
    rows = [line for line in ours.splitlines() if line.startswith("| ")][1:]
    assert all("](../../tests/" in row for row in rows)
    for file, name in re.findall(r'\]\((\.\./\.\./tests/\S+) "(\w+)"\)', ours):
        tests = (page.parent / file).read_text()
        assert re.search(rf"^\s*(def|class) {name}\b", tests, re.MULTILINE), f"{file}: {name}"
    # The others' in what they have published
    tables = [re.findall(r"^\| \w.* \|$", one, re.MULTILINE) for one in others]
    cells = [cell for table in tables for row in table for cell in row.split(" | ")[1:]]
    assert len(cells) > 50
    assert [one for one in cells if "](https://" not in one and "not found" not in one] == []


def test_every_file_that_a_document_names_is_there() -> None:
    folders = "bench|deploy|docs|farm|metric|plateau|scenes|service|tests|worker"
    for document in DOCUMENTS:
        if document.name != "CHANGELOG.md":  # what it says was so then
            for name in re.findall(rf"`((?:{folders})/[\w./-]+\.\w+)`", document.read_text()):
                assert "NAME" in name or (ROOT / name).exists(), (document, name)


def test_every_page_of_decisions_is_in_their_index() -> None:
    pages = {page.name for page in (ROOT / "docs" / "decisions").glob("*.md")} - {"README.md"}
    index = (ROOT / "docs" / "decisions" / "README.md").read_text()
    assert set(re.findall(r"\]\(([^)]+)\)", index)) == pages


def test_the_pages_that_code_names_are_there() -> None:
    folders = ("bench", "deploy", "plateau", "tests")
    texts = [path.read_text() for name in folders for path in (ROOT / name).rglob("*.py")]
    named = {page for text in texts for page in re.findall(r"\bdocs/[\w/-]+\.md", text)}
    assert named
    assert {page for page in named if not (ROOT / page).exists()} == set()
