"""A sensor's beams against its scans: how well they fit, and what beams the scans themselves show."""

from lidarcheck.formats.assign.cloud import Cloud, clouds_of
from lidarcheck.formats.guess.check import LayerFit, ScanCheck, check_scan
from lidarcheck.formats.guess.document import HEAD, document_of
from lidarcheck.formats.guess.guess import Guess, guess_beams

__all__ = ["HEAD", "Cloud", "Guess", "LayerFit", "ScanCheck", "check_scan", "clouds_of", "document_of", "guess_beams"]
