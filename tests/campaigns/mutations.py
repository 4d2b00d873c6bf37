"""Changes one operator, comparison, constant or function of the core, the bounds or the mechanisms, and runs the tests
that belong to the module: at least one of them must fail.

    ./irsbot python tests/campaigns/mutations.py --sample 150 --seed 1 --out runs/mutations.json
    ./irsbot python tests/campaigns/mutations.py --only bounds/displacement.py --out runs/displacement.json

A mutant is written into a temporary copy of its package; the tree is not touched. Results are kept after each mutant,
and the same command goes on where it was interrupted. Survivors that equivalent_mutations.yaml lists with a reason do
not count. A comparison is negated: `<` and `<=` differ where two measured numbers are equal to the last digit.
Existing tools do not fit: they change one package below one folder and its tests; here are three, with ROS nodes.
"""

from __future__ import annotations

import argparse
import ast
import copy
import json
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import zip_longest
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import hypothesis  # noqa: F401  loaded once for all
import numpy as np  # noqa: F401
import pytest
import scipy.spatial  # noqa: F401
import yaml
from mutated_tests import tests_of  # type: ignore[import-not-found]

HERE = Path(__file__).resolve().parent
SRC = HERE.parents[1] / "ros2_ws" / "src"
FOLDERS = ("irsbot_supervisor/core", "irsbot_kinematics/bounds", "irsbot_kinematics/mechanisms")
EQUIVALENT = HERE / "equivalent_mutations.yaml"

CPU_S = 300
"""s of processor time for the tests of a mutant; one that loops is killed by it, however busy the machine is."""

ALREADY_LOADED = "ignore::pytest.PytestAssertRewriteWarning"

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult},
    **{ast.Mod: ast.Mult, ast.FloorDiv: ast.Mult, ast.And: ast.Or, ast.Or: ast.And},
    **{ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
    **{ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In},
}
NAMES = {"min": "max", "minimum": "maximum", "any": "all", "sin": "cos"}
NAMES |= {other: name for name, other in NAMES.items()}
ABSOLUTE = ("abs", "fabs")


class Mutant(NamedTuple):
    """One change of one file."""

    module: str
    """Below SRC: irsbot_kinematics/bounds/boxes.py"""
    line: int
    column: int
    before: str
    """Text of the expression."""
    after: str
    source: str
    """The whole file with the change."""

    @property
    def name(self) -> str:
        return f"{self.module}:{self.line}:{self.column}: {self.before} -> {self.after}"


def variants(node: ast.AST) -> Iterator[ast.AST]:
    """The expression with one change at its root."""
    other = copy.deepcopy(node)
    match other:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in OPERATORS:
            other.op = OPERATORS[type(op)]()
            yield other
        case ast.Compare(ops=ops):
            for number, op in enumerate(ops):
                changed = copy.deepcopy(other)
                changed.ops[number] = OPERATORS[type(op)]()
                yield changed
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield ast.Constant(value + 1)
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=[argument, *_]):
            if name in ABSOLUTE:
                yield argument
            elif name in NAMES:
                changed_name = {"id" if isinstance(other.func, ast.Name) else "attr": NAMES[name]}
                other.func.__dict__.update(changed_name)
                yield other


