"""Nested values as octets and back, and the first place where two of them differ."""

from pipeline.values.codec import ValueCodec, is_value
from pipeline.values.differences import first_difference
from pipeline.values.forms import other_form

__all__ = ["ValueCodec", "first_difference", "is_value", "other_form"]
