"""Compiled routines that more than one part uses."""
