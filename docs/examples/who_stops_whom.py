"""The decision core without ROS: samples in, verdicts out, time is an argument."""

from irsbot_supervisor import JointSample, Level, Supervisor, read_settings

MS = 1_000_000  # ns

settings, robot = read_settings("irsbot2")
supervisor = Supervisor(settings, robot)
left, right = robot.inverse((0.0, -0.8)).tolist()
expectation = []
for cycle in range(400):
    now = 1_000_000_000 + cycle * MS
    rate = 0.0 if cycle < 100 else 10.0  # rad/s: both legs swing upwards and outwards
    left, right = left + rate * 1e-3, right - rate * 1e-3
    step = supervisor.step(JointSample(now, now, now, settings.joint_names, (left, right), (rate, -rate), ()))
    expectation += [(cycle, turn.level.name) for turn in step.transitions]
    if expectation[-1][1] == Level.STOP.name:
        break  # who obeys brakes now

for cycle, level in expectation:
    print(f"{cycle:4d} ms  {level}")
assert [level for _cycle, level in expectation][-1] == Level.STOP.name
