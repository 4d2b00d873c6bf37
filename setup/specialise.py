"""A module as the compiler gets it: every equation that is written once for floats and arrays, once more for floats.

The equations of the mechanisms take numbers of type `N` and an `Arithmetic[N]` beside them. A compiler makes native
arithmetic of `float` alone. So of every function whose signature names `N` there are two forms in the result: the
function as it is, on objects, and `<name>__float` on floats, which is called wherever the caller says `FLOATS`.

Loops over `zip(..., strict=True)` take a form that is native too (`strict_zips`).

Nothing else of a module changes, and the order of all operations stays: both forms give the same bits.
"""

from __future__ import annotations

import ast
import re
from typing import NamedTuple

from strict_zips import FUTURE, native

OBJECT = "Any"
FLOAT = "float"
PREFIX = "floats__"
HEADER = (
    "from math import sin as floats__sin, cos as floats__cos, acos as floats__acos, atan2 as floats__atan2; "
    "from math import hypot as floats__hypot, sqrt as floats__sqrt; floats__abs = abs; from typing import Any; "
    "from mypy_extensions import mypyc_attr; "
)
"""The elementary functions on floats, as `FLOATS` has them."""
OWN = ("cos_sin", "safe_sqrt", "minimum", "maximum", "ratio", "quotient", "wrap")
"""Functions of our own among them."""
KINEMATICS = "irsbot_kinematics"
ARITHMETIC = f"{KINEMATICS}.numerics.arithmetic"
WITHOUT_NUMBERS = ("Arithmetic", "Legs")
"""Generic classes that lose their parameter in the compiled form."""

COPIED = "serializable=True, allow_interpreted_subclasses=True"
"""Attributes of classes of the core: supervisors are copied to try several futures. Without the second one, mypyc 2.4
calls no `__init__` of a class that has the first one."""

FOLLOW = """

def _follow(cls: Any) -> None:
    for name in list(vars(cls)):
        if hasattr(cls, f"{name}__float") and f"{name}__float" not in vars(cls):
            setattr(cls, f"{name}__float", _through(name))


def _through(name: str) -> Any:
    def called(self: Any, k: Any, *given: Any) -> Any:
        return getattr(self, name)(FLOATS, *given)

    return called


setattr(Mechanism, "__init_subclass__", classmethod(_follow))
setattr(Legs, "__class_getitem__", classmethod(lambda cls, given: cls))
"""
"""Mechanisms that are not compiled and have their own equation also get it for floats. Modules that are not compiled
read their annotations at run time, and `Legs[N]` is one."""


ARRAYS = re.compile(r"\b(?:np|Array|ARRAYS|NDArray|Any)\b")
"""A function that names none of these works on floats alone."""


class Generic(NamedTuple):
    """A function on numbers of type `N`."""

    node: ast.FunctionDef
    abstract: bool


def functions(source: str) -> list[ast.FunctionDef]:
    """The functions of a module and of its classes, in order."""
    tree = ast.parse(source)
    classes = [one for one in tree.body if isinstance(one, ast.ClassDef)]
    items = [*tree.body, *[item for one in classes for item in one.body]]
    return sorted([item for item in items if isinstance(item, ast.FunctionDef)], key=lambda node: node.lineno)


def generics(source: str) -> dict[str, Generic]:
    """The functions of a module whose signature names `N`, by name."""
    found = {}
    for node in functions(source):
        if _names_n(node):
            decorators = [ast.unparse(decorator) for decorator in node.decorator_list]
            found[node.name] = Generic(node, "abstractmethod" in decorators)
    return found


def _names_n(node: ast.FunctionDef) -> bool:
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    notes = [argument.annotation for argument in arguments if argument.annotation is not None]
    return any(isinstance(part, ast.Name) and part.id == "N" for note in notes for part in ast.walk(note))


def specialised(name: str, source: str, known: set[str]) -> str:
    """The module with both forms. known: names of all functions on `N`, of every module."""
    lines = source.splitlines(keepends=True)
    if name.startswith(f"{KINEMATICS}."):
        _mark_classes(source, lines, "native_class=False")  # others derive from them; attributes are found once
    else:
        _mark_classes(source, lines, COPIED)
    own = generics(source)
    written: list[str] = []
    begin = 0
    for node in functions(source):
        first = min([node.lineno, *[decorator.lineno for decorator in node.decorator_list]]) - 1
        last = node.end_lineno or first
        text = "".join(lines[first:last])
        entry = own.get(node.name)
        generic = entry is not None and entry.node.lineno == node.lineno
        written.append(_rewritten("".join(lines[begin:first]), False, known))
        written.append(_rewritten(text, False, known, on_floats=not generic and not ARRAYS.search(text)))
        if entry is not None and generic:
            written.append(_float_form(text, entry, known))
        begin = last
    written.append(_rewritten("".join(lines[begin:]), False, known))
    return _with_header(name, "".join(written))


