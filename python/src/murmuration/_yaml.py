"""YAML files of RobotSwarmSimulator, with `!include` and `!np`.

The files may come from strangers: they include only files below the first file's folder, and their size is limited.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._arguments import shown
from ._errors import InvalidError

if TYPE_CHECKING:
    from yaml import MappingNode, Node, SafeLoader

# Most bytes of a file and all that it includes, most files within each other, and most values after aliases are copied.
_MOST_BYTES = 1 << 20
_DEEPEST = 8
_MOST_VALUES = 100_000
_MOST_LEVELS = 50

_OPERATIONS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


def load(file: Path) -> Any:  # noqa: ANN401
    """The document in a file, of dicts, lists, texts, numbers and truth values.

    Raises:
        InvalidError: If it is not YAML, includes a file from elsewhere or itself, or is too large.
        OSError: If a file cannot be read.
        ImportError: If the extra `swarmsim` is not installed.
    """
    try:
        import yaml
    except ImportError as missing:
        raise ImportError("`murmuration.swarmsim` needs PyYAML: pip install murmuration[swarmsim]") from missing
    try:
        return _copied(file, _Files(file).load(file, ()), [_MOST_VALUES])
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{mark.name}, line {mark.line + 1}" if mark else str(file)
        raise InvalidError(f"{place}: {error.problem or error.context}") from None
    except InvalidError:
        raise
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InvalidError(f"{file} is not YAML: {error}") from None


def _copied(file: Path, value: object, left: list[int], level: int = 0) -> Any:  # noqa: ANN401
    """A copy in which each alias is a value of its own. Aliases of aliases can stand for billions of values."""
    left[0] -= 1
    if left[0] < 0 or level > _MOST_LEVELS:
        raise InvalidError(f"{file} has more than {_MOST_VALUES} values, or {_MOST_LEVELS} within each other")
    if isinstance(value, dict):
        return {str(name): _copied(file, one, left, level + 1) for name, one in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [_copied(file, one, left, level + 1) for one in value]
    return value


class _Files:
    """Reads a file and the files that it includes."""

    def __init__(self, first: Path) -> None:
        self._folder = first.resolve().parent
        self._left = _MOST_BYTES

    def load(self, file: Path, above: tuple[Path, ...]) -> object:
        """The document in a file that the files `above` include."""
        return self._read(file, above, lambda loader: loader.get_single_data())

    def _read(self, file: Path, above: tuple[Path, ...], read: Callable[[SafeLoader], Any]) -> Any:  # noqa: ANN401
        place = file.resolve()
        if not place.is_relative_to(self._folder):
            raise InvalidError(f"{above[-1]} includes {file}, which is not below {self._folder}")
        if place in above:
            raise InvalidError(f"{file} includes itself")
        if len(above) >= _DEEPEST:
            raise InvalidError(f"{file}: more than {_DEEPEST} files include each other")
        if place.suffix not in (".yaml", ".yml", ".json"):
            raise InvalidError(f"{file} must be a file .yaml, .yml or .json")
        with place.open("rb") as stream:
            content = stream.read(self._left + 1)
        self._left -= len(content)
        if self._left < 0:
            raise InvalidError(f"{file}: the files have more than {_MOST_BYTES >> 20} MiB")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            raise InvalidError(f"{file} is not a text in UTF-8") from None
        loader = self._loader(text, file, (*above, place))
        try:
            return read(loader)
        finally:
            loader.dispose()

    def _loader(self, text: str, file: Path, above: tuple[Path, ...]) -> SafeLoader:
        import yaml

        files = self

        class Loader(yaml.SafeLoader):
            def flatten_mapping(self, node: MappingNode) -> None:
                for place, (key, value) in enumerate(node.value):
                    if key.tag == "tag:yaml.org,2002:merge" and value.tag == "!include":
                        other = files._read(included(value), above, lambda loader: loader.get_single_node())
                        node.value[place] = (key, other)
                super().flatten_mapping(node)

        def included(node: Node) -> Path:
            return file.parent / str(node.value)

        def include(_loader: SafeLoader, node: Node) -> object:
            return files.load(included(node), above)

        def number(_loader: SafeLoader, node: Node) -> float:
            expression = str(node.value).strip()
            try:
                return _number(ast.parse(expression, mode="eval").body)
            except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError):
                line = node.start_mark.line + 1
                raise InvalidError(f"{file}, line {line}: !np {shown(expression)}: must be a sum or product") from None

        Loader.add_constructor("!include", include)
        Loader.add_constructor("!np", number)
        loader = Loader(text)
        loader.name = str(file)
        return loader


def _number(node: ast.AST) -> float:
    """The value of an expression of numbers."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name) and node.id == "pi":
        return math.pi
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_number(node.left), _number(node.right))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_number(node.operand))
    raise ValueError
