"""YAML as the calibration tools write it: OpenCV's header and matrix tag, plain numbers, no key given twice."""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner

from circlepose._arguments import shown
from circlepose.errors import CircleposeError
from circlepose.io.text.validation import brief

_IS_COMPILED = bool(yaml.__with_libyaml__)
"""PyYAML's own parser takes 0.2 ms a value and 3 us a character; libyaml, in its wheels, a tenth or less."""
MAX_VALUES = 150_000 if _IS_COMPILED else 15_000
"""Numbers, texts, lists and mappings in a file; a calibration with all the points that it was made from has fewer."""
MAX_CHARACTERS = 10_000_000 if _IS_COMPILED else 1_000_000
MAX_DEPTH = 50
"""Lists and mappings in one another; a camchain has four."""


class MatrixNode(dict[str, object]):
    """A matrix as an OpenCV file states it (rows and cols, or sizes; dt, data), not yet checked."""


class _Composer(Composer):
    """Builds the tree of a file's values, counting them.

    A value that is named by aliases counts as often as it is named: a few lines of aliases of aliases are a bomb.
    """

    check_event: Callable[..., bool]
    """of the parser"""

    def __init__(self) -> None:
        super().__init__()
        self._values = 0
        self._depth = 0
        self._size_of: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Build the tree of a value; refuse one that holds itself, or more values than anyone means."""
        is_alias = self.check_event(yaml.AliasEvent)
        before = self._values
        self._values += 1
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise yaml.composer.ComposerError(problem="nested too deeply")
        node = super().compose_node(parent, index)
        self._depth -= 1
        if node is None:
            return None
        if is_alias:
            if node not in self._size_of:
                raise yaml.composer.ComposerError(problem="a value holds itself", problem_mark=node.start_mark)
            self._values += self._size_of[node]
        else:
            self._size_of[node] = self._values - before
        if self._values > MAX_VALUES:
            problem = f"it holds more than {MAX_VALUES} values"
            raise yaml.composer.ComposerError(problem=problem, problem_mark=node.start_mark)
        return node


class _Constructor(SafeConstructor):
    """Makes YAML's core values and matrices; other tags are refused, and values that do not fit their tag."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Build a mapping; refuse a key that stands in it twice."""
        if not isinstance(node, yaml.MappingNode):
            raise yaml.constructor.ConstructorError(
                problem=f"expected keys and values, but found a {node.id}", problem_mark=node.start_mark
            )
        seen: set[str] = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key {shown(key.value)} is given twice", problem_mark=key.start_mark
                )
            seen.add(key.value)
        return super().construct_mapping(node, deep)

    def construct_matrix(self, _: str, node: yaml.Node) -> MatrixNode:
        """Build the value of the tags `!!opencv-matrix` and, of OpenCV 5's vectors, `!!opencv-nd-matrix`."""
        if not isinstance(node, yaml.MappingNode):
            raise yaml.constructor.ConstructorError(
                problem="an opencv-matrix has the keys rows, cols, dt and data", problem_mark=node.start_mark
            )
        return MatrixNode({str(key): value for key, value in self.construct_mapping(node, deep=True).items()})

    def construct_null(self, node: yaml.Node) -> None:
        """Build the value of an empty place."""
        self._scalar(node, "null", _NULL)

    def construct_bool(self, node: yaml.Node) -> bool:
        """Build true or false."""
        return self._scalar(node, "bool", _BOOL).lower() == "true"

    def construct_int(self, node: yaml.Node) -> int:
        """Build a decimal integer."""
        return int(self._scalar(node, "int", _INT))

    def construct_float(self, node: yaml.Node) -> float:
        """Build a number; `.nan` and `.inf` in any case, as OpenCV writes `.Nan`."""
        return float(self._scalar(node, "float", _NUMBER).lower().replace(".inf", "inf").replace(".nan", "nan"))

    def _scalar(self, node: yaml.Node, kind: str, pattern: str) -> str:
        """Return the text of one value, which has to match: a tag may stand before any value."""
        text = self.construct_scalar(node)  # type: ignore[arg-type]
        if not re.fullmatch(pattern, text):
            raise yaml.constructor.ConstructorError(
                problem=f"!!{kind} does not take {shown(text)}", problem_mark=node.start_mark
            )
        return text


_NULL = r"~|null|Null|NULL|"
_BOOL = r"true|True|TRUE|false|False|FALSE"
_INT = r"[-+]?[0-9]+"
_FLOAT = r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
_NOT_FINITE = r"(?i:[-+]?\.inf|\.nan)"
_NUMBER = f"(?:{_FLOAT}|{_NOT_FINITE})"


