"""Judging without ROS: samples of one's own, and a recorded run."""

from pathlib import Path

from irsbot_supervisor import JointSample, Level, Supervisor, judge_bag, read_settings

settings, robot = read_settings("irsbot2", latency_s=0.004)  # keywords override the shipped settings
supervisor, level = Supervisor(settings, robot), Level.UNKNOWN
for k in range(300):  # 0.3 s at 1 kHz: the platform at rest
    now_ns = 1_000_000 * (k + 1)
    q = robot.inverse((0.3, -0.75))
    step = supervisor.step(
        JointSample(now_ns, now_ns, now_ns, settings.joint_names, tuple(q.tolist()), velocity=(0.0, 0.0))
    )
    if step.verdict is not None and step.verdict.level != level:
        level = step.verdict.level
        print(f"{now_ns * 1e-9:.3f} s: {level.name} {step.verdict.text}")
assert level == Level.OK

run = judge_bag(Path(__file__).parents[2] / "bags" / "type2")
for interval in run.levels:
    print(f"{interval.time_s:.3f} s: {interval.level.name} {interval.text}")
print(
    *(f"smallest {margin.margin} margin {margin.value:.3f} at {margin.time_s:.3f} s" for margin in run.margins),
    sep="\n",
)
assert len(run.events) == 1
assert run.differences == ()  # judged as recorded, and as expected
