"""The taxiway network: guidance lines and runway centrelines cut where they meet, and shortest paths over it."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely.geometry import LineString, Point
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from pipeline.airport.model import Feature, TaxiGraph

LINES = ("TaxiwayGuidanceLine", "StandGuidanceLine", "PaintedCenterline")
TOLERANCE = 1.5
"""Metres within which two ends are held to be one place."""
STAND_GAP = 80.0
"""Metres by which a stand line may end short of the taxiway it leads to."""


@dataclass(frozen=True)
class Route:
    """A way through the network. nodes, edges: indices into the graph. line: None when start and goal are one node."""

    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    length: float
    line: LineString | None


def build_taxi_graph(features: Sequence[Feature], tolerance: float = TOLERANCE) -> TaxiGraph:
    """Cut all taxiway lines, stand lines and runway centrelines of `features` at their crossings and join the ends.

    The feature of an edge is its index in `features`. Lines that end beside a runway centreline (at the runway's edge,
    or a step short of a bent one) are led on to it, and so are stand lines that end short of the taxiway.
    """
    owners = [place for place, one in enumerate(features) if one.kind in LINES and isinstance(one.geometry, LineString)]
    lines = _led_on([features[one] for one in owners], tolerance)
    pieces: list[tuple[LineString, int]] = []
    for owner, line, cuts in zip(owners, lines, _cuts(lines, tolerance), strict=True):
        pieces.extend((piece, owner) for piece in _cut(line, cuts))
    return _joined(pieces, tolerance)


def _led_on(features: list[Feature], tolerance: float) -> list[LineString]:
    runways = [(one.geometry, float(one.properties.get("width_m", 45.0))) for one in features if one.kind == LINES[2]]
    taxiways = [one.geometry for one in features if one.kind == LINES[0]]
    tree = shapely.STRtree(taxiways) if taxiways else None
    stands = shapely.STRtree([one.geometry for one in features if one.kind == LINES[1]])
    made: list[LineString] = []
    for feature in features:
        points = list(feature.geometry.coords)
        if feature.kind == LINES[0]:
            for centreline, width in runways:
                for end, insert in ((points[0], 0), (points[-1], len(points))):
                    reach = centreline.distance(Point(end))
                    if 0.05 < reach <= width / 2 + 8.0 and not _crosses_near(feature.geometry, centreline, Point(end)):
                        points.insert(insert, centreline.interpolate(centreline.project(Point(end))).coords[0])
        elif feature.kind == LINES[1] and tree is not None:
            taxiway = taxiways[int(tree.nearest(feature.geometry))]
            alone = len(stands.query(feature.geometry, predicate="dwithin", distance=tolerance)) == 1
            if alone and tolerance < feature.geometry.distance(taxiway) <= STAND_GAP:
                first, last = Point(points[0]), Point(points[-1])
                near, insert = (first, 0) if taxiway.distance(first) <= taxiway.distance(last) else (last, len(points))
                points.insert(insert, taxiway.interpolate(taxiway.project(near)).coords[0])
        made.append(LineString(points))
    return made


def _crosses_near(line: BaseGeometry, centreline: BaseGeometry, end: Point) -> bool:
    crossing = line.intersection(centreline)
    return not crossing.is_empty and bool(crossing.distance(end) < 60.0)


def _cuts(lines: list[LineString], tolerance: float) -> list[list[float]]:
    cuts: list[list[float]] = [[] for _ in lines]
    if not lines:
        return cuts
    tree = shapely.STRtree(lines)
    first, second = tree.query(lines, predicate="dwithin", distance=tolerance)
    for one, other in zip(first.tolist(), second.tolist(), strict=True):
        if one == other:
            continue
        line = lines[one]
        ends = shapely.points([lines[other].coords[0], lines[other].coords[-1]])
        cuts[one].extend(shapely.line_locate_point(line, ends[shapely.distance(line, ends) <= tolerance]).tolist())
        if one < other:
            meeting = shapely.points(shapely.get_coordinates(shapely.intersection(line, lines[other])))
            cuts[one].extend(shapely.line_locate_point(line, meeting).tolist())
            cuts[other].extend(shapely.line_locate_point(lines[other], meeting).tolist())
    return cuts


def _cut(line: LineString, cuts: list[float]) -> list[LineString]:
    marks = [0.0]
    for mark in sorted(cuts):
        if mark - marks[-1] > 0.5 and line.length - mark > 0.5:
            marks.append(mark)
    marks.append(line.length)
    pieces = (substring(line, low, high) for low, high in pairwise(marks))
    return [one for one in pieces if isinstance(one, LineString) and one.length > 0.0]


def _joined(pieces: list[tuple[LineString, int]], tolerance: float) -> TaxiGraph:
    if not pieces:
        return TaxiGraph((), ())
    ends = np.array([point for line, _ in pieces for point in (line.coords[0], line.coords[-1])])
    pairs = cKDTree(ends).query_pairs(tolerance, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(ends), len(ends)))
    count, label = connected_components(links, directed=False)
    weight = np.bincount(label, minlength=count)
    nodes = np.column_stack([np.bincount(label, ends[:, axis], count) / weight for axis in (0, 1)])
    edges: list[tuple[int, int, float, int, LineString]] = []
    for place, (line, owner) in enumerate(pieces):
        start, end = int(label[2 * place]), int(label[2 * place + 1])
        if start == end and line.length < 2 * tolerance:
            continue
        moved = LineString([tuple(nodes[start]), *line.coords[1:-1], tuple(nodes[end])])
        edges.append((start, end, float(moved.length), owner, moved))
    return TaxiGraph(tuple((float(x), float(y)) for x, y in nodes), tuple(edges))


def adjacency(graph: TaxiGraph) -> csr_matrix:
    """Lengths of the shortest edge between two nodes, symmetric (nodes, nodes)."""
    best: dict[tuple[int, int], float] = {}
    for start, end, length, _, _ in graph.edges:
        key = (min(start, end), max(start, end))
        best[key] = min(length, best.get(key, np.inf))
    pairs = np.array(list(best), dtype=int).reshape(-1, 2)
    lengths = np.array(list(best.values()))
    n = len(graph.nodes)
    both = np.vstack([pairs, pairs[:, ::-1]])
    return csr_matrix((np.concatenate([lengths, lengths]), (both[:, 0], both[:, 1])), shape=(n, n))


def components(graph: TaxiGraph) -> NDArray[np.int32]:
    """(nodes,) number of the connected part that each node is in; part 0 is the one with the most nodes."""
    if not graph.nodes:
        return np.zeros(0, np.int32)
    count, label = connected_components(adjacency(graph), directed=False)
    order = np.argsort(-np.bincount(label, minlength=count), kind="stable")
    rank = np.empty(count, np.int32)
    rank[order] = np.arange(count, dtype=np.int32)
    return rank[label]


def nearest_node(graph: TaxiGraph, east: float, north: float) -> int:
    """The node nearest to a place. Raises ValueError when the graph is empty."""
    if not graph.nodes:
        raise ValueError("the taxiway network is empty")
    return int(np.argmin(np.hypot(*(np.asarray(graph.nodes) - (east, north)).T)))


def shortest_path(graph: TaxiGraph, start: int, goal: int) -> Route | None:
    """The shortest way (Dijkstra 1959) between two nodes; None when there is none."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in graph.nodes]
    for index, (one, other, _, _, _) in enumerate(graph.edges):
        neighbours[one].append((other, index))
        neighbours[other].append((one, index))
    reached: dict[int, float] = {start: 0.0}
    came: dict[int, tuple[int, int]] = {}
    queue: list[tuple[float, int]] = [(0.0, start)]
    while queue:
        length, node = heapq.heappop(queue)
        if node == goal:
            return _route(graph, came, start, goal, length)
        if length > reached[node]:
            continue
        for other, edge in neighbours[node]:
            longer = length + graph.edges[edge][2]
            if longer < reached.get(other, np.inf):
                reached[other] = longer
                came[other] = node, edge
                heapq.heappush(queue, (longer, other))
    return None


def _route(graph: TaxiGraph, came: dict[int, tuple[int, int]], start: int, goal: int, length: float) -> Route:
    nodes, edges = [goal], []
    points: list[tuple[float, ...]] = []
    while nodes[-1] != start:
        before, edge = came[nodes[-1]]
        one, _, _, _, line = graph.edges[edge]
        coordinates = list(line.coords)[:: -1 if one == before else 1]
        points.extend(coordinates if not points else coordinates[1:])
        edges.append(edge)
        nodes.append(before)
    line_through = LineString(points[::-1]) if points else None
    return Route(tuple(nodes[::-1]), tuple(edges[::-1]), length, line_through)
