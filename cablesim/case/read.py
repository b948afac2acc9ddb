"""YAML text to plain data and the line of each of its parts; YAML 1.2, nothing executed.

Depends on: errors.
"""

from __future__ import annotations

import io
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.representer import SafeRepresenter

from cablesim.case.errors import CaseError, Location, Problem, path_text

_DEEPEST = 30
_MOST_PARTS = 2_000_000
_TAGS = {
    f"tag:yaml.org,2002:{name}" for name in ("map", "seq", "str", "int", "float", "bool", "null", "timestamp")
}


def read_yaml(text: str, file: str | None = None) -> tuple[Any, dict[Location, int]]:
    """Read one YAML document.

    Parameters
    ----------
    text : str
        The document.
    file : str, optional
        Name of the file for messages.

    Returns
    -------
    data : object
        Dictionaries, lists and scalars.
    lines : dict
        Line (from 1) of each part, by its path as a tuple of keys and indices.

    Raises
    ------
    CaseError
        If the text is no YAML, or repeats a key.
    """
    yaml = YAML(typ="safe", pure=True)
    yaml.allow_duplicate_keys = True  # found below, with both lines
    try:
        root = yaml.compose(io.StringIO(text))
        reader = _Reader(yaml.constructor, file)
        data = reader.read(root, ()) if root is not None else None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = " ".join(part.strip() for part in (error.context, error.problem) if part)
        raise CaseError([_no_yaml(message, file, None if mark is None else mark.line + 1)]) from None
    except RecursionError:  # of the parser, which goes as deep as the text
        raise CaseError([_no_yaml("nested too deeply", file, None)]) from None
    except YAMLError as error:
        raise CaseError([_no_yaml(str(error).splitlines()[0], file, None)]) from None
    if reader.problems:
        raise CaseError(reader.problems)
    return data, reader.lines


def _no_yaml(message: str, file: str | None, line: int | None) -> Problem:
    return Problem(
        path="",
        message=f"is not valid YAML: {message}",
        remedy="Check indentation, colons and brackets on this line and the one before.",
        file=file,
        line=line,
    )


class _Reader:
    """Walks the nodes of a document; keeps lines and what is wrong with the keys."""

    def __init__(self, constructor: Any, file: str | None) -> None:
        self.constructor = constructor
        self.file = file
        self.lines: dict[Location, int] = {}
        self.problems: list[Problem] = []

    def read(self, node: Node, path: Location) -> Any:
        self.lines.setdefault(path, node.start_mark.line + 1)
        if len(path) > _DEEPEST or len(self.lines) > _MOST_PARTS:
            raise YAMLError("nested too deeply, or an alias repeats too much")
        if node.tag not in _TAGS:
            raise MarkedYAMLError(problem=f"tag {node.tag} is not allowed", problem_mark=node.start_mark)
        if isinstance(node, MappingNode):
            return self._mapping(node, path)
        if isinstance(node, SequenceNode):
            return [self.read(item, (*path, index)) for index, item in enumerate(node.value)]
        return self._scalar(node)

    def _mapping(self, node: MappingNode, path: Location) -> dict[Any, Any]:
        data: dict[Any, Any] = {}
        merged: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            if isinstance(key_node, ScalarNode) and key_node.tag == "tag:yaml.org,2002:merge":
                merged.update(self._merge(value_node, path))
                continue
            if not isinstance(key_node, ScalarNode):
                mark = key_node.start_mark
                raise MarkedYAMLError(problem="a key is a list or a group of keys", problem_mark=mark)
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in data:
                first = self.lines[(*path, key)]
                self._refuse((*path, key), line, f"is given twice, first on line {first}")
            self.lines[(*path, key)] = line
            data[key] = self.read(value_node, (*path, key))
        return {**merged, **data}

    def _merge(self, node: Node, path: Location) -> dict[Any, Any]:
        """Expand ``<<: *anchor``."""
        nodes = node.value if isinstance(node, SequenceNode) else [node]
        merged: dict[Any, Any] = {}
        for item in reversed(nodes):
            if not isinstance(item, MappingNode):
                problem = "<< takes a group of keys, or a list of such"
                raise MarkedYAMLError(problem=problem, problem_mark=item.start_mark)
            merged.update(self._mapping(item, path))
        return merged

    def _scalar(self, node: Node) -> Any:
        try:
            value = self.constructor.construct_object(node)
        except ValueError:  # !!int five, a month 13, a number of more than 4300 digits
            problem = f"no {str(node.tag).rpartition(':')[2]}: {node.value[:40]}"
            raise MarkedYAMLError(problem=problem, problem_mark=node.start_mark) from None
        return value if isinstance(value, str | int | float | bool | type(None)) else str(node.value)

    def _refuse(self, path: Location, line: int, message: str) -> None:
        text, remedy = path_text(path), "Keep one of them."
        self.problems.append(Problem(path=text, message=message, remedy=remedy, file=self.file, line=line))


class _BlockRepresenter(SafeRepresenter):
    """Groups of keys one below the other, lists of numbers on one line."""

    def represent_dict(self, data: Any) -> Any:
        return self.represent_mapping("tag:yaml.org,2002:map", data, flow_style=not data)


_BlockRepresenter.add_representer(dict, _BlockRepresenter.represent_dict)


def write_yaml(data: Any) -> str:
    """Write plain data as YAML 1.2, keys in their order, short lists on one line."""
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.Representer = _BlockRepresenter
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False
    yaml.width = 110
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()
