"""The set-up of ./irsbot, on temporary copies with toy packages; the real .venv is never touched."""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parent.parent
BASE_PYTHON = os.path.realpath(sys.executable)
FAKE_COLCON = """\
    #!/bin/bash
    echo "build" >> "$CALLS"
    mkdir -p install/toy build/toy
    echo 'export AMENT_PREFIX_PATH=/toy${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH} PYTHONPATH=/toy_python' \\
        > install/local_setup.bash
"""


def program(path: Path, text: str) -> Path:
    """An executable script."""
    path.write_text(textwrap.dedent(text))
    path.chmod(0o755)
    return path


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the entry and the set-up, with one toy package of each kind of file."""
    shutil.copytree(ROOT / "setup", tmp_path / "copy" / "setup", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "irsbot", tmp_path / "copy")
    toy = tmp_path / "copy" / "ros2_ws" / "src" / "toy"
    for file in ("package.xml", "msg/Toy.msg", "toy/__init__.py", "config/toy.yaml"):
        (toy / file).parent.mkdir(parents=True, exist_ok=True)
        (toy / file).write_text("one")
    return tmp_path / "copy"


@pytest.fixture
def tools(tmp_path: Path) -> Path:
    """A directory of programs to be the whole PATH: no Python, no compiler, no colcon."""
    directory = tmp_path / "tools"
    directory.mkdir()
    for name in ("bash", "dirname", "readlink", "mkdir"):
        found = shutil.which(name)
        assert found
        (directory / name).symlink_to(found)
    return directory


@pytest.fixture
def irsbot(copy: Path, tools: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the copy's ./irsbot with these programs and variables alone."""

    def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
        env = {"PATH": str(tools), "HOME": str(copy), **variables}
        return subprocess.run([copy / "irsbot", *arguments], env=env, capture_output=True, text=True, timeout=120)

    return run


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """The modules of the set-up, imported as ./irsbot does."""
    monkeypatch.syspath_prepend(str(ROOT / "setup"))
    import checks
    import environment
    import place
    import problems
    import progress
    import steps

    names = ("checks", "environment", "place", "problems", "progress", "steps", "work", "fingerprint")
    yield SimpleNamespace(
        checks=checks, environment=environment, place=place, problems=problems, progress=progress, steps=steps
    )
    for name in names:
        del sys.modules[name]


@pytest.fixture
def sourced(modules: SimpleNamespace, copy: Path, tools: Path, tmp_path: Path) -> dict[str, str]:
    """Variables of a sourced ROS 2 Jazzy, with stand-ins for colcon, cmake, the compilers and the libraries."""
    (tools / "python3").symlink_to(BASE_PYTHON)
    program(tools / "colcon", FAKE_COLCON)
    for name in ("cmake", "cc", "c++"):
        program(tools / name, "#!/bin/bash\n")
    libraries = tmp_path / "libraries"
    libraries.mkdir()
    for name in modules.problems.MODULES:
        (libraries / f"{name}.py").touch()
    calls = tmp_path / "calls"
    calls.touch()
    jazzy = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/jazzy", "PYTHONPATH": str(libraries), "CALLS": str(calls)}
    return {**jazzy, "HOME": str(copy)}


def set_up(modules: SimpleNamespace, copy: Path) -> SimpleNamespace:
    """Make the copy look completely set up from wheels; its Place."""
    place = modules.place.Place(copy, sourced=False, python=BASE_PYTHON)
    for directory in (copy / ".venv/bin", place.install, place.workspace / "build"):
        directory.mkdir(parents=True)
    (copy / ".venv/bin/python").symlink_to(BASE_PYTHON)
    (place.install / "local_setup.bash").touch()
    modules.environment.save({"PYTHONPATH": ["/toy_python"], "AMENT_PREFIX_PATH": ["/toy"]}, place.paths_file)
    for step in modules.steps.all_steps(place):
        step.mark(complete=True)
    return place


def titles(modules: SimpleNamespace, place: SimpleNamespace) -> list[str]:
    return [step.title for step in modules.steps.missing_steps(place)]


def refused(result: subprocess.CompletedProcess[str], *words: str) -> bool:
    """One sentence, exit code 2, no traceback, and all of these words."""
    lines = [line for line in result.stderr.splitlines() if line.startswith("irsbot: ")]
    return (
        result.returncode == 2
        and "Traceback" not in result.stderr
        and len(result.stderr.splitlines()) == len(lines) == 1
        and all(word in lines[0] for word in words)
    )


# What a machine can lack


def test_without_python_the_sentence_says_which_ones_would_do(irsbot, copy):
    assert refused(irsbot("demo"), "none found", "3.10, 3.11 or 3.12", "apt install", "IRSBOT_PYTHON")
    assert not (copy / ".venv").exists()


