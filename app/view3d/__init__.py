"""The 3D view: a viser scene of the airport, kept up to date from the picture, served through our port at /3d."""

from app.view3d.proxy import router
from app.view3d.view import View3D

__all__ = ["View3D", "router"]