class _Resolver(BaseResolver):
    """Resolve the type of a plain value by its form: PyYAML's rules take 1e-3 for text, 010 for 8, 1:30 for 90."""


_CORE = "tag:yaml.org,2002:"
for _tag, _pattern, _first in (
    ("null", _NULL, ["~", "n", "N", ""]),
    ("bool", _BOOL, list("tTfF")),
    ("int", _INT, list("-+0123456789")),
    ("float", _FLOAT, list("-+.0123456789")),
    ("float", _NOT_FINITE, list("-+.")),
):
    _Resolver.add_implicit_resolver(_CORE + _tag, re.compile(f"^(?:{_pattern})$"), _first)
# PyYAML's other constructors (timestamp, set, omap, binary) raise errors that are no YAML errors.
_Constructor.yaml_constructors = {
    _CORE + "null": _Constructor.construct_null,
    _CORE + "bool": _Constructor.construct_bool,
    _CORE + "int": _Constructor.construct_int,
    _CORE + "float": _Constructor.construct_float,
    _CORE + "str": _Constructor.construct_yaml_str,
    _CORE + "seq": _Constructor.construct_yaml_seq,
    _CORE + "map": _Constructor.construct_yaml_map,
    None: _Constructor.construct_undefined,
}
# PyYAML writes Python's tuples so, of an image size for example; to read one runs nothing.
_Constructor.yaml_constructors[_CORE + "python/tuple"] = _Constructor.construct_yaml_seq
_Constructor.yaml_multi_constructors = {}
_Constructor.add_multi_constructor(_CORE + "opencv-", _Constructor.construct_matrix)


class _PlainParser(Reader, Scanner, Parser):
    """PyYAML's own parser, for an installation without libyaml."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)


_PARSER: type = yaml._yaml.CParser if _IS_COMPILED else _PlainParser


class _Loader(_Composer, _PARSER, _Constructor, _Resolver):  # type: ignore[misc]
    """The composer above takes the events of the parser; libyaml has a composer of its own, without a bound."""

    def __init__(self, text: str) -> None:
        _PARSER.__init__(self, text)  # type: ignore[misc]
        _Composer.__init__(self)
        _Constructor.__init__(self)
        _Resolver.__init__(self)


def parse_yaml(text: str, name: str, error: type[CircleposeError], example: str = "") -> dict[str, object]:
    """Return the one mapping that `text` holds; `name` is the file's, `example` a line of such a file, for messages.

    Raises `error` with the line where the text is no such mapping.
    """
    document = load_yaml(text, name, error)
    if not isinstance(document, dict):
        raise error(f"{name}: {no_keys(document, example)}.")
    return {str(key): value for key, value in document.items()}


def no_keys(document: object, example: str = "") -> str:
    """Return the sentence on a document that is no mapping, without its period."""
    such = f", such as `{example}`" if example else ""
    found = "a list" if isinstance(document, list) else "none"
    return f"expected keys and values{such}; found {found}"


def value_problem(reason: ValueError) -> str:
    """Return what is wrong with a value of a file; of a number with thousands of digits, which Python refuses, so."""
    is_long = "integer string conversion" in str(reason)
    return "holds a whole number of thousands of digits" if is_long else str(reason).partition("\n")[0]


def load_yaml(text: str, name: str, error: type[CircleposeError]) -> object:
    """Return the one document that `text` holds, None if it is empty; `name` is the file's, for messages.

    Takes `%YAML:1.0` (OpenCV to 4.x), which is no YAML, for the header that it is meant to be, and a closing
    `---` (a recorded ROS message) for nothing. Raises `error` with the line where the text is no YAML.
    """
    if len(text) > MAX_CHARACTERS:
        raise error(f"{name}: has more than {MAX_CHARACTERS} characters; expected a small text file.")
    # The header is blanked, not cut out, so that the lines keep their numbers.
    body = re.sub(r"\A(\s*)%YAML[^\n]*", r"\1", text)
    try:
        documents = [each for each in yaml.load_all(body, _Loader) if each is not None]
    except yaml.MarkedYAMLError as reason:
        if "nest" in (reason.problem or ""):
            raise error(f"{name}: is nested too deeply.") from None
        mark = reason.problem_mark or reason.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise error(f"{name}{line}: is not valid YAML ({brief(reason.problem or reason.context or '')}).") from None
    except ValueError as reason:
        raise error(f"{name}: is not valid YAML ({brief(value_problem(reason))}).") from None
    except yaml.YAMLError as reason:
        first_line = str(reason).partition("\n")[0]
        raise error(f"{name}: is not valid YAML ({brief(first_line)}).") from None
    if len(documents) > 1:
        raise error(f"{name}: holds {len(documents)} YAML documents (parted by ---); expected one.")
    return documents[0] if documents else None