def test_a_python_that_is_too_old_is_named(irsbot, tools):
    old = "import sys; sys.version_info = (3, 8, 18); exec(sys.argv[4])"
    program(tools / "python3", f"#!/bin/bash\nexec {BASE_PYTHON} -c '{old}' \"$@\"\n")
    assert refused(irsbot("demo"), "python3 is Python 3.8", "3.10, 3.11 or 3.12")


def test_a_suitable_python_is_taken_where_python3_is_not(irsbot, tools):
    program(tools / "python3", "#!/bin/bash\nexit 1\n")
    (tools / "python3.11").symlink_to(BASE_PYTHON)
    assert refused(irsbot("demo"), "C compiler")  # past the search for Python


def test_a_python_named_by_the_user_is_the_only_one_tried(irsbot, tools):
    (tools / "python3").symlink_to(BASE_PYTHON)
    assert refused(irsbot("demo", IRSBOT_PYTHON="/bin/false"), "/bin/false does not run")


def test_without_a_compiler_nothing_is_begun(irsbot, tools, copy):
    (tools / "python3").symlink_to(BASE_PYTHON)
    assert refused(irsbot("test"), "C compiler", "apt install build-essential")
    assert not (copy / ".venv").exists()


def test_a_compiler_that_does_not_compile_is_missing_too(irsbot, tools):
    (tools / "python3").symlink_to(BASE_PYTHON)
    program(tools / "cc", "#!/bin/bash\n")
    program(tools / "c++", "#!/bin/bash\nexit 1\n")
    assert refused(irsbot("test"), "C++ compiler")


def test_an_unreachable_index_is_a_missing_network(irsbot, tools, copy):
    (tools / "python3").symlink_to(BASE_PYTHON)
    for name in ("cc", "c++"):
        program(tools / name, "#!/bin/bash\n")
    result = irsbot("demo", PIP_INDEX_URL="http://127.0.0.1:9/simple", PIP_CONFIG_FILE=os.devnull, PIP_NO_CACHE_DIR="1")
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert "index cannot be reached" in result.stderr.splitlines()[-1]
    assert str(copy / "runs" / "setup.log") in result.stderr


def test_too_little_disk_space_is_refused_with_both_numbers(modules, monkeypatch, tmp_path):
    monkeypatch.setattr(shutil, "disk_usage", lambda directory: SimpleNamespace(free=1.2e9))
    with pytest.raises(modules.problems.ProblemError, match=r"1\.2 GB are free and 2\.5 GB are needed"):
        modules.problems.need_space(tmp_path)


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "disk is full"),
        ("socket.gaierror: [Errno -3] Temporary failure in name resolution", "index cannot be reached"),
        ("urllib3.exceptions.ReadTimeoutError: HTTPSConnectionPool(...): Read timed out.", "index cannot be reached"),
        ("ERROR: No matching distribution found for ros-rclpy==7.1.6", "lacks a version"),
        ("OSError: [Errno 13] Permission denied: '/usr/lib'", "writable"),
    ],
)
def test_a_failed_step_is_explained_by_its_output(modules, copy, output, words):
    def work(place: object, progress: SimpleNamespace, before: str) -> None:
        progress.run(["bash", "-c", f"echo {output!r}; exit 1"], cwd=copy, env=os.environ)

    place = modules.place.Place(copy, sourced=False, python=BASE_PYTHON)
    step = modules.steps.Step("toy", copy / "stamp.json", (), "base", "key", work)
    progress = modules.progress.Progress(place.log, total=1)
    with progress, pytest.raises(modules.problems.ProblemError, match=words):
        modules.steps._take(step, place, progress)
    assert step.state() == "begun"
    assert output.split()[-1] in place.log.read_text()


# What is done again, and what is not


def test_an_up_to_date_set_up_needs_no_compiler_and_no_network(modules, irsbot, copy):
    set_up(modules, copy)
    show = "import os; print(os.environ['PYTHONPATH'], os.environ['AMENT_PREFIX_PATH'], os.environ['ROS_DISTRO'])"
    foreign = {"ROS_DISTRO": "humble", "AMENT_PREFIX_PATH": "/opt/ros/humble", "PYTHONPATH": "/opt/ros/humble/python"}
    result = irsbot("python", "-c", show, **foreign)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout == f"/toy_python /toy:{copy}/.venv jazzy\n"
    assert not (copy / "runs").exists()


def test_inside_its_own_environment_it_does_not_take_itself_for_a_sourced_ros(modules, irsbot, copy):
    set_up(modules, copy)
    show = "import os; print(os.environ['AMENT_PREFIX_PATH'], os.environ['LD_LIBRARY_PATH'])"
    once = irsbot("python", "-c", show)
    nested = irsbot("shell", "-c", f'{copy}/irsbot python -c "{show}"')
    assert once.stdout == f"/toy:{copy}/.venv {copy}/.venv/lib\n"
    assert nested.stdout == once.stdout


