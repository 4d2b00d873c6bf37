"""The set-up of ./irsbot, on temporary copies with toy packages; the real .venv is never touched."""

from __future__ import annotations

import fcntl
import os
import select
import shutil
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from command import PATIENCE_S

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


def test_a_reader_of_the_help_who_goes_away_ends_it_without_a_word(copy):
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-I", "-S", copy / "setup", "--help"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


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


def test_without_machine_code_plain_python_runs_and_the_set_up_says_so(modules, irsbot, copy):
    set_up(modules, copy)
    done = irsbot("setup")  # the copy has no package that could make it
    assert done.returncode == 0
    assert "irsbot: no machine code, plain Python runs (details: " in done.stderr
    assert "Traceback" not in done.stderr
    assert "irsbot_kinematics" in (copy / "runs/setup.log").read_text()


def test_machine_code_that_is_there_is_not_made_again(modules, irsbot, copy):
    set_up(modules, copy)
    (copy / ".venv/bin/python").unlink()
    heard = f'[[ $1 = -m ]] && echo "$@" >> {copy}/asked && exit'
    program(copy / ".venv/bin/python", f'#!/bin/bash\n{heard}\nexec {BASE_PYTHON} "$@"\n')
    assert irsbot("setup").stderr == ""
    assert (copy / "asked").read_text() == "-m irsbot_kinematics.machine_code --check\n"


@pytest.mark.parametrize(("line", "shown"), [("[2/4] /a/b.so", "machine code, 2 of 4"), ("anything else", "")])
def test_the_maker_of_machine_code_shows_how_far_it_is(modules, line, shown):
    assert modules.steps.work.machine_code_activity(line) == shown


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


def test_a_workspace_that_is_sourced_as_well_is_the_same_workspace(irsbot, sourced, copy, tmp_path):
    """The user sources it in one terminal, for `ros2 topic echo`, and not in the other one."""
    workspace = copy / "ros2_ws"
    both = {
        **sourced,
        "AMENT_PREFIX_PATH": f"{workspace}/install/toy:/jazzy",
        "PYTHONPATH": f"{workspace}/build/toy:{sourced['PYTHONPATH']}",
        "COLCON_PREFIX_PATH": f"{workspace}/install",
    }
    show = "import os; print(os.environ['PYTHONPATH'], os.environ['AMENT_PREFIX_PATH'])"
    for variables in (sourced, both, sourced):
        result = irsbot("python", "-c", show, **variables)
        assert (result.returncode, result.stdout) == (0, f"/toy_python:{sourced['PYTHONPATH']} /toy:/jazzy\n")
    assert (tmp_path / "calls").read_text() == "build\n"


@pytest.mark.parametrize("folder", ["build", "install"])
def test_a_build_of_the_user_is_left_alone(irsbot, sourced, copy, tmp_path, folder):
    theirs = copy / "ros2_ws" / folder / "toy" / "theirs"
    theirs.parent.mkdir(parents=True)
    theirs.touch()
    assert refused(irsbot("setup", **sourced), str(theirs.parents[1]), "remove")
    assert theirs.exists()
    assert (tmp_path / "calls").read_text() == ""


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
        build = os.pidfd_open(int(begun.read_text()))  # waits until the build runs
        process.send_signal(number)
        assert process.stderr
        stated = process.stderr.read()
    assert process.returncode == code
    assert stated.splitlines()[-1] == "irsbot: interrupted, the same command resumes"
    assert select.select([build], [], [], PATIENCE_S)[0]  # readable when the build has ended
    os.close(build)
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
