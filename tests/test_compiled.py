"""Compiled modules: the form for floats says what the one form says, and what is out of date is not used."""

from __future__ import annotations

import ctypes
import ctypes.util
import importlib
import os
import random
import runpy
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from importlib.machinery import EXTENSION_SUFFIXES
from math import atan2, inf, pi, remainder, tau
from pathlib import Path
from typing import Any

import pytest

from irsbot_kinematics import compiled

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "ros2_ws" / "src"
CAMPAIGN = ROOT / "tests" / "campaigns" / "compiled.py"
sys.path.insert(0, str(ROOT / "setup"))
compile_modules = importlib.import_module("compile_modules")
imports = importlib.import_module("imports")
strict_zips = importlib.import_module("strict_zips")
specialise = importlib.import_module("specialise")


def stated(path: list[Path], arguments: list[str]) -> str:
    """What one process of the campaign says, with these folders as its search path."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path)), "IRSBOT_PLAIN": "1"}
    command = [sys.executable, str(CAMPAIGN), "--work", *arguments]
    return subprocess.run(command, env=env, check=True, capture_output=True, text=True, timeout=240).stdout


def test_the_specialised_sources_give_the_results_of_the_sources(tmp_path: Path):
    pytest.importorskip("mypy_extensions", reason="what the compiler gets imports it; it comes with mypy")
    files = [
        file for patterns in compile_modules.GROUPS.values() for file in compile_modules.files_of(SOURCE, patterns)
    ]
    compile_modules.write_sources(
        SOURCE, files, {file: compile_modules.name_of(SOURCE, file) for file in files}, tmp_path
    )
    text = (tmp_path / "irsbot_kinematics" / "mechanisms" / "planar_kinematics.py").read_text()
    assert "def direct__float(" in text
    robots = ["irsbot2", "rrr3", "orthoglide", "ruu4", "rails3"]
    arguments = ["--samples", "100", "--parts", "postures", "--robots", *robots]
    packages = [SOURCE / name for name in compile_modules.PACKAGES]
    theirs = stated(packages, arguments)
    assert len(theirs.splitlines()) == 1 + len(robots)
    assert stated([tmp_path], arguments) == theirs


def test_a_function_on_numbers_is_called_for_floats_where_floats_are_named():
    source = (
        "def twice(k: Arithmetic[N], x: N) -> N:\n    return k.sin(x) + x\n\n\n"
        "def both(k: Arithmetic[N], x: N) -> N:\n    return twice(k, x)\n\n\n"
        "def user(x: float) -> float:\n    return both(FLOATS, x) + both(ARRAYS, x)\n"
    )
    known = set(specialise.generics(source))
    assert known == {"twice", "both"}
    text = specialise.specialised("toy", source, known)
    assert "def both(k: Arithmetic, x: Any) -> Any:\n    return twice(k, x)\n" in text
    assert "def both__float(k: Any, x: float) -> float:\n    return twice__float(k, x)\n" in text
    assert "both__float(FLOATS, x) + both(ARRAYS, x)" in text
    assert "floats__sin(x) + x" in text


def test_a_function_that_names_no_arrays_calls_the_forms_for_floats():
    source = (
        "def det(rows: Rows[N]) -> N:\n    return rows[0][0]\n\n\n"
        "class Platform:\n"
        "    def moved(self, rows: Floats) -> float:\n        return statics.det(rows) + self.det(rows)\n\n"
        "    def columns(self, rows: Array) -> Array:\n        return statics.det(rows)\n\n\n"
        "def sized(legs: Legs[N]) -> N:\n    return statics.det(legs.screws)\n"
    )
    text = specialise.specialised("toy", source, set(specialise.generics(source)) - {"sized"})
    assert "return statics.det__float(rows) + self.det(rows)" in text, "a method may have one form alone"
    assert "def columns(self, rows: Array) -> Array:\n        return statics.det(rows)\n" in text
    assert "def sized(legs: Legs) -> Any:\n    return statics.det(legs.screws)\n" in text


def test_classes_of_the_core_can_be_copied_and_those_of_mechanisms_derived_from():
    source = "from __future__ import annotations\n\n\nclass Kept:\n    pass\n"
    assert "@mypyc_attr(serializable=True, allow_interpreted_subclasses=True)\nclass Kept:" in specialise.specialised(
        "toy", source, set()
    )
    text = specialise.specialised("irsbot_kinematics.toy", source, set())
    assert "@mypyc_attr(native_class=False)\nclass Kept:" in text


LOOPS = '''"""Toy."""

from __future__ import annotations

from operator import add


def sums(left: list[float], right: list[float]) -> list[float]:
    return [a + b for a, b in zip(left, right, strict=True)]


def numbered(left: list[float], right: list[float]) -> list[float]:
    found = []
    for i, (a, b, c) in enumerate(
        zip(
            [2.0 * value for value in left],  # a comment
            right,
            left,
            strict=True,
        )
    ):
        found.append(i * a - b + c)
    return found


def of_iterators(left: list[float], right: list[float]) -> list[float]:
    twice = map(add, left, left)
    return [a + b for a, b in zip(right, twice, strict=True)] + [c for c, _ in zip(left, map(abs, left), strict=True)]


def lenient(left: list[float], right: list[float]) -> list[float]:
    return [a + b for a, b in zip(left, right[1:], strict=False)]


def line() -> int:
    return 0
'''


@pytest.fixture(scope="module")
def loops() -> tuple[dict[str, Any], dict[str, Any], str]:
    """The toy module as it is and with native loops, and the text of the second one."""
    text = strict_zips.native(LOOPS)
    plain: dict[str, Any] = {"__name__": "plain"}
    native: dict[str, Any] = {"__name__": "native"}
    exec(compile(LOOPS, "plain", "exec"), plain)
    exec(compile(text, "native", "exec"), native)
    return plain, native, text


def test_native_loops_give_the_same_results_and_move_no_line(loops: tuple[dict[str, Any], dict[str, Any], str]):
    plain, native, text = loops
    for name in ("sums", "numbered", "of_iterators", "lenient"):
        assert native[name]([1.0, -8.0, 2.5], [3.0, 0.5, 7.0]) == plain[name]([1.0, -8.0, 2.5], [3.0, 0.5, 7.0]), name
    assert text.count("strict=True") == 2, "loops over iterators stay as they are"
    assert "zip(left, as_long__(right, left))" in text
    assert native["line"].__code__.co_firstlineno == plain["line"].__code__.co_firstlineno


@pytest.mark.parametrize("name", ["sums", "numbered"])
def test_native_loops_refuse_sequences_of_different_lengths(
    name: str, loops: tuple[dict[str, Any], dict[str, Any], str]
):
    for left, right in (([1.0], [1.0, 2.0]), ([1.0, 2.0], [1.0]), ([], [1.0])):
        for form in loops[:2]:
            with pytest.raises(ValueError, match="zip"):
                form[name](left, right)


RECORDS = '''"""Toy."""

from __future__ import annotations

from typing import NamedTuple


class Pair(NamedTuple):
    """Two."""

    first: float
    second: float = 2.0

    @property
    def total(self) -> float:
        return self.first + self.second


class Other(NamedTuple):
    """Another order."""

    second: float
    pair: Pair


class Holder:
    """No named tuple."""

    def __init__(self, pair: Pair) -> None:
        self.pair = pair


def given(x: float) -> Pair:
    return Pair(
        first=x,
        second=2.0 * x,  # a comment, with a comma
    )


def nested(x: float) -> Other:
    return Other(x, pair=Pair(x, -x))


def by_default(x: float) -> Pair:
    return Pair(x)


def reversed_order(x: float) -> Pair:
    return Pair(second=x, first=-x)


def read(holder: Holder) -> float:
    return (holder.pair).second - holder.pair.total + nested(holder.pair.first).pair.second


def either(one: Pair | Other) -> float:
    return one.second


def line() -> int:
    return 0
'''


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], dict[str, Any], str]:
    """The toy module as it is and with native named tuples, and the text of the second one."""
    pytest.importorskip("mypy", reason="the types of expressions come from it")
    named_tuples = importlib.import_module("named_tuples")
    folder = tmp_path_factory.mktemp("records")
    file = folder / "toy_records.py"
    file.write_text(RECORDS)
    named_tuples.rewrite([file], ["--config-file=", f"--cache-dir={folder / 'cache'}"])
    plain: dict[str, Any] = {"__name__": "plain"}
    native: dict[str, Any] = {"__name__": "native"}
    exec(compile(RECORDS, "plain", "exec"), plain)
    exec(compile(file.read_text(), "native", "exec"), native)
    return plain, native, file.read_text()


def test_native_named_tuples_have_the_same_values_and_kinds(records: tuple[dict[str, Any], dict[str, Any], str]):
    plain, native, _text = records
    for name in ("given", "nested", "by_default", "reversed_order"):
        theirs, ours = plain[name](3.0), native[name](3.0)
        assert (ours, ours._asdict()) == (theirs, theirs._asdict()), name
        assert type(ours) is native[type(theirs).__name__]
    for form in (plain, native):
        assert form["read"](form["Holder"](form["Pair"](3.0, 5.0))) == 5.0 - 8.0 - 3.0
        assert [form["either"](one) for one in (form["given"](3.0), form["nested"](4.0))] == [6.0, 4.0]


def test_only_what_is_one_named_tuple_is_read_by_number(records: tuple[dict[str, Any], dict[str, Any], str]):
    plain, native, text = records
    assert "(holder.pair)[1] - holder.pair.total + nested(holder.pair[0])[1][1]" in text
    assert "return self[0] + self[1]" in text
    assert "return one.second" in text, "a field of two kinds of named tuples"
    assert "cast__(Pair, new__(Pair, (\n        x,\n        2.0 * x,  # a comment, with a comma\n    )))" in text
    assert "cast__(Other, new__(Other, (x, cast__(Pair, new__(Pair, (x, -x,))),)))" in text
    assert "return Pair(x)\n" in text
    assert "return Pair(second=x, first=-x)\n" in text
    assert native["line"].__code__.co_firstlineno == plain["line"].__code__.co_firstlineno


def test_a_module_with_a_wrong_type_is_not_compiled(tmp_path: Path):
    pytest.importorskip("mypy", reason="the types of expressions come from it")
    file = tmp_path / "toy_wrong.py"
    file.write_text(RECORDS + "\n\nwrong: Pair = 1\n")
    with pytest.raises(SystemExit, match="Incompatible types in assignment"):
        importlib.import_module("named_tuples").rewrite([file], ["--config-file=", f"--cache-dir={tmp_path / 'cache'}"])
    assert file.read_text().startswith(RECORDS)


def test_constants_are_final_where_the_compiler_can_use_their_values():
    head = '"""Toy."""\n\nfrom __future__ import annotations\n'
    body = 'from math import pi\n\nHALF_S = 0.5\nTURN = 2.0 * pi\nN = TypeVar("N")\nsmall = 1\n'
    compiled_form, plain_form = (specialise.final(head + body, compiled=known) for known in (True, False))
    assert "HALF_S: Final__ = 0.5\nTURN: Final__ = 2.0 * pi\nN = TypeVar" in compiled_form
    assert "HALF_S: Final__ = 0.5\nTURN = 2.0 * pi\nN = TypeVar" in plain_form
    for form in (compiled_form, plain_form):
        assert "small = 1\n" in form
        assert len(form.splitlines()) == len((head + body).splitlines())
    assert specialise.final(head, compiled=True) == head


@pytest.mark.parametrize("turn", [tau, inf])
def test_functions_of_c_have_the_bits_of_those_of_python(turn: float):
    c = ctypes.CDLL(ctypes.util.find_library("m"))
    for name in ("remainder", "atan2"):
        getattr(c, name).restype, getattr(c, name).argtypes = ctypes.c_double, [ctypes.c_double] * 2
    chosen = random.Random(f"remainders of {turn}")
    edges = [0.0, -0.0, pi, -pi, 3.0 * pi, 5e-324, 1e6, -1e6]
    for x in edges + [chosen.uniform(-1.0, 1.0) * 10.0 ** chosen.randint(-12, 6) for _ in range(3000)]:
        other = chosen.choice([*edges, x])
        assert struct.pack("<2d", c.remainder(x, turn), c.atan2(x, other)) == struct.pack(
            "<2d", remainder(x, turn), atan2(x, other)
        )


def test_another_compiler_of_ours_means_another_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for name in compile_modules.TOOLS:
        (tmp_path / name).write_bytes((ROOT / "setup" / name).read_bytes())
    monkeypatch.setattr(compile_modules, "__file__", str(tmp_path / "compile_modules.py"))
    sources = ["irsbot_kinematics.statics"]
    before = compile_modules.folder_name(SOURCE, sources)
    assert before.startswith(f"{compiled.digest(sources)}-")
    with (tmp_path / "specialise.py").open("a") as file:
        file.write("# changed\n")
    assert compile_modules.folder_name(SOURCE, sources) != before


def test_a_constant_or_field_that_a_compiled_module_imports_is_one_of_its_sources():
    sources = compile_modules.sources_of(SOURCE)
    named = "irsbot_supervisor.core.settings", "irsbot_kinematics.numerics.tolerances", "irsbot_msgs_py.records"
    through_a_package = "irsbot_kinematics.mechanisms.irsbot2_space.geometry"
    assert {*named, through_a_package, "irsbot_supervisor.core.supervisor"} <= set(sources)
    assert not any(name.startswith("irsbot_supervisor.cli") for name in sources)


def test_imports_are_followed_into_functions_and_packages(tmp_path: Path):
    package = tmp_path / "one" / "one"
    (package / "inner").mkdir(parents=True)
    texts = {
        "begin.py": "import math\nif False:\n    from one.types import T\n",
        "types.py": "def f():\n    from one.inner import deep\n",
        "inner/__init__.py": "import other\n",
        "inner/deep.py": "",
        "apart.py": "import one.begin\n",
    }
    for name, text in texts.items():
        (package / name).write_text(text)
    found = imports.with_imports(tmp_path, ["one"], [package / "begin.py"])
    assert [str(file.relative_to(package)) for file in found] == sorted(texts.keys() - {"apart.py"})


def test_compiled_forms_are_current_until_a_source_changes(tmp_path: Path):
    source = tmp_path / "src"
    for package in compile_modules.PACKAGES:
        shutil.copytree(SOURCE / package / package, source / package / package)
    sources = compile_modules.sources_of(source)
    target = tmp_path / "made"
    assert not compile_modules.is_current(source, target)
    put(target, compile_modules.folder_name(source, sources), sources)
    assert compile_modules.is_current(source, target)
    with (source / "irsbot_supervisor" / "irsbot_supervisor" / "core" / "settings.py").open("a") as file:
        file.write("# changed\n")
    assert not compile_modules.is_current(source, target)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of compiled modules, as the set-up makes it, that is first on the path."""
    monkeypatch.setattr(sys, "meta_path", [one for one in sys.meta_path if not isinstance(one, compiled.Finder)])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delenv(compiled.SWITCH, raising=False)
    yield tmp_path
    sys.modules.pop("irsbot_compiled", None)