def test_where_python_must_not_write_beside_modules_it_compiles_them_once_all_the_same(irsbot, modules, copy, tmp_path):
    place = set_up(modules, copy)
    library = tmp_path / "library"
    library.mkdir()
    (library / "toy_module.py").write_text("one = 1")
    load = "import sys; sys.path[0] = sys.argv[1]; import toy_module; print(toy_module.__cached__)"
    forbidden = irsbot("python", "-c", load, str(library), PYTHONDONTWRITEBYTECODE="1")
    kept = Path(forbidden.stdout.strip())
    assert kept.is_file()
    assert place.byte_code in kept.parents
    assert [file.name for file in library.iterdir()] == ["toy_module.py"]
    usual = irsbot("python", "-c", load, str(library))
    assert Path(usual.stdout.strip()).parent == library / "__pycache__"
    own = irsbot("python", "-c", load, str(library), PYTHONDONTWRITEBYTECODE="1", PYTHONPYCACHEPREFIX=str(copy / "own"))
    assert copy / "own" in Path(own.stdout.strip()).parents


def test_byte_code_of_temporary_modules_does_not_pile_up(modules, copy, tmp_path):
    place = set_up(modules, copy)
    for folder in ("lasting", "gone/below"):
        (tmp_path / folder).mkdir(parents=True)
        (place.byte_code / tmp_path.relative_to("/") / folder).mkdir(parents=True)
    shutil.rmtree(tmp_path / "gone")
    modules.checks.forget_removed(place.byte_code)
    assert [kept.name for kept in (place.byte_code / tmp_path.relative_to("/")).iterdir()] == ["lasting"]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("ros2_ws/src/toy/toy/__init__.py", []),
        ("ros2_ws/src/toy/toy/new_module.py", []),
        ("ros2_ws/src/toy/config/toy.yaml", []),
        ("ros2_ws/src/toy/config/new.yaml", ["workspace"]),
        ("ros2_ws/src/toy/msg/Toy.msg", ["workspace"]),
        ("ros2_ws/src/toy/package.xml", ["workspace"]),
        ("setup/requirements.txt", ["ROS 2 and libraries", "workspace"]),
    ],
)
def test_only_what_depends_on_a_changed_file_is_done_again(modules, copy, change, expected):
    place = set_up(modules, copy)
    assert titles(modules, place) == []
    (copy / change).write_text("two")
    assert titles(modules, place) == expected


def test_a_half_installed_or_moved_environment_is_made_anew(modules, copy, tmp_path):
    place = set_up(modules, copy)
    everything = [step.title for step in modules.steps.all_steps(place)]
    copy.rename(tmp_path / "moved")
    assert titles(modules, modules.place.Place(tmp_path / "moved", False, BASE_PYTHON)) == everything
    (tmp_path / "moved").rename(copy)
    modules.steps.all_steps(place)[1].mark(complete=False)
    assert titles(modules, place) == everything


def test_a_sourced_jazzy_is_used_as_it_is_and_built_upon_once(irsbot, sourced, copy, tmp_path):
    show = "import os; print(os.environ['PYTHONPATH'], os.environ['AMENT_PREFIX_PATH'])"
    for _ in range(2):
        result = irsbot("python", "-c", show, **sourced)
        assert result.returncode == 0, result.stderr
        assert result.stdout == f"/toy_python:{sourced['PYTHONPATH']} /toy:/jazzy\n"
    assert (tmp_path / "calls").read_text() == "build\n"
    assert not (copy / ".venv").exists()
    (copy / "ros2_ws/src/toy/msg/Toy.msg").write_text("two")
    assert irsbot("setup", **sourced).returncode == 0
    assert (tmp_path / "calls").read_text() == "build\n" * 2


def test_a_library_missing_beside_a_sourced_jazzy_is_named_with_its_package(irsbot, sourced):
    Path(sourced["PYTHONPATH"], "typer.py").unlink()
    assert refused(irsbot("demo", **sourced), "has no typer", "apt install python3-typer")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_set_up_leaves_nothing_that_is_trusted(sourced, copy, tools, tmp_path, number, code):
    half_made, begun = copy / "ros2_ws/build/toy/half_made", tmp_path / "begun"
    os.mkfifo(begun)
    slow = f"mkdir -p {half_made.parent}; : > {half_made}; echo $$ > {begun}; exec {shutil.which('sleep')} 60"
    program(tools / "colcon", f"#!/bin/bash\n{slow}\n")
    env = {**sourced, "PATH": str(tools)}

    def heed_ctrl_c() -> None:  # which a shell makes its background jobs ignore
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    command = [copy / "irsbot", "setup"]
    with subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True, preexec_fn=heed_ctrl_c) as process:
        build = int(begun.read_text())  # waits until the build runs
        process.send_signal(number)
        assert process.stderr
        stated = process.stderr.read()
    assert process.returncode == code
    assert stated.splitlines()[-1] == "irsbot: interrupted, the same command resumes"
    with pytest.raises(ProcessLookupError):
        os.kill(build, 0)
    assert half_made.exists()
    program(tools / "colcon", FAKE_COLCON)
    again = subprocess.run(command, env=env, capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "calls").read_text() == "build\n"
    assert not half_made.exists()


