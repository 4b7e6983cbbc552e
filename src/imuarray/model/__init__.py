"""The measurement model, written once: forward functions, effects, noise."""

from imuarray.model import catalogue, timing  # register the effects
from imuarray.model.array_model import ArrayModel, Prediction
from imuarray.model.effects import DATA_EFFECTS, EFFECTS, Effect, effect, read_effects
from imuarray.model.noise import Noise
from imuarray.model.structure import structure_tensor
