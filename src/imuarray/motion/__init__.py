"""Motion of the rigid body: states at an instant, random laws, smooth paths."""

from imuarray.motion.state import Motion, SmoothMotion, hand_twisting, normal_motion, sphere_motion
