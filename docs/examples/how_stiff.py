"""How far does a robot bend, what does that take off its margins, and how is a structure of one's own described?"""

from pathlib import Path

import irsbot_kinematics as irs
from irsbot_kinematics import stiffness

# The IRSBot-2 of [S1] Table 2, under 100 N across its plane of motion.
design = stiffness.load("irsbot2_table2")
pose = (0.0, -0.8)
moved = stiffness.deflection(design, pose, (0.0, 100.0, 0.0, 0.0, 0.0, 0.0))
print(f"{design.description}: {1e3 * moved[1]:.3f} mm, {stiffness.mass(design):.2f} kg of tubes")
assert abs(moved[1] - 1.1426e-3) < 1e-7

# What 1.5 kg at 60 m/s2 take off the margins of this pose: a slack of each leg, for the proved bounds.
load = stiffness.Load(payload_kg=1.5, acceleration_m_s2=60.0)
slack = float(stiffness.pose_errors(design, [pose], load).slack_m[0])
robot = irs.Robot(design.mechanism)
at = robot.posture(robot.inverse(pose))
bent = design.mechanism.certified_bounds(at, (0.0, 0.0), slack)
print(f"slack {1e3 * slack:.2f} mm: Type 2 margin {at.type2:.4f} rigid, at least {bent.type2:.4f} bent")
assert 0.0 < bent.type2 < at.type2

# The platform of 1.5 kg swings on it.
print(f"first natural frequency {stiffness.frequency(design, pose, 1.5):.1f} Hz")

# An arm with a strut, from a file. The strut takes most of the weight.
frame = stiffness.load(Path(__file__).parent / "frame.yaml")
held = stiffness.deflection(frame, (), (0.0, 0.0, -100.0, 0.0, 0.0, 0.0))
alone = stiffness.Tube(0.04, 0.036, 0.5, "aluminium")
print(f"arm with strut {1e3 * held[2]:.3f} mm, arm alone {-1e5 * stiffness.tube_compliance(alone)[2, 2]:.3f} mm")
assert abs(held[2]) < 0.05 * 100.0 * stiffness.tube_compliance(alone)[2, 2]