def test_a_second_set_up_waits_for_the_first_and_finds_its_work_done(sourced, copy, tools, tmp_path):
    lock = os.open(copy / "setup", os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    env = {**sourced, "PATH": str(tools)}
    with subprocess.Popen([copy / "irsbot", "setup"], env=env, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        assert "waiting" in process.stderr.readline()
        assert (tmp_path / "calls").read_text() == ""
        os.close(lock)
        process.stderr.read()
    assert process.returncode == 0
    assert (tmp_path / "calls").read_text() == "build\n"


# The checks


def test_every_check_runs_and_one_failure_fails_the_whole(modules, tmp_path, capfd):
    commands = [("first", ["bash", "-c", "echo one; exit 3"]), ("second", ["bash", "-c", "echo two"])]
    assert modules.checks.run_checks(commands, tmp_path, os.environ) == 1
    stated = capfd.readouterr().out
    assert "one" in stated
    assert "two" in stated
    assert "FAILED (exit code 3)" in stated.split("== summary")[1]
    assert modules.checks.run_checks(commands[1:], tmp_path, os.environ) == 0


def test_arguments_of_the_test_command_go_to_pytest_alone(modules):
    assert [name for name, _ in modules.checks.checks("python", [])] == ["ruff check", "ruff format", "mypy", "pytest"]
    [(name, command)] = modules.checks.checks("python", ["-k", "margin"])
    assert name == "pytest"
    assert command[-2:] == ["-k", "margin"]


def test_all_tests_are_spread_over_the_cores_and_a_file_stays_in_one_process(modules):
    _name, command = modules.checks.checks("python", [])[-1]
    workers = int(next(word for word in command if word.startswith("--numprocesses=")).partition("=")[2])
    assert 1 <= workers <= len(os.sched_getaffinity(0))
    assert "--dist=loadfile" in command


def test_files_with_nodes_come_first_then_slow_ones(tmp_path):
    shutil.copy(ROOT / "conftest.py", tmp_path)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    ros\n    slow\n")
    for name, mark in (("a", "xfail"), ("b", "slow"), ("c", "ros"), ("d", "slow")):
        test = f"import pytest\n\ndef test_first():\n    pass\n\n@pytest.mark.{mark}\ndef test_second():\n    pass\n"
        (tmp_path / f"test_{name}.py").write_text(test)
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    collected = [line for line in done.stdout.splitlines() if "::" in line]
    assert collected == [f"test_{name}.py::test_{which}" for name in "cbda" for which in ("first", "second")]


INTERRUPTED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import checks

def interrupt(number, frame):
    raise KeyboardInterrupt(number)

signal.signal(signal.SIGTERM, interrupt)
signal.signal(signal.SIGINT, signal.SIG_DFL)  # a background job of a shell ignores it
tidy = "trap 'echo tidied; exit 7' INT; echo begun; while true; do sleep 0.1; done"
checks.run_checks([("tests", ["bash", "-c", tidy])], Path("."), os.environ)
"""


def test_a_check_that_is_interrupted_ends_in_order_before_the_command_does(copy):
    command = [sys.executable, "-c", INTERRUPTED, str(copy / "setup")]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout
        assert "begun\n" in iter(process.stdout.readline, "")
        process.terminate()
        assert process.stdout.read() == "tidied\n"
    assert process.returncode != 0


INTERRUPTED_AT_START = """
popen = checks.subprocess.Popen
def start(*given, **named):
    process = popen(*given, **named)
    os.kill(os.getpid(), signal.SIGTERM)  # before anybody holds the process
    return process
checks.subprocess.Popen = start
"""


def test_a_check_that_is_interrupted_while_it_starts_ends_too(copy):
    preparation, call = INTERRUPTED.split("tidy = ")
    script = f"{preparation}{INTERRUPTED_AT_START}tidy = {call}"
    command = [sys.executable, "-c", script, str(copy / "setup")]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            process.communicate(timeout=60.0)  # until the check has closed its output, too
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode != 0