def final(text: str, compiled: bool) -> str:
    """A module with its constants marked as such: the compiler then writes their values where they are used. Of a
    module that is not compiled it takes numbers alone."""
    value = r"(?!TypeVar\b)(?=\S)" if compiled else r"(?=-?[\d.][\w.+-]*$)"
    marked, count = re.subn(rf"(?m)^([A-Z][A-Z0-9_]+) = {value}", r"\1: Final__ = ", text)
    return marked.replace(FUTURE, f"{FUTURE}; from typing import Final as Final__", 1) if count else text


def _mark_classes(source: str, lines: list[str], attribute: str) -> None:
    """Give the classes of a module an attribute of the compiler."""
    for node in ast.parse(source).body:
        bases = {ast.unparse(base) for base in getattr(node, "bases", ())}
        if isinstance(node, ast.ClassDef) and not bases & {"NamedTuple", "IntEnum"}:
            first = min([node.lineno, *[decorator.lineno for decorator in node.decorator_list]]) - 1
            lines[first] = f"@mypyc_attr({attribute})\n{lines[first]}"


def _float_form(text: str, entry: Generic, known: set[str]) -> str:
    node = entry.node
    if not entry.abstract:
        return "\n" + _rewritten(text, True, known)
    # A mechanism that is not compiled has the one form alone.
    given = ", ".join("FLOATS" if argument.arg == "k" else argument.arg for argument in node.args.args[1:])
    head = text[text.index("def ") : text.index('"""')] if '"""' in text else text[text.index("def ") :]
    body = f"{head.rstrip()}\n        return self.{node.name}({given})\n"
    return "\n    " + _rewritten(body, True, known - {node.name}).replace(
        f"def {node.name}(", f"def {node.name}__float(", 1
    )


def _with_header(name: str, text: str) -> str:
    """The functions on floats, imported after the line `from __future__`, on that line: no line moves for it."""
    ours = ", ".join(f"_{own} as {PREFIX}{own}" for own in OWN)
    header = HEADER + (f"from {ARITHMETIC} import FLOATS, {ours}" if name != ARITHMETIC else "")
    if name == f"{KINEMATICS}.mechanism":
        text += FOLLOW
    return native(text.replace(f"{FUTURE}\n", f"{FUTURE}; {header}\n", 1))


def _rewritten(text: str, floats: bool, known: set[str], on_floats: bool = False) -> str:
    """A piece of a module in one of the two forms. on_floats: True if the functions of modules that it calls get
    floats; methods may be those of a mechanism that has one form alone."""
    number = FLOAT if floats else OBJECT
    pieces: list[str] = []
    code = _tokens(text)
    index = 0
    while index < len(code):
        word = code[index]
        after = code[index + 1] if index + 1 < len(code) else ""
        if word in WITHOUT_NUMBERS and after == "[" and code[index + 3] == "]":
            pieces.append(OBJECT if word == "Arithmetic" and floats else word)
            index += 4
            continue
        if word == "Generic" and after == "[":
            pieces.append("object")
            index += 4
            continue
        if word in ("Rows", "Pair") and after == "[":
            pieces.append(f"Sequence[Sequence[{number}]]" if word == "Rows" else f"tuple[{number}, {number}]")
            index += 4
            continue
        if word == "N" and code[index + 2 : index + 3] != ["TypeVar"]:
            pieces.append(number)
        elif word == ("k" if floats else "FLOATS") and after == "." and code[index + 2] in ELEMENTARY:
            pieces.append(PREFIX + code[index + 2])
            index += 2
        elif (
            word in known
            and after == "("
            and code[index - 2 : index - 1] != ["class"]
            and (floats or (on_floats and code[index - 2 : index] == ["statics", "."]) or _is_given_floats(code, index))
        ):
            pieces.append(f"{word}__float")
        else:
            pieces.append(word)
        index += 1
    return "".join(pieces)


ELEMENTARY = {"sin", "cos", "acos", "atan2", "hypot", "sqrt", "abs", *OWN}


def _is_given_floats(code: list[str], index: int) -> bool:
    """True if a call names `FLOATS`, or numbers of a posture, which are floats."""
    if code[index - 2 : index - 1] == ["def"]:
        return False
    given = "".join(code[index + 2 : index + 5])
    return given.startswith(("FLOATS", "at."))


def _tokens(text: str) -> list[str]:
    """The words of a piece of a module and the text between them: joined they are the text."""
    found: list[str] = []
    for piece in re.split(r'("""(?:.|\n)*?"""|"[^"\n]*"|#[^\n]*)', text):
        if piece[:1] in ('"', "#"):
            found.append(piece)
        else:
            found += [word for word in re.split(r"(\w+|[\[\](),.])", piece) if word]
    return found
