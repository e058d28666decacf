"""The laws of a sensor from repeats: scatter of amplitudes and ranges, loss; what its file leaves open is fitted."""

from lidarcheck.ideals.repeats.laws.fit import Laws, fit_laws, predicted_sd
from lidarcheck.ideals.repeats.laws.work import Fitted

__all__ = ["Fitted", "Laws", "fit_laws", "predicted_sd"]
