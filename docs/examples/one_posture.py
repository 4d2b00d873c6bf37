"""One posture of the IRSBot-2: its joints, its margins, and the forces that a load causes."""

import math

import irsbot_kinematics as irs

robot = irs.make_robot("irsbot2")
pose = (0.3, -0.75)  # m, x and z
joints = robot.inverse(pose, (+1, -1))
margins = robot.evaluate(joints, force=math.hypot(10.0, 20.0))

print("joints [rad]:", joints.round(9))
print("Type 2 margin:", round(margins.type2_margin, 9))
print("constraint margin:", round(margins.constraint_margin, 9))
print("clearance [m]:", round(margins.clearance, 9))
print("motor torques for (10, -20) N [N m]:", robot.efforts(pose, joints, (10.0, -20.0)).round(9))

# The worked example of the 2011 geometry, by hand: cos alpha = |sin(psi_I - psi_II)|, R_max = f / cos alpha.
assert math.isclose(margins.type2_margin, abs(math.sin(0.711988228 - 1.671350318)), abs_tol=1e-9)
assert math.isclose(margins.reaction_max[0], math.hypot(10.0, 20.0) / margins.type2_margin)
