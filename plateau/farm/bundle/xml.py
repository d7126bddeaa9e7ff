"""Reads Mitsuba's XML element by element, without entities, within bounds.

Mitsuba reads XML with pugixml, which accepts much malformed XML. The scene that is checked must be
the scene that is rendered, so XML that the two readers could read differently is refused: document
types, entities, other encodings than UTF-8, and anything not well-formed.
"""

import codecs
import re
from collections.abc import Callable
from typing import IO, Final, Literal, NamedTuple
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl, InputSource, Locator

from defusedxml.common import DefusedXmlException
from defusedxml.expatreader import DefusedExpatParser

from plateau.farm.bundle.limits import BundleError, BundleLimits, shown_name

#: Large: Expat before 2.6 reads an unfinished comment from its start again with every chunk.
_CHUNK_BYTES = 2**20
_DECLARED_ENCODING = re.compile(rb"""^<\?xml[^>]*?encoding\s*=\s*["']([^"']*)["']""")
_UTF8_NAMES = (b"utf-8", b"utf8", b"us-ascii", b"ascii")
_MAX_SAID = 40
_BOM = b"\xef\xbb\xbf"

#: Called with an element's name, its attributes and its line.
StartElement = Callable[[str, dict[str, str], int], None]
EndElement = Callable[[], None]

#: What is counted; `BundleLimits` has a ``max_`` of each.
Spending = Literal[
    "xml_bytes",
    "xml_elements",
    "includes",
    "sensors",  # and films
    "references",  # that are new
    "lookups",  # folders looked into
    "substitutions",  # parameters looked for in attributes
]

_TOO_MUCH: Final[dict[Spending, str]] = {
    "xml_bytes": "the scene has more than {} bytes of XML, each include counted every time; put "
    "geometry into mesh files",
    "xml_elements": "the scene has more than {} elements, each include counted every time",
    "includes": "the scene includes more than {} files, each include counted every time; put "
    "several into one",
    "sensors": "the scene has more than {} sensors and films, each include counted every time; "
    "make several scenes of it",
    "references": "the scene has more than {} different names of files and folders; put several "
    "meshes into one file",
    "lookups": "following the scene's references takes too long; use fewer <path> folders",
    "substitutions": "putting the scene's parameters in takes too long; use fewer of them",
}


class BudgetSpent(BundleError):
    """Reading an upload costs too much."""

    def __init__(self, message: str, *, file: str, line: int | None = None) -> None:
        super().__init__("xml-too-large", message, file=file, line=line)


class XmlCost(NamedTuple):
    """The cost to Mitsuba of reading an XML file, with all that the file includes."""

    bytes: int
    elements: int
    includes: int  #: files, the file itself left out

    def __sub__(self, before: "XmlCost") -> "XmlCost":
        return XmlCost(*(now - then for now, then in zip(self, before, strict=True)))


class XmlBudget:
    """How much may still be spent on reading one scene.

    A file is counted each time that it is included: nested includes can multiply a small bundle
    without end. A file not read again is counted, too (`spend_again`): Mitsuba will read it.
    """

    def __init__(self, limits: BundleLimits) -> None:
        self.max_depth = limits.max_xml_depth
        self.max_tag_bytes = limits.max_tag_bytes
        self._most = {what: getattr(limits, f"max_{what}") for what in _TOO_MUCH}
        self._spent = dict.fromkeys(_TOO_MUCH, 0)

    @property
    def spent(self) -> XmlCost:
        """What was spent so far that Mitsuba will spend, too."""
        spent = self._spent
        return XmlCost(spent["xml_bytes"], spent["xml_elements"], spent["includes"])

    def spend_again(self, cost: XmlCost, file: str, line: int) -> None:
        """Count a file that was read before; `BudgetSpent` where that is too much."""
        self.spend("xml_bytes", cost.bytes, file)
        self.spend("xml_elements", cost.elements, file, line)
        self.spend("includes", cost.includes, file, line)

    def spend(self, what: Spending, count: int, file: str, line: int | None = None) -> None:
        """Count `count` more; `BudgetSpent` where that is too many."""
        self._spent[what] += count
        most = self._most[what]
        if self._spent[what] > most:
            raise BudgetSpent(_TOO_MUCH[what].format(most), file=file, line=line)


