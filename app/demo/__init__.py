"""The demonstration: Orly's recorded traffic as radar video, node events and target reports."""

from app.demo.feed import DemoFeed, demo_feed, warm
from app.demo.scene import demo_settings

__all__ = ["DemoFeed", "demo_feed", "demo_settings", "warm"]
