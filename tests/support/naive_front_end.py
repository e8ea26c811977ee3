"""Slow, obvious twins of the kernels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.detect.hybrid import Hybrid, HybridState
from pipeline.detect.hybrid_map import HybridMapState
from pipeline.detect.macro_cells import MacroCells
from pipeline.tables import Sweeps, VideoFormat


def square_labels(part: Hybrid, video: VideoFormat) -> NDArray[np.int64]:
    """(azimuths, ranges) macro-cell of each cell, from the grid."""
    grid = MacroCells.build(video, part.macro_cell_m)
    stripe = np.arange(video.azimuths) // grid.stripe_rows
    label = np.empty((video.azimuths, video.ranges), int)
    for k, first in enumerate(grid.first.astype(int)):
        stop = int(grid.first[k + 1]) if k + 1 < len(grid.first) else len(grid.until)
        cell = first + np.searchsorted(grid.until[first:stop], stripe, side="right")
        label[:, int(grid.groups[k]) * 8 : int(grid.groups[k + 1]) * 8] = cell[:, None]
    return label


def hybrid_masks(
    part: Hybrid, blocks: Sequence[Sweeps], label: NDArray[np.int64], state: HybridState | HybridMapState
) -> list[NDArray[np.bool_]]:
    """Detections of whole scans, macro-cell by macro-cell, from the text of the paper (state: only its constants are
    used)."""
    many = label.max() + 1
    assert set(np.unique(label)) == set(range(many))
    full = np.bincount(label.ravel(), minlength=many)
    level, weight = np.zeros(many), np.zeros(many)
    masks = []
    for block in blocks:
        ready = weight >= part.learn_scans - 0.5
        loss = state.loss_steps / np.maximum(weight * full, 1)
        limit = np.where(ready, np.minimum(np.floor(level + state.offset_steps + loss + 0.5), 255), 255)
        here = label[block.row]
        masks.append(block.amplitude > limit[here])
        seen = np.bincount(here.ravel(), minlength=many)
        total = np.bincount(here.ravel(), weights=block.amplitude.ravel(), minlength=many)
        heard = seen > 0
        share = seen[heard] / full[heard]
        weight[heard] = np.minimum(weight[heard] + share, part.memory)
        level[heard] += (total[heard] / seen[heard] - level[heard]) * share / weight[heard]
    return masks


def m_graph_components(cells: NDArray[np.bool_], reach: NDArray[np.int64]) -> list[frozenset[tuple[int, int]]]:
    """Connected components of eq. (1.2) by comparing all pairs of cells. cells: (rows, ranges). reach: (ranges)."""
    at = np.argwhere(cells)
    label = np.arange(len(at))
    for a in range(len(at)):
        for b in range(a):
            distance = abs(at[a] - at[b]).sum()
            if distance <= min(reach[at[a, 1]], reach[at[b, 1]]) and label[a] != label[b]:
                label[label == label[a]] = label[b]
    return [frozenset(map(tuple, at[label == one].tolist())) for one in np.unique(label)]