def expressions(node: ast.AST) -> Iterator[ast.expr]:
    """Every expression that is computed: no annotation, no text of an error, nothing inside a format string."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
        return
    for field, value in ast.iter_fields(node):
        if isinstance(node, ast.keyword) and node.arg == "strict":  # of zip: against mistakes of programmers
            continue
        if field in ("annotation", "returns", "decorator_list", "bases") or isinstance(value, str):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from expressions(child)
    if isinstance(node, ast.expr):
        yield node


def mutants(module: str) -> list[Mutant]:
    """All mutants of a file, in order."""
    source = (SRC / module.split("/")[0] / module).read_text(encoding="utf-8")
    lines = source.encode().splitlines(keepends=True)
    begin = [0]
    for line in lines:
        begin.append(begin[-1] + len(line))
    found = []
    for node in expressions(ast.parse(source)):
        first = begin[node.lineno - 1] + node.col_offset
        last = begin[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        for other in variants(node):
            after = ast.unparse(other)
            raw = source.encode()
            changed = (raw[:first] + f"({after})".encode() + raw[last:]).decode()
            found.append(Mutant(module, node.lineno, node.col_offset, ast.unparse(node), after, changed))
    return sorted(found, key=lambda mutant: mutant[:3])


def chosen(modules: list[str], sample: int | None, seed: int) -> list[Mutant]:
    """A sample that takes a mutant of each module in turn; a smaller sample is the beginning of a larger one."""
    decks = []
    for module in modules:
        deck = mutants(module)
        random.Random(f"{seed} {module}").shuffle(deck)
        decks.append(deck)
    random.Random(seed).shuffle(decks)
    return [mutant for turn in zip_longest(*decks) for mutant in turn if mutant is not None][:sample]


def copy_packages(folder: Path) -> Path:
    """A copy of the packages that may be changed."""
    for package in ("irsbot_kinematics", "irsbot_supervisor"):
        passed_over = shutil.ignore_patterns("__pycache__")
        shutil.copytree(SRC / package / package, folder / package, ignore=passed_over)
    return folder


def run_tests(folder: Path, module: str, tests: list[str] | None = None) -> str:
    """Run the tests of a module against the copy, in a process that has the libraries loaded; up to the first that
    fails. Returns that one, empty if all passed. tests: only these."""
    files, keyword = tests_of(module)
    stated = folder / "said"
    words = ["-x", "-q", "-p", "no:cacheprovider", "--hypothesis-profile=thorough", "--tb=no", "-W", ALREADY_LOADED]
    words += ["-o", f"pythonpath={folder}"]
    words += tests or [*(["-k", keyword] if keyword else []), *(str(SRC / file) for file in files)]
    process = multiprocessing.get_context("fork").Process(target=_pytest, args=(folder, stated, words))
    process.start()
    process.join()
    if process.exitcode == 0:
        return ""
    if process.exitcode is not None and process.exitcode < 0:
        return f"signal {-process.exitcode}"  # it loops, and has used its processor time
    lines = stated.read_text().splitlines()
    failed = [line.split(" - ")[0] for line in lines if line.startswith(("FAILED", "ERROR"))]
    if not failed:
        raise RuntimeError("\n".join([f"the tests of {module} did not run, exit code {process.exitcode}", *lines]))
    return failed[0]


def _pytest(folder: Path, stated: Path, words: list[str]) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S))
    with stated.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    os.chdir(HERE.parents[1])
    sys.path.insert(0, str(folder))
    os.environ["PYTHONPATH"] = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])  # for what tests start
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # two mutants of one second can be of one size
    sys.stdout.flush()
    code = pytest.main(words)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(int(code))


@cache
def equivalent() -> dict[tuple[str, str, str, str], dict[str, Any]]:
    """The list of equivalent mutants: module, text of the line, before, after -> entry."""
    listed = yaml.safe_load(EQUIVALENT.read_text(encoding="utf-8")) or []
    return {(entry["module"], entry["line"], entry["before"], entry["after"]): entry for entry in listed}


@cache
def lines_of(module: str) -> list[str]:
    """Lines of a module of the tree, stripped."""
    source = (SRC / module.split("/")[0] / module).read_text(encoding="utf-8")
    return [line.strip() for line in source.splitlines()]


def entry_of(mutant: Mutant) -> tuple[str, str, str, str]:
    """Where the list of equivalent mutants would hold it."""
    return mutant.module, lines_of(mutant.module)[mutant.line - 1], mutant.before, mutant.after


def excused(mutant: Mutant) -> bool:
    """Whether the list of equivalent mutants holds it: at every column, if the entry names none."""
    entry = equivalent().get(entry_of(mutant))
    return entry is not None and mutant.column == entry.get("column", mutant.column)


class Judges:
    """Runs the tests of mutants, some at a time."""

    def __init__(self, scratch: Path, jobs: int) -> None:
        self._sound: set[str] = set()
        self._copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(jobs):
            self._copies.put(copy_packages(scratch / str(number)))

    def killer(self, mutant: Mutant) -> str:
        """The test that fails with the mutant and passes without it; empty if there is none."""
        folder = self._copies.get()
        path = folder / mutant.module
        original = path.read_bytes()
        try:
            path.write_text(mutant.source, encoding="utf-8")
            failed = run_tests(folder, mutant.module)
            path.write_bytes(original)
            what, _, test = failed.partition(" ")
            if what == "FAILED" and test not in self._sound:
                if run_tests(folder, mutant.module, [test]):
                    raise RuntimeError(f"{test} fails without a mutant, too")
                self._sound.add(test)
            return failed
        finally:
            path.write_bytes(original)
            self._copies.put(folder)


def campaign(wanted: list[Mutant], out: Path, jobs: int) -> dict[str, str]:
    """Name of a mutant -> the test that kills it; for those that `out` does not hold yet, the tests are run."""
    results: dict[str, str] = json.loads(out.read_text()) if out.exists() else {}
    todo = [mutant for mutant in wanted if mutant.name not in results]
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(jobs) as pool:
        judges = Judges(Path(scratch), jobs)
        for mutant, failed in zip(todo, pool.map(judges.killer, todo), strict=True):
            results[mutant.name] = failed
            out.write_text(json.dumps(results, indent=1) + "\n")
            print(f"killed   {mutant.name} by {failed}" if failed else f"SURVIVED {mutant.name}", flush=True)
    return results


def main() -> int:
    """Exit code 1 if a mutant survived that is not listed as equivalent."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[""], help="parts of paths of modules: bounds/ core/latch.py")
    parser.add_argument("--like", default="", help="part of the line that stands for a mutant: 'max(moves'")
    parser.add_argument("--sample", type=int, help="so many mutants, spread over the modules; all without this option")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="mutants at the same time")
    parser.add_argument("--out", type=Path, required=True, help="JSON file of results, made or continued")
    parser.add_argument("--list", action="store_true", help="print the mutants and run nothing")
    given = parser.parse_args()
    files = sorted(path for folder in FOLDERS for path in (SRC / folder.split("/")[0] / folder).rglob("*.py"))
    modules = ["/".join(path.relative_to(SRC).parts[1:]) for path in files]
    modules = [module for module in modules if any(part in module for part in given.only)]
    wanted = [mutant for mutant in chosen(modules, given.sample, given.seed) if given.like in mutant.name]
    if given.list:
        print(*(mutant.name for mutant in wanted), sep="\n")
        return 0
    given.out.parent.mkdir(parents=True, exist_ok=True)
    results = campaign(wanted, given.out, given.jobs)
    survivors = [mutant for mutant in wanted if not results[mutant.name]]
    open_ = [mutant for mutant in survivors if not excused(mutant)]
    counted = len(wanted) - len(survivors) + len(open_)
    by_folder = Counter(mutant.module.split("/")[1] for mutant in wanted)
    print(f"{counted - len(open_)} of {counted} killed, {len(survivors) - len(open_)} equivalent ({dict(by_folder)})")
    print(*(mutant.name for mutant in open_), sep="\n")
    return 1 if open_ else 0


if __name__ == "__main__":
    sys.exit(main())
