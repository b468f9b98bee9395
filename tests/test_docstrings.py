"""What the docstrings of public functions say of arguments, results and errors.

The rule, for every public function and method of two arguments or more:

- ``Args:`` names every argument, in the order of the signature;
- ``Returns:`` (of a generator ``Yields:``) stands wherever something is returned;
- ``Raises:`` names every exception that the function's own body raises.

Whatever is annotated as an array has its shape in brackets, and a quantity whose
name ends in a unit has that unit, or both have a word that says where to look.

Sources are read, nothing is imported. Not public are names with an underscore in
front, in any part of their path, and functions inside of functions, where the blocks
for several scalar types are. Properties take no arguments, and Drake's overrides are
described by Drake.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("systems", "diagrams", "analysis", "phonotaxis")
LEAST_ARGUMENTS = 2

#: Exceptions that speak of our own mistakes, and not of an argument.
OWN_MISTAKES = {"AssertionError", "NotImplementedError"}

#: The unit of a name's ending, as texts write it.
UNITS = {
    "_s": "s", "_m": "m", "_hz": "Hz", "_m_s": "m/s", "_deg": "deg", "_n": "N",
    "_n_m": "N/m", "_n_s_m": "N s/m", "_pa": "Pa", "_db": "dB",
    "_kg": "kg", "_rad_s": "rad/s", "_m_s2": "m/s^2",
}  # fmt: skip

#: Words that send the reader elsewhere.
ELSEWHERE = re.compile(r"\b([Ss]ee|[Aa]s|same|from) ")

Function = ast.FunctionDef | ast.AsyncFunctionDef
Named = tuple[str, Function]


def public_functions(tree: ast.Module) -> Iterator[Named]:
    """The public functions of a module, and the public methods of its classes."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for method in node.body:
                if isinstance(method, Function):
                    yield f"{node.name}.{method.name}", method
        elif isinstance(node, Function):
            yield node.name, node


def is_described(function: Function) -> bool:
    """Whether the rule is about it. PascalCase are Drake's overrides."""
    decorators = " ".join(ast.unparse(d) for d in function.decorator_list)
    return (
        not function.name.startswith("_")
        and not function.name[0].isupper()
        and "property" not in decorators
        and "overload" not in decorators
        and len(arguments(function)) >= LEAST_ARGUMENTS
    )


def arguments(function: Function) -> dict[str, str]:
    """Annotations by name, without ``self`` and ``cls``."""
    a = function.args
    every = [*a.posonlyargs, *a.args, a.vararg, *a.kwonlyargs, a.kwarg]
    return {
        arg.arg: ast.unparse(arg.annotation) if arg.annotation else ""
        for arg in every
        if arg is not None and arg.arg not in ("self", "cls")
    }


def own_nodes(function: Function) -> Iterator[ast.AST]:
    """What a function does itself, without the functions inside of it."""
    waiting: list[ast.AST] = list(function.body)
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, Function | ast.Lambda | ast.ClassDef):
            waiting += ast.iter_child_nodes(node)


def result(function: Function) -> str:
    """``Yields``, ``Returns``, or nothing."""
    nodes = list(own_nodes(function))
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in nodes):
        return "Yields"
    if function.returns is not None:
        return "" if ast.unparse(function.returns) == "None" else "Returns"
    given = [node for node in nodes if isinstance(node, ast.Return) and node.value]
    return "Returns" if given else ""


def raised(function: Function) -> set[str]:
    """Names of the classes that a function raises itself."""
    names = set()
    for node in own_nodes(function):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call | ast.Name):
            made = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            name = ast.unparse(made).rpartition(".")[2]
            if name[0].isupper():
                names.add(name)
    return names - OWN_MISTAKES


def sections(text: str) -> dict[str, str]:
    """The indented text below each heading of a Google style docstring."""
    found = re.findall(r"^(\w+):\n((?:(?: {4}.*)?(?:\n|\Z))+)", text, re.MULTILINE)
    return dict(found)


def entries(section: str) -> dict[str, str]:
    """Texts by name, of ``Args:`` or ``Raises:``; a name may stand there twice."""
    found: dict[str, str] = {}
    for name, text in re.findall(
        r"^ {4}\*{0,2}(\w+): (.*(?:\n(?: {8}.*)?)*)", section, re.MULTILINE
    ):
        found[name] = f"{found.get(name, '')} {text}"
    return found


