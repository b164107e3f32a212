"""An arm's surface coloured by how much of all approaching objects is seen in time, with its units and their beams."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import cKDTree

from pretouch.coverage.measure import Coverage
from pretouch.coverage.ways import Ways
from pretouch.perception.obstacles import placed_sensors
from pretouch.robot.body import surface_of
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray

_VIEWS = (("from the front left", 20, 40), ("from the back right", 20, 220), ("from below", -35, -50))
"""Title, elevation and azimuth of each view [deg]."""
_SPACING_M = 0.016
"""Distance between the plates that the surface is drawn by [m]."""
_BEAM_M = 0.15
_NEW, _OLD, _NOTHING = "tab:red", "black", (0.75, 0.75, 0.75, 1.0)
_SMOOTH = 6
"""Surface points over which the colour of a plate is averaged."""
_TURN = np.linspace(0.0, 2 * np.pi, 13)
_RING = np.column_stack([np.cos(_TURN), np.sin(_TURN), np.zeros(13)])
"""(13, 3) a circle of radius 1 round z."""

Faces = list[tuple[FloatArray, object, object]]
"""Corners (M, 3) [m], colour of the face, colour of its edge."""


def coverage_figure(ways: Ways, coverage: Coverage, skin: Skin, new: frozenset[str] = frozenset()) -> Figure:
    """Draw the arm in its ready posture from three sides; units named in `new` are red."""
    model = ways.model
    kin = model.kinematics(model.description.q_ready)
    colours, scale = colormaps["viridis"], Normalize(0.0, 1.0)
    faces = _skin_faces(kin, skin, new)
    for corners, share in _plates(ways, coverage, kin):
        colour = colours(scale(share)) if np.isfinite(share) else _NOTHING
        faces.append((corners, colour, colour))
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = [figure.add_subplot(1, len(_VIEWS), i + 1, projection="3d") for i in range(len(_VIEWS))]
    for axes, (title, elevation, azimuth) in zip(panels, _VIEWS, strict=True):
        _view(axes, faces)
        axes.view_init(elev=elevation, azim=azimuth)
        axes.set_title(title, fontsize="medium")
    bar = figure.colorbar(ScalarMappable(scale, colours), ax=panels, shrink=0.8, pad=0.02)
    bar.set_label("share of the paths to it seen in time")
    figure.suptitle(
        f"{model.description.name}, {len(skin.first)} units: {100 * coverage.arm.ways:.0f} % of the paths to its"
        " surface are seen in time (grey: the base, or no free path)",
        fontsize="medium",
    )
    return figure


def _view(axes: Axes3D, faces: Faces) -> None:
    pieces, fill, edge = zip(*faces, strict=True)
    axes.add_collection3d(Poly3DCollection(pieces, facecolors=fill, edgecolors=edge, linewidths=0.3))
    corners = np.concatenate(pieces)
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.25)
    axes.set_axis_off()


def _plates(ways: Ways, coverage: Coverage, kin: Kinematics) -> list[tuple[FloatArray, float]]:
    """Plates all over the arm, base frame [m], each with the share of the nearest surface points."""
    model, share = ways.model, coverage.point_share
    outside = surface_of(model.capsules, np.ones((len(model.links), 1), np.bool_), kin, _SPACING_M)
    plates = []
    for link in np.unique(outside.link):
        own, here = outside.link == link, (ways.surface.link == link) & np.isfinite(share)
        colour = np.full(own.sum(), np.nan)
        if here.any():
            near = cKDTree(ways.surface.point[here]).query(outside.point[own], k=min(_SMOOTH, here.sum()))[1]
            colour = share[here][near.reshape(len(colour), -1)].mean(axis=1)
        for point, normal, area, value in zip(*(x[own] for x in outside[1:4]), colour, strict=True):
            across = np.linalg.svd(normal[None])[2]  # rows: the normal, then two vectors across it
            corners = point + 1.4 * np.sqrt(area / np.pi) * _RING[::3, :2] @ across[1:]
            plates.append((kin.position[link] + corners @ kin.rotation[link].T, float(value)))
    return plates


def _skin_faces(kin: Kinematics, skin: Skin, new: frozenset[str]) -> Faces:
    """Return a small disc for each unit, and its beam as a cone one can look through."""
    position, rotation, _ = placed_sensors(skin.arrays, kin)
    faces: Faces = []
    for unit, p, R in zip(skin.units, position, rotation, strict=True):
        wide, colour = np.tan(unit.sensor.angle / 2), _NEW if unit.board in new else _OLD
        faces.append((p + 0.014 * _RING @ R.T, colour, colour))
        rim = p + _BEAM_M * (np.array([0.0, 0.0, 1.0]) + wide * _RING) @ R.T
        faces += [(np.array([p, *rim[i : i + 2]]), (0, 0, 0, 0.08), to_rgba(colour, 0.35)) for i in range(12)]
    return faces
