"""The sensor model: from what a beam meets to its echoes."""

from lidarcheck.model.chain import echoes_of, simulate
from lidarcheck.model.files.model_file import load_model, save_model
from lidarcheck.model.light import light_of
from lidarcheck.model.spec import External, Model
from lidarcheck.model.trace import expected_trace

__all__ = ["External", "Model", "echoes_of", "expected_trace", "light_of", "load_model", "save_model", "simulate"]
