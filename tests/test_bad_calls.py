"""Bad calls of every command: one line on stderr, exit code 2, no traceback, nothing made and nothing overwritten."""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path
from unittest import mock

import pytest

from irsbot_supervisor.cli.app import commands_of, main, whole_app

ROOT = Path(__file__).parents[1]

FILES = {
    "joints.csv": "joint_1,joint_2\n2.9,-0.17\n",
    "motion.csv": "time_s,joint_1,joint_2\n0,2.9,-0.17\n1,2.9,-0.18\n",
    "moving.csv": "time_s,joint_1,joint_1_velocity\n0,0,0\n1,1,1\n",
    "empty.csv": "joint_1,joint_2\n",
    "words.csv": "joint_1,joint_2\n2.9,left\n",
    "back.csv": "time_s,joint_1,joint_2\n1,2.9,-0.17\n0,2.9,-0.18\n",
    "infinite.csv": "time_s,joint_1,joint_2\n0,inf,-0.17\n",
    "semicolon.csv": "joint_1;joint_2\n2,9;-0,17\n",
    "other.csv": "a,b\n1,2\n",
    "binary.csv": "\x00\xff\x00",
    "no.yaml": "mechanism: [",
    "deep.yaml": "[" * 3000,
    "date.yaml": "description: 2024-13-45\n",
    "list.yaml": "- 1\n",
    "unknown.yaml": "mechanism: seven_bar\ngeometry: {l1: 1.0}\n",
    "extra.yaml": "mechanism: five_bar\ngeometry: {l1: 0.4, l2: 0.4, b: 0.2, l9: 1.0}\n",
    "lacks.yaml": "mechanism: five_bar\ngeometry: {l1: 0.4}\n",
    "negative.yaml": "mechanism: five_bar\ngeometry: {l1: -0.4, l2: 0.4, b: 0.2}\n",
    "mode.yaml": "mechanism: five_bar\ngeometry: {l1: 0.4, l2: 0.4, b: 0.2}\nusual: {assembly_mode: 7}\n",
    "settings.yaml": "type1_stop: 7.0\n",
    "unknown_settings.yaml": "type9_stop: 0.1\n",
    "scenario.yaml": "robots: {irsbot2: {strat: [0, 0]}}\n",
    "far.yaml": "expect: {stop: false}\nrobots: {irsbot2: {start: [9.0, 9.0]}}\nrun: [{wait: 1.0}]\n",
    "params.yaml": "supervisor:\n  ros__parameters:\n    nonsense: 1\n",
    "equations.yaml": "equations: 3\npose: 4\njoints: 5\n",
    "binary.yaml": "\x00\xff\x00",
    "binary.urdf": "\x00\xff\x00",
    "still.yaml": "expect: {stop: false}\nrobots: {irsbot2: {start: [0.0, -0.85]}}\ncycle: [{wait: 0.0}]\n",
    "not.mcap": "this is no bag",
    "story.json": "no story",
    "exists.yaml": "mine",
    "exists.csv": "mine",
    "exists.npz": "mine",
    "exists.png": "mine",
    "exists.html": "mine",
    "exists.xml": "mine",
    "exists.md": "mine",
}

