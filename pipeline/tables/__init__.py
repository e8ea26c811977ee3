"""The tables that flow between the stages: frozen, column-wise, declared once with unit and meaning."""

from pipeline.tables.marks import MARKS_A_TURN, first_mark, mark_row, marks_between, passed_marks
from pipeline.tables.node_events import NodeEventKind, NodeEvents
from pipeline.tables.plots import Plots, SectorPlots
from pipeline.tables.schema import Column, Table, TableError, column
from pipeline.tables.sweeps import Detections, Sweeps, VideoFormat
from pipeline.tables.target_reports import TargetCategory, TargetReports
from pipeline.tables.tracks import Source, TargetClass, TrackPhase, Tracks

__all__ = [
    "MARKS_A_TURN",
    "Column",
    "Detections",
    "NodeEventKind",
    "NodeEvents",
    "Plots",
    "SectorPlots",
    "Source",
    "Sweeps",
    "Table",
    "TableError",
    "TargetCategory",
    "TargetClass",
    "TargetReports",
    "TrackPhase",
    "Tracks",
    "VideoFormat",
    "column",
    "first_mark",
    "mark_row",
    "marks_between",
    "passed_marks",
]
