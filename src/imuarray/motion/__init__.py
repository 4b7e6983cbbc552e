"""How the rigid body moves: states at an instant, random laws, smooth paths."""

from imuarray.motion.random import normal_motion, sphere_motion
from imuarray.motion.smooth import SmoothMotion, hand_twisting
from imuarray.motion.state import Motion