def put(folder: Path, digest: str, sources: list[str]) -> None:
    """Write the index."""
    (folder / digest / "irsbot_kinematics").mkdir(parents=True)
    (folder / digest / "irsbot_kinematics" / f"statics{EXTENSION_SUFFIXES[0]}").touch()
    text = f"from pathlib import Path\nFOLDER = Path(__file__).parent / {digest!r}\nSOURCES = {sources!r}\n"
    (folder / "irsbot_compiled.py").write_text(text)


def test_compiled_forms_are_found_only_for_the_sources_they_were_made_of(folder: Path):
    sources = ["irsbot_kinematics.statics"]
    put(folder, f"{compiled.digest(sources)}-tools", sources)
    compiled.prefer()
    assert compiled.are_used()
    found = importlib.util.find_spec("irsbot_kinematics.errors")
    assert found is not None
    assert str(found.origin).endswith("errors.py"), "what is not compiled is found as ever"
    spec = next(one for one in sys.meta_path if isinstance(one, compiled.Finder)).find_spec("irsbot_kinematics.statics")
    assert spec is not None
    assert Path(str(spec.origin)).is_relative_to(folder)


def test_other_sources_mean_plain_python(folder: Path):
    put(folder, compiled.digest(["irsbot_kinematics.errors"]), ["irsbot_kinematics.statics"])
    compiled.prefer()
    assert not compiled.are_used()


