"""Compiles the pure typed core and the kinematics by mypyc. Run in the environment in which they are to run.

    compile_modules.py SOURCE TARGET

SOURCE is `ros2_ws/src`. TARGET gets the extension modules, in a folder named by what their sources hold, and
`irsbot_compiled.py`, which names that folder; `irsbot_kinematics.compiled` imports from there. A target that was made
from the same sources is left as it is. Sources are also the modules that a compiled one imports, directly or through
others: the compiler copies their constants and the numbers of their fields.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from imports import with_imports
from specialise import final, generics, specialised

PACKAGES = ("irsbot_kinematics", "irsbot_msgs_py", "irsbot_supervisor")
GROUPS = {
    "irsbot_kinematics_compiled": (
        "irsbot_kinematics/mechanism.py",
        "irsbot_kinematics/statics.py",
        "irsbot_kinematics/numerics/arithmetic.py",
        "irsbot_kinematics/bounds/displacement.py",
        "irsbot_kinematics/bounds/boxes.py",
        "irsbot_kinematics/bounds/quadratics.py",
        "irsbot_kinematics/bounds/cubics.py",
        "irsbot_kinematics/bounds/sizes.py",
        "irsbot_kinematics/bounds/type2_over_box.py",
        "irsbot_kinematics/mechanisms/[a-z]*.py",
    ),
    "irsbot_supervisor_compiled": (
        "irsbot_supervisor/core/[a-z]*.py",
        "irsbot_supervisor/core/estimation/[a-z]*.py",
    ),
}
"""Modules that are compiled together: calls within a group are as cheap as in C. Two groups compile side by side."""

TOOLS = ("compile_modules.py", "imports.py", "named_tuples.py", "specialise.py", "strict_zips.py")
"""Modules whose change compiles everything again, as a change of a source does."""

INDEX = "irsbot_compiled.py"
"""The index: folder of the compiled form, and its sources."""

LEFT = ("irsbot_kinematics/mechanisms/geometry_checks.py", "irsbot_supervisor/core/settings.py")
"""Modules that read annotations, fields or metadata of classes at run time, and never in a step."""

CONFIG = """[mypy]
explicit_package_bases = true
mypy_path = {path}
ignore_missing_imports = true
disable_error_code = misc, type-arg, valid-type, unused-ignore
[mypy-scipy.*,numba.*,flint.*,matplotlib.*,polars.*,rclpy.*]
follow_imports = skip
"""
BUILD = """
import sys
from mypyc.build import mypycify
from mypyc.ir.ops import ERR_NEVER
from mypyc.ir.rtypes import bool_rprimitive, float_rprimitive
from mypyc.primitives.registry import function_op
from setuptools import setup
name, *files = sys.argv[1:]
for known, arguments, result in (
    ("remainder", 2, float_rprimitive), ("atan2", 2, float_rprimitive), ("isfinite", 1, bool_rprimitive)
):  # those of C have the same bits
    function_op(f"math.{known}", [float_rprimitive] * arguments, result, known, ERR_NEVER)
options = ["--config-file", "mypy.ini", f"--cache-dir=cache_{name}"]  # a cache that is shared may be locked
groups = [(files, name)]  # groups that are stated are open: without them a class of ours with few subclasses accepts
# objects of exactly these classes, and none of a class that a user derives from it
extensions = mypycify([*options, *files], opt_level="1", debug_level="0", separate=groups)
for extension in extensions:
    extension.extra_compile_args += ["-ffp-contract=off"]  # a fused product has other bits
