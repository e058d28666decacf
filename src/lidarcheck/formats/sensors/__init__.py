"""Importers of vendors' calibration files: what a file says of its sensor, as a document of a sensor file."""

from lidarcheck.formats.sensors.check import sensor_of_import
from lidarcheck.formats.sensors.imported import Given, Imported, Lacking
from lidarcheck.formats.sensors.recognise import import_sensor
from lidarcheck.formats.sensors.write import document_text, table_text

__all__ = ["Given", "Imported", "Lacking", "document_text", "import_sensor", "sensor_of_import", "table_text"]