def is_array(annotation: str) -> bool:
    """Whether it is an array, or None in place of one."""
    return bool(re.fullmatch(r"(NDArray\[.*\]|ArrayLike)( \| None)?", annotation))


def unit_of(name: str) -> str:
    """Of the longest ending that is a unit; empty: the name has none."""
    endings = [end for end in UNITS if name.endswith(end)]
    return UNITS[max(endings, key=len)] if endings else ""


def has_shape(text: str) -> bool:
    """Such as (n, 3)."""
    return bool(re.search(r"\([^)]*\)", text) or ELSEWHERE.search(text))


def has_unit(text: str, unit: str) -> bool:
    """Whether the unit stands there as a word of its own."""
    return bool(
        re.search(rf"(?<![\w/]){re.escape(unit)}(?![\w/^])", text)
        or ELSEWHERE.search(text)
    )


def complaints(function: Function) -> Iterator[str]:
    """What the docstring leaves out."""
    found = sections(ast.get_docstring(function) or "")
    named = arguments(function)
    told = entries(found.get("Args", ""))
    if list(told) != list(named):
        yield f"Args: {list(told)}, but it takes {list(named)}"
    for name, text in told.items():
        if is_array(named.get(name, "")) and not has_shape(text):
            yield f"{name}: no shape"
        if (unit := unit_of(name)) and not has_unit(text, unit):
            yield f"{name}: no {unit}"
    wanted = result(function)
    given = found.get(wanted, "")
    if wanted and not given.strip():
        yield f"no {wanted}:"
    annotation = ast.unparse(function.returns) if function.returns else ""
    if given and is_array(annotation) and not has_shape(given):
        yield f"{wanted}: no shape"
    if missing := raised(function) - entries(found.get("Raises", "")).keys():
        yield f"Raises: without {sorted(missing)}"


def described(folder: str) -> Iterator[tuple[str, Function]]:
    """Every function that the rule is about, by place."""
    for path in sorted((ROOT / folder).rglob("*.py")):
        place = path.relative_to(ROOT)
        if any(part.startswith("_") for part in place.with_suffix("").parts):
            continue
        for name, function in public_functions(ast.parse(path.read_text("utf-8"))):
            if is_described(function):
                yield f"{place}:{function.lineno} {name}", function


@pytest.mark.parametrize("folder", FOLDERS)
def test_arguments_results_and_errors_are_described(folder: str) -> None:
    functions = list(described(folder))
    wrong = [f"{n}: {text}" for n, f in functions for text in complaints(f)]
    assert len(functions) >= 4  # all were found
    assert not wrong, "\n".join(["", *wrong])


SAMPLE = '''
class Block:
    def DoCalc(self, context, output): ...
    @property
    def size(self): ...
    def move(self, x_m: float, *, seed: int) -> None:
        """Well said.

        Args:
            x_m: Way, of any
                sign, m.
            seed: Of the noise.

        Raises:
            InputError: Too far.
        """
        raise InputError("x_m", "is too far")
class _Hidden:
    def method(self, a, b): ...
def one(a): ...
def _hidden(a, b): ...
def bare(p: NDArray[np.float64], time_s: float) -> NDArray[np.float64]:
    """Says nothing."""
    def inner():
        raise KeyError
    raise ValueError
def poor(p: NDArray[np.float64], *others, time_s: float) -> NDArray[np.float64]:
    """Says little.

    Args:
        time_s: Of the points.
        p: Points, m.
        *others: More of them.

    Returns:
        Points, m.
    """
    raise AssertionError
def drawn(a, b):
    """Says nothing."""
    yield 1
'''


def test_reader_sees_what_is_left_out() -> None:
    found = {
        name: list(complaints(function))
        for name, function in public_functions(ast.parse(SAMPLE))
        if is_described(function)
    }
    assert found == {
        "Block.move": [],
        "bare": [
            "Args: [], but it takes ['p', 'time_s']",
            "no Returns:",
            "Raises: without ['ValueError']",
        ],
        "poor": [
            "Args: ['time_s', 'p', 'others'], but it takes ['p', 'others', 'time_s']",
            "time_s: no s",
            "p: no shape",
            "Returns: no shape",
        ],
        "drawn": ["Args: [], but it takes ['a', 'b']", "no Yields:"],
    }
