"""From an OpenStreetMap extract to the map of an airport."""

from pipeline.airport.osm.elements import ImportFault
from pipeline.airport.osm.importer import ATTRIBUTION, LICENCE, airport_geojson

__all__ = ["ATTRIBUTION", "LICENCE", "ImportFault", "airport_geojson"]
