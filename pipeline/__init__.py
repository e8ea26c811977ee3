"""The functional core: tables in, tables out. No clock, no socket, no database, no framework.

SI units and radians throughout, azimuth clockwise from true north, ENU metres about the airport's
reference point, float64 UTC seconds since 1970.
"""