def test_a_source_that_is_gone_means_plain_python(folder: Path):
    put(folder, "none", ["irsbot_kinematics.statics", "irsbot_kinematics.gone"])
    compiled.prefer()
    assert not compiled.are_used()
    assert compiled.digest(["irsbot_kinematics.gone"]) == ""


def test_the_switch_means_plain_python(folder: Path, monkeypatch: pytest.MonkeyPatch):
    put(folder, compiled.digest(["irsbot_kinematics.statics"]), ["irsbot_kinematics.statics"])
    monkeypatch.setenv(compiled.SWITCH, "1")
    compiled.prefer()
    assert not compiled.are_used()


def test_the_first_module_of_the_core_that_is_imported_is_compiled_too(tmp_path: Path):
    sources = ["irsbot_kinematics.statics"]
    put(tmp_path, f"{compiled.digest(sources)}-tools", sources)
    for empty in tmp_path.rglob(f"*{EXTENSION_SUFFIXES[0]}"):  # which cannot be imported
        empty.unlink()
    ask = "import sys, irsbot_supervisor.core; print([type(finder).__module__ for finder in sys.meta_path])"
    path = os.pathsep.join(map(str, [tmp_path, *(SOURCE / name for name in compile_modules.PACKAGES)]))
    env = {name: value for name, value in os.environ.items() if name != compiled.SWITCH} | {"PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", ask], env=env, check=True, capture_output=True, text=True)
    assert compiled.Finder.__module__ in done.stdout