def read_elements(
    stream: IO[bytes], name: str, budget: XmlBudget, start: StartElement, end: EndElement
) -> None:
    """Call `start` and `end` for every element of an XML file, in document order.

    Errors call the file `name`.

    Raises
    ------
    BundleError
        With a code that starts with `xml-`; and the errors of `start` and `end`.
    """
    parser = DefusedExpatParser(forbid_dtd=True, bufsize=_CHUNK_BYTES)
    parser.setContentHandler(_Handler(name, budget, start, end))
    source = InputSource()
    checked = _CheckedBytes(stream, name, budget)
    source.setByteStream(checked)
    # This encoding overrules the declared one.
    source.setEncoding("utf-8")
    try:
        parser.parse(source)
    except DefusedXmlException as error:
        raise BundleError(
            "xml-entity",
            "document types and entities are refused; take the <!DOCTYPE …> out",
            file=name,
            line=parser.getLineNumber(),
        ) from error
    except SAXParseException as error:
        checked.refuse_other_encodings(error.getLineNumber())
        raise BundleError(
            "xml-malformed",
            f"it is not well-formed XML: {error.getMessage()}",
            file=name,
            line=error.getLineNumber(),
        ) from error


class _CheckedBytes:
    """A file's bytes, as long as they are declared UTF-8 and within the budget."""

    def __init__(self, stream: IO[bytes], name: str, budget: XmlBudget) -> None:
        self._stream = stream
        self._name = name
        self._budget = budget
        self._chunk: bytes | None = None
        self._line = 1  # at which that chunk begins
        self._bytes_of_tag = 0

    def read(self, size: int = -1, /) -> bytes:
        chunk = self._stream.read(size)
        if self._chunk is None:
            self._check_encoding(chunk)
        else:
            self._line += self._chunk.count(b"\n")
        self._chunk = chunk
        self._budget.spend("xml_bytes", len(chunk), self._name)
        self._check_tags(chunk)
        return chunk

    def close(self) -> None:
        """Leave the file open: it belongs to whoever opened it."""

    def _check_tags(self, chunk: bytes) -> None:
        """Refuse a tag that is too long before the parser holds it in memory whole.

        From one `<` to the next is at least a tag: an attribute cannot contain a `<`.
        """
        *ended, begun = chunk.split(b"<")
        longest = max((*map(len, ended[1:]), self._bytes_of_tag + len(ended[0])) if ended else (0,))
        self._bytes_of_tag = len(begun) if ended else self._bytes_of_tag + len(begun)
        if max(longest, self._bytes_of_tag) > self._budget.max_tag_bytes:
            raise BundleError(
                "xml-too-large",
                f"it has a tag, or text, of more than {self._budget.max_tag_bytes} bytes",
                file=self._name,
            )

    def _check_encoding(self, beginning: bytes) -> None:
        declared = _DECLARED_ENCODING.match(beginning.removeprefix(_BOM))
        wide = beginning.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in beginning[:4]
        if wide or (declared and declared[1].lower() not in _UTF8_NAMES):
            named = declared[1].decode("latin-1")[:_MAX_SAID] if declared else "UTF-16"
            raise self._not_utf8(f"it is {shown_name(named)}", 1)

    def refuse_other_encodings(self, line: int | None) -> None:
        """Refuse a file that has bytes which are no UTF-8 on the line where the parser stopped."""
        try:
            codecs.getincrementaldecoder("utf-8")().decode(self._chunk or b"")
        except UnicodeDecodeError as error:
            odd = error.object[error.start]
            if line == self._line + error.object.count(b"\n", 0, error.start):
                raise self._not_utf8(
                    f"the byte {odd:#04x} is no UTF-8; in Latin-1 it is {chr(odd)!r}", line
                ) from None

    def _not_utf8(self, problem: str, line: int | None) -> BundleError:
        return BundleError(
            "xml-encoding",
            f"{problem}: save the file as UTF-8, and let its first line name no other encoding",
            file=self._name,
            line=line,
        )


class _Handler(ContentHandler):
    """Passes elements on with their lines, and bounds their nesting."""

    def __init__(self, name: str, budget: XmlBudget, start: StartElement, end: EndElement) -> None:
        super().__init__()
        self._name = name
        self._budget = budget
        self._depth = 0
        self._start = start
        self._end = end

    def setDocumentLocator(self, locator: Locator) -> None:  # noqa: N802 - SAX's name
        self._place = locator

    def startElement(self, name: str, attrs: AttributesImpl) -> None:  # noqa: N802 - SAX's name
        line = self._place.getLineNumber() or 0
        self._budget.spend("xml_elements", 1, self._name, line)
        self._depth += 1
        if self._depth > self._budget.max_depth:
            raise BundleError(
                "xml-depth",
                f"elements are nested more than {self._budget.max_depth} deep",
                file=self._name,
                line=line,
            )
        self._start(name, dict(attrs.items()), line)

    def endElement(self, name: str) -> None:  # noqa: ARG002, N802 - SAX's name
        self._depth -= 1
        self._end()
