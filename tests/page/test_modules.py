"""The page's files: every export is imported, and every style sheet linked."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[2] / "plateau" / "service" / "page"
OWN = {path: path for path in PAGE.rglob("*.js") if "vendor" not in path.parts}
#: An extension's page is served in a folder of its name.
for folder in PAGE.parents[1].glob("*/page"):
    if folder.parent.name != "service":
        OWN |= {PAGE / folder.parent.name / path.name: path for path in folder.glob("*.js")}
EXPORT = re.compile(r"^export (?:async )?(?:function|class|const|let) (\w+)", re.MULTILINE)
IMPORT = re.compile(r"^import \{ ([^}]*) \} from \"([^\"]*)\"", re.MULTILINE)
#: What main.js calls of each screen.
SCREEN = "open"


def test_every_export_is_imported_somewhere() -> None:
    exported = {
        (path, name)
        for path, file in OWN.items()
        for name in EXPORT.findall(file.read_text("utf-8"))
        if name != SCREEN and path.name != "extension.js"  # what it offers
    }
    imported = {
        ((path.parent / source).resolve(), name)
        for path, file in OWN.items()
        for names, source in IMPORT.findall(file.read_text("utf-8"))
        for name in names.split(", ")
    }
    assert exported, "nothing was read"
    assert {(path.relative_to(PAGE), name) for path, name in exported - imported} == set()


def test_every_style_sheet_is_linked() -> None:
    index = (PAGE / "index.html").read_text("utf-8")
    linked = set(re.findall(r'rel="stylesheet" href="/page/([^"]*)"', index))
    assert linked == {path.relative_to(PAGE).as_posix() for path in PAGE.rglob("*.css")}
