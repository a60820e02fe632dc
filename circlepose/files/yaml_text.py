"""YAML as the calibration tools write it: OpenCV's header and matrix tag, plain numbers, no key given twice."""

from __future__ import annotations

import re
from collections.abc import Hashable
from typing import Any

import yaml

from circlepose.arguments import shown
from circlepose.errors import CircleposeError
from circlepose.files.schema import brief

MAX_VALUES = 150_000
"""Numbers, texts, lists and mappings in a file; a calibration with all the points that it was made from has fewer."""


class MatrixNode(dict[str, object]):
    """A matrix as an OpenCV file states it (rows and cols, or sizes; dt, data), not yet checked."""


class _Loader(yaml.SafeLoader):
    """YAML's core values only: PyYAML's own rules take 1e-3 for text, 010 for 8, 1:30 for 90 and `no` for false.

    A value that is named by aliases counts as often as it is named: a few lines of aliases of aliases are a bomb.
    """

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._values = 0
        self._size_of: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Build the tree of a value; refuse one that holds itself, or more values than anyone means."""
        is_alias = self.check_event(yaml.AliasEvent)
        before = self._values
        self._values += 1
        node = super().compose_node(parent, index)
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

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Build a mapping; refuse a key that stands in it twice."""
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

    def construct_int(self, node: yaml.ScalarNode) -> int:
        """Build a decimal integer."""
        return int(node.value)

    def construct_float(self, node: yaml.ScalarNode) -> float:
        """Build a number; `.nan` and `.inf` in any case, as OpenCV writes `.Nan`."""
        return float(node.value.lower().replace(".inf", "inf").replace(".nan", "nan"))


_CORE = "tag:yaml.org,2002:"
_Loader.yaml_implicit_resolvers = {}
for _tag, _pattern, _first in (
    ("null", r"(?:~|null|Null|NULL|)", ["~", "n", "N", ""]),
    ("bool", r"(?:true|True|TRUE|false|False|FALSE)", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"(?i:[-+]?\.inf|\.nan)", list("-+.")),
):
    _Loader.add_implicit_resolver(_CORE + _tag, re.compile(f"^{_pattern}$"), _first)
_Loader.add_constructor(_CORE + "int", _Loader.construct_int)
_Loader.add_constructor(_CORE + "float", _Loader.construct_float)
_Loader.add_multi_constructor(_CORE + "opencv-", _Loader.construct_matrix)


def parse_yaml(text: str, name: str, error: type[CircleposeError]) -> dict[str, object]:
    """Return the one mapping that `text` holds; `name` is the file's, for messages.

    Takes `%YAML:1.0` (OpenCV to 4.x), which is no YAML, for the header that it is meant to be, and a closing
    `---` (a recorded ROS message) for nothing. Raises `error` with the line where the text is no such mapping.
    """
    # The header is blanked, not cut out, so that the lines keep their numbers.
    body = re.sub(r"\A%YAML[^\n]*", "", text)
    try:
        documents = [each for each in yaml.load_all(body, _Loader) if each is not None]
    except yaml.MarkedYAMLError as reason:
        mark = reason.problem_mark or reason.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise error(f"{name}{line}: is not valid YAML ({brief(reason.problem or reason.context or '')}).") from None
    except (yaml.YAMLError, ValueError) as reason:
        first_line = str(reason).partition("\n")[0]
        raise error(f"{name}: is not valid YAML ({brief(first_line)}).") from None
    except RecursionError:
        raise error(f"{name}: is nested too deeply to be meant.") from None
    if len(documents) > 1:
        raise error(f"{name}: holds {len(documents)} YAML documents (parted by ---); expected one.")
    document = documents[0] if documents else None
    if not isinstance(document, dict):
        raise error(f"{name}: expected keys and values, such as `radius_mm: 60`; found none.")
    return {str(key): value for key, value in document.items()}
