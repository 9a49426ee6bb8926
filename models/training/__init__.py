"""Training: ``run(recipe, folder)`` follows a recipe and returns the best policy."""

from models.training.config import Recipe, RecipeError
from models.training.device import DeviceError
from models.training.run import TrainingResult, run
from models.training.trainer import StoppedError, TrainingError

__all__ = ["DeviceError", "Recipe", "RecipeError", "StoppedError", "TrainingError", "TrainingResult", "run"]