needs_compiled = pytest.mark.skipif(
    not compile_modules.is_current(SOURCE, ROOT / "ros2_ws" / "compiled"),
    reason="not compiled, or sources have changed since: ./irsbot setup --compiled",
)


def compiled_run(*command: str) -> str:
    """What Python prints on compiled modules."""
    path = [ROOT / "ros2_ws" / "compiled", *[SOURCE / name for name in compile_modules.PACKAGES], HELPERS]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    done = subprocess.run([sys.executable, *command], env=env, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs_compiled
def test_compiled_modules_give_the_results_of_plain_python():
    out = compiled_run(str(CAMPAIGN), "--samples", "480", "--parts", "postures", "streams")
    assert "0 differ" in out


@pytest.mark.parametrize("form", [True, False])
def test_a_form_is_not_compared_with_itself(monkeypatch: pytest.MonkeyPatch, form: bool):
    start, said = subprocess.Popen, f"print('compiled {form}\\na piece: 1')"
    monkeypatch.setattr(subprocess, "Popen", lambda _command, **more: start([sys.executable, "-c", said], **more))
    assert runpy.run_path(str(CAMPAIGN))["compare"]([]) == 2


@needs_compiled
def test_annotations_of_other_modules_can_be_read_where_mechanisms_are_compiled():
    out = compiled_run(str(ROOT / "docs" / "examples" / "carried_load.py"))
    assert "pressure angle" in out


COPIED = """
from copy import deepcopy

from irsbot_kinematics import compiled
from supervised import ready, sample

assert compiled.are_used()
first, place = ready("{robot}", {pose})
moved = [sample(k, [q + 2e-6 * k * k for q in place]) for k in range(80)]
for one in moved[:40]:
    first.step(one)
second = deepcopy(first)
theirs = [first.step(one) for one in moved[40:]]
assert repr([second.step(one) for one in moved[40:]]) == repr(theirs)  # NaN included
print("equal")
"""
HELPERS = SOURCE / "irsbot_supervisor" / "test" / "helpers"


@needs_compiled
@pytest.mark.parametrize(("robot", "pose"), [("irsbot2", "(0.0, -0.85)"), ("orthoglide", "(0.0, 0.0, 0.0)")])
def test_a_copy_of_a_compiled_supervisor_goes_on_as_the_first_one(robot: str, pose: str):
    assert compiled_run("-c", COPIED.format(robot=robot, pose=pose)) == "equal\n"