sys.argv = ["setup.py", "--quiet", "build_ext", "--build-lib", "out", "--build-temp", f"objects_{name}"]
setup(name=name, ext_modules=extensions)
"""


def main(source: Path, target: Path) -> None:
    """Compile modules that are not compiled yet."""
    groups = {name: files_of(source, patterns) for name, patterns in GROUPS.items()}
    sources = sources_of(source)
    everything = [file for files in groups.values() for file in files]
    names = {file: name_of(source, file) for file in everything}
    made = target / folder_name(source, sources)
    if not made.is_dir():
        target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target) as folder:
            work = Path(folder)
            write_sources(source, everything, names, work)
            with_native_tuples([place_of(work, names[file]) for file in everything], work)
            compile_groups(groups, source, work)
            (work / "out").rename(made)
    text = f"from pathlib import Path\n\nFOLDER = Path(__file__).parent / {made.name!r}\n"
    text += f"SOURCES = {sources!r}\n"
    fresh = target / "irsbot_compiled.new"
    fresh.write_text(text)
    fresh.replace(target / INDEX)
    for older in target.iterdir():
        if older.is_dir() and older != made:
            shutil.rmtree(older)


def sources_of(source: Path) -> list[str]:
    """Names of the modules whose change compiles everything again."""
    files = [file for patterns in GROUPS.values() for file in files_of(source, patterns)]
    return [name_of(source, file) for file in with_imports(source, PACKAGES, files)]


def folder_name(source: Path, sources: Sequence[str]) -> str:
    """Name of the folder of compiled forms: digest of the sources, then of the modules that compile them."""
    files = {name: place_of(source / name.partition(".")[0], name) for name in sources}
    # the same digest as there; that package itself imports numpy and more
    digest = module_of(source / "irsbot_kinematics" / "irsbot_kinematics" / "compiled.py").digest_of(files)
    tools = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in TOOLS))
    return f"{digest}-{tools.hexdigest()[:8]}"


def is_current(source: Path, target: Path) -> bool:
    """True if the compiled forms in a target are those of the present sources. Much faster than `sources_of`."""
    if not (target / INDEX).exists():
        return False
    index = module_of(target / INDEX)
    return bool(index.FOLDER.is_dir() and index.FOLDER.name == folder_name(source, index.SOURCES))


def module_of(file: Path) -> ModuleType:
    """A module that is imported from its file alone."""
    spec = spec_from_file_location(f"alone_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def name_of(source: Path, file: Path) -> str:
    """Name of the module in a file."""
    return ".".join(file.relative_to(source).with_suffix("").parts[1:])


def files_of(source: Path, patterns: tuple[str, ...]) -> list[Path]:
    """The files of a group, in a fixed order."""
    found = [file for pattern in patterns for file in sorted((source / pattern.split("/")[0]).glob(pattern))]
    return [file for file in found if not str(file).endswith(LEFT)]


def write_sources(source: Path, compiled: list[Path], names: dict[Path, str], work: Path) -> None:
    """Write all packages; the compiled ones in their specialised form."""
    for package in PACKAGES:
        shutil.copytree(source / package / package, work / package, ignore=shutil.ignore_patterns("__pycache__"))
        for module in (work / package).rglob("*.py"):
            module.write_text(final(module.read_text(encoding="utf-8"), compiled=False), encoding="utf-8")
    texts = {file: file.read_text(encoding="utf-8") for file in compiled}
    known = {name for text in texts.values() for name in generics(text)}
    for file, text in texts.items():
        place_of(work, names[file]).write_text(
            final(specialised(names[file], text, known), compiled=True), encoding="utf-8"
        )
    (work / "mypy.ini").write_text(CONFIG.format(path=work))


def place_of(work: Path, name: str) -> Path:
    """File of a module below a folder."""
    return work.joinpath(*name.split(".")).with_suffix(".py")


def with_native_tuples(files: list[Path], work: Path) -> None:
    """Rewrite modules below a folder with named tuples in native form."""
    from named_tuples import rewrite  # it needs mypy, which the environment has and the set-up has not

    rewrite(files, ["--config-file", str(work / "mypy.ini"), "--cache-dir", str(work / "cache_types")])


def compile_groups(groups: dict[str, list[Path]], source: Path, work: Path) -> None:
    """Compile every group in its own process. Raises SystemExit with its output if one fails."""
    (work / "build.py").write_text(BUILD)
    running = {}
    for name, files in groups.items():
        given = [str(file.relative_to(source / file.relative_to(source).parts[0])) for file in files]
        command = [sys.executable, "build.py", name, *given]
        log = (work / f"{name}.log").open("w+")
        running[name] = subprocess.Popen(command, cwd=work, stdout=log, stderr=subprocess.STDOUT), log
    failed = [name for name, (process, _log) in running.items() if process.wait() != 0]
    for name, (_process, log) in running.items():
        log.seek(0)
        print(log.read())
        log.close()
        if name in failed:
            print(f"{name} could not be compiled")
    if failed:
        raise SystemExit(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
