"""A planned motion, certified before it is driven: of joints or of the platform, between its points too."""

import numpy as np

from irsbot_supervisor import certify, certify_poses, read_settings, survey_poses

settings, robot = read_settings("irsbot2")
times = [0.0, 1.0]  # s

across = certify_poses(robot, settings, times, [(0.3, -0.75), (-0.3, -0.75)])  # straight lines of the platform
assert across.safe
print("across:", "safe, smallest Type 1 margin", round(across.minima[0][0], 3), "at", across.minima[0][1], "s")

too_far = certify_poses(robot, settings, times, [(0.3, -0.75), (1.2, -0.75)])
assert too_far.violation is not None
print("too far:", too_far.violation.text)

there_and_back = survey_poses(robot, settings, [0.0, 1.0, 2.0], [(0.3, -0.75), (1.2, -0.75), (0.3, -0.75)])
for run in there_and_back.runs:  # every violation, not the first alone
    print(f"beyond its limit from {run.first.time_s:.3f} s to {run.until_s:.3f} s")
assert not there_and_back.safe

ends = [robot.inverse(pose) for pose in ((0.3, -0.75), (-0.3, -0.75))]
ends = np.unwrap(ends, axis=0).tolist()  # inverse gives angles in -pi..pi; between points they must not jump by a turn
joints = certify(robot, settings, times, ends)  # straight lines of the joints
at_rest = certify(robot, settings, times, ends, velocities=[(0.0, 0.0)] * 2)  # cubics
assert joints.safe
assert at_rest.safe
print("joints, straight and as cubics:", round(joints.minima[0][0], 3), round(at_rest.minima[0][0], 3))
