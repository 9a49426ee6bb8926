"""Training: ``run(recipe, folder)`` follows a recipe and returns the best policy."""

from models.training.config import Recipe, RecipeError
from models.training.run import TrainingResult, run
from models.training.trainer import TrainingError

__all__ = ["Recipe", "RecipeError", "TrainingError", "TrainingResult", "run"]