CALLS = """
nonsense
--nonsense
demo --nonsense
demo --scenario nonsense
demo --scenario nofile.yaml
demo --scenario scenario.yaml
demo --scenario no.yaml
demo --scenario deep.yaml
demo --scenario date.yaml
demo --scenario still.yaml
demo --robot nonsense
demo --robot unknown.yaml
demo --seconds 0
demo --seconds nan
demo --seconds many
up --robot nonsense
up --robot nofile.yaml
up --scenario nonsense
up --gate --scenario type2
up --gate --scenario pick_and_place
up --domain 500
up --domain many
up --namespace 9lives
up --params nofile.yaml
ik
ik irsbot2
ik nonsense 0 -0.8
ik nofile.yaml 0 -0.8
ik no.yaml 0 -0.8
ik deep.yaml 0 -0.8
ik date.yaml 0 -0.8
ik list.yaml 0 -0.8
ik unknown.yaml 0 -0.8
ik extra.yaml 0 -0.8
ik lacks.yaml 0 -0.8
ik negative.yaml 0 -0.8
ik mode.yaml 0 -0.8
ik irsbot2 0
ik irsbot2 0 -0.8 1
ik irsbot2 0 low
ik irsbot2 0 nan
ik irsbot2 1e300 0
ik irsbot2 0 -0.8 --mode ++-
ik irsbot2 0 -0.8 --mode up
dk irsbot2
dk irsbot2 1
dk irsbot2 1 2 3
dk irsbot2 1 inf
dk irsbot2 1e300 0
dk irsbot2 1 2 --assembly 7
dk irsbot2 1 2 --assembly up
evaluate irsbot2
evaluate irsbot2 --input joints.csv
evaluate irsbot2 --input nofile.csv --output x.csv
evaluate irsbot2 --input joints.csv --output joints.csv
evaluate irsbot2 --input joints.csv --output joints.csv --force
evaluate irsbot2 --input joints.csv --output exists.csv
evaluate irsbot2 --input joints.csv --output x.xls
evaluate irsbot2 --input joints.csv --output joints.csv/x.csv
evaluate irsbot2 --input empty.csv --output x.csv
evaluate irsbot2 --input words.csv --output x.csv
evaluate irsbot2 --input semicolon.csv --output x.csv
evaluate irsbot2 --input other.csv --output x.csv
evaluate irsbot2 --input not.mcap --output x.csv
evaluate irsbot2 --input joints.csv --output x.csv --assembly 7
evaluate irsbot2 --input joints.csv --output x.csv --load -1
evaluate irsbot2 --input joints.csv --output x.csv --load nan
evaluate nonsense --input joints.csv --output x.csv
replay
replay nofile
replay not.mcap
replay not.mcap --expect nofile.json
replay not.mcap --expect story.json
replay not.mcap --junit exists.xml
replay not.mcap --junit not.mcap --force
replay not.mcap --settings nofile.yaml
replay not.mcap --settings deep.yaml
report not.mcap
report nofile -o x.html
report not.mcap -o x.pdf
report not.mcap -o exists.html
report not.mcap -o x.html
info
info nofile
info not.mcap
salvage not.mcap
salvage nofile -o x.mcap
check-trajectory irsbot2
check-trajectory irsbot2 nofile.csv
check-trajectory irsbot2 joints.csv
check-trajectory irsbot2 back.csv
check-trajectory irsbot2 infinite.csv
check-trajectory irsbot2 semicolon.csv
check-trajectory irsbot2 motion.csv --settings nofile.yaml
check-trajectory irsbot2 motion.csv --settings settings.yaml
check-trajectory irsbot2 motion.csv --settings unknown_settings.yaml
check-trajectory irsbot2 motion.csv --assembly 7
check-trajectory nonsense motion.csv
check-mechanism
check-mechanism nonsense
check-mechanism nofile.yaml
check-mechanism nofile.py
check-mechanism irsbot2 --joints 0
check-mechanism irsbot2 --joints many
check-mechanism irsbot2 --only nonsense
new-mechanism
new-mechanism mine
new-mechanism Mine --legs 9
new-mechanism Mine --platform round
settings nonsense
settings nofile.yaml
settings irsbot2 --file nofile.yaml
settings irsbot2 --file settings.yaml
settings irsbot2 --file unknown_settings.yaml
settings irsbot2 --file list.yaml
settings irsbot2 --file deep.yaml
settings irsbot2 --file date.yaml
limits nonsense
limits irsbot2 --speed fast
limits irsbot2 --speed 1,2,3
limits irsbot2 --speed 0
limits irsbot2 --latency -1
limits irsbot2 --rate 0
limits irsbot2 --rate nan
limits irsbot2 --urdf binary.urdf
limits irsbot2 -o exists.yaml
limits irsbot2 -o joints.csv/x.yaml
limits extra.yaml -o extra.yaml --force
map nonsense
map irsbot2 --what nonsense
map irsbot2 --mode +++
map irsbot2 --mode up
map irsbot2 -o x.jpg
monitor --web --once
monitor --web --web-port 0
monitor --foxglove --json
monitor --foxglove --web
monitor --foxglove --foxglove-port nonsense
monitor --foxglove --foxglove-host nonsense.invalid
up --web --foxglove --foxglove-port 8765
up --foxglove --foxglove-port 65536
map irsbot2 -o exists.png
map irsbot2 --nodes 1
map irsbot2 --box 1 0 0 1
map irsbot2 --box 0 1
map irsbot2 --at 1
map rrr3 -o x.png
map irsbot2 --what force
map irsbot2 --what force --admissible -1
map irsbot2 --what force --admissible 100 --centre 0
map irsbot2 --admissible 100
verdict --domain 500
verdict --wait 0
verdict --namespace 9lives
monitor --namespace 9lives
monitor --web --web-host a..b
monitor --foxglove --foxglove-host .x
reset 1 --by Ann --because x --namespace a//b
set type1_stop 0.1 --namespace 9lives
send velocity 0.1 --namespace a-b
send escape --namespace 9lives
monitor --once --domain 500
monitor --once --wait 0
docs --out exists.csv
docs --out .
reset
reset 1
reset one --by Ann --because x
reset -1 --by Ann --because x
reset 1 --by Ann
reset 1 --by Ann --because x --seed-pose here
set
set nonsense 1
set type1_stop
set type1_stop much
set type1_stop 0.1 0.2
set robot irsbot2
send velocity
send velocity fast
send velocity nan
send velocity 0.1 --seconds 0
send escape now
send escape --seconds 0
send escape --seconds nan
send trajectory nofile.csv
send trajectory moving.csv
send nonsense
bench --nonsense
faults --only nonsense
faults --robot nonsense
faults --workers 0
faults --workers 2 --scheduler tcp://a:1
faults --quick -o exists.md
stiffness nonsense
stiffness deep.yaml
stiffness date.yaml
stiffness irsbot2_table2 0
urdf
urdf nofile.yaml
urdf irsbot2 -o /dev/null/x.urdf
policy
policy nonode
design check nonsense
design check five_bar
design check irsbot2 --set l9=1
design check irsbot2 --set l1=long
design sweep -o x.csv
design sweep --vary l1=1:0:2 -o x.csv
design sweep --vary l1=0:1:2 -o exists.csv
design search --size -1
design search --zone nonsense
design search -o exists.yaml
design size nonsense --largest 0.001
algebra cells nonsense
algebra cells equations.yaml
algebra cells binary.yaml
algebra cells deep.yaml
algebra cells date.yaml
algebra singular 3rpr --fix rho1=17 --box rho2=a:45 --box rho3=0:45 --plot x.png
algebra singular 3rpr --fix rho1=17 --box rho2=0:1/0 --box rho3=0:45 --plot x.png
""".splitlines()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    for name, text in FILES.items():
        (tmp_path / name).write_bytes(text.encode("latin-1"))
    return tmp_path


@pytest.mark.parametrize("call", [call for call in CALLS if call])
def test_a_bad_call_is_one_line_with_exit_code_2_and_nothing_is_written(call: str, folder: Path) -> None:
    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["irsbot", *call.split()]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        pytest.raises(SystemExit) as end,
    ):
        main()
    lines = err.getvalue().strip().splitlines()
    assert (end.value.code, len(lines), out.getvalue()) == (2, 1, ""), err.getvalue() + out.getvalue()
    assert lines[0].startswith("irsbot: ")
    left = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert left == {name: text.encode("latin-1") for name, text in FILES.items()}


def test_every_command_is_called_badly() -> None:
    app = whole_app()
    names = {command.name or command.callback.__name__ for command in commands_of(app) if command.callback is not None}
    assert len([call for call in CALLS if call]) >= 140
    called = {word for call in CALLS for word in call.split()[:2]}
    assert len(app.registered_groups) == 3
    missing = {"zones", "cells", "postures", "names", "singular", "cusps", "configurations", "loop", "robots"}
    assert {name.rstrip("_") for name in names} - called <= missing  # these take what others take, or nothing
