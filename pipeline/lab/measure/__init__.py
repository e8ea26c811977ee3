"""Workloads and yardsticks: what is timed and how well it is done."""
