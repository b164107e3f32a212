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
from pretouch.coverage.surface import on_capsule
from pretouch.coverage.ways import Ways
from pretouch.perception.obstacles import placed_sensors
from pretouch.robot.body import from_axes, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray

_VIEWS = (("from the front left", 20, 40), ("from the back right", 20, 220), ("from below", -35, -50))
"""Title, elevation and azimuth of each view [deg]."""
_ALONG_M, _ROUND = 0.02, 20
_BEAM_M = 0.15
_NEW, _OLD, _NOTHING = "tab:red", "black", (0.75, 0.75, 0.75, 1.0)
_SMOOTH = 6
"""Surface points over which the colour of a piece is averaged."""

Faces = list[tuple[FloatArray, object, object]]
"""Corners (M, 3) [m], colour of the face, colour of its edge."""


def coverage_figure(ways: Ways, coverage: Coverage, skin: Skin, new: frozenset[str] = frozenset()) -> Figure:
    """Draw the arm in its ready posture from three sides; units named in `new` are red."""
    kin = ways.model.kinematics(ways.model.description.q_ready)
    colours, scale = colormaps["viridis"], Normalize(0.0, 1.0)
    faces = _skin_faces(kin, skin, new)
    for corners, share in _surface(ways, coverage, kin):
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
    seen = 100 * coverage.arm.ways
    figure.suptitle(
        f"{ways.model.description.name}, {len(skin.first)} units: {seen:.0f} % of the paths to its surface are seen in"
        " time (grey: the base, or no free path)",
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


def _surface(ways: Ways, coverage: Coverage, kin: Kinematics) -> list[tuple[FloatArray, float]]:
    """Four-cornered pieces of all capsules outside the others, each with the share of the nearest surface points."""
    arm, share = ways.model.capsules, coverage.point_share
    _, a, b, _ = placed(arm, kin)
    pieces = []
    for c in range(len(arm.radius)):
        length = float(np.linalg.norm(arm.b[c] - arm.a[c])) + 2 * float(arm.radius[c])
        u = np.linspace(0.0, 1.0, max(8, int(length / _ALONG_M)) + 1)
        turn = np.linspace(0.0, 2 * np.pi, _ROUND + 1)
        place = np.repeat(u, len(turn)), np.tile(turn, len(u))
        local = on_capsule(arm.a[c], arm.b[c], float(arm.radius[c]), *place)[0].reshape(len(u), len(turn), 3)
        corners = np.stack([local[:-1, :-1], local[1:, :-1], local[1:, 1:], local[:-1, 1:]], axis=2).reshape(-1, 4, 3)
        middle, link = corners.mean(axis=1), int(arm.link[c])
        in_base = corners @ kin.rotation[link].T + kin.position[link]
        outside = ~_inside(in_base.mean(axis=1), a, b, arm.radius, c)
        here = np.flatnonzero((coverage.surface.link == link) & np.isfinite(share))
        if len(here):
            near = cKDTree(coverage.surface.point[here]).query(middle, k=min(_SMOOTH, len(here)))[1]
            colour = share[here][near.reshape(len(middle), -1)].mean(axis=1)
        else:
            colour = np.full(len(middle), np.nan)
        pieces += [(in_base[i], float(colour[i])) for i in np.flatnonzero(outside)]
    return pieces


def _inside(point: FloatArray, a: FloatArray, b: FloatArray, radius: FloatArray, own: int) -> BoolArray:
    """Whether points (N, 3) lie well inside a capsule that is not their own."""
    others = np.arange(len(radius)) != own
    depth = radius[others] - np.linalg.norm(from_axes(point, a[others], b[others])[1], axis=2)
    return np.asarray(depth.max(axis=1) > 0.003)


def _skin_faces(kin: Kinematics, skin: Skin, new: frozenset[str]) -> Faces:
    """Return a small disc for each unit, and its beam as a cone one can look through."""
    position, rotation, _ = placed_sensors(skin.arrays, kin)
    turn = np.linspace(0.0, 2 * np.pi, 13)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(len(turn))])
    faces: Faces = []
    for unit, p, R in zip(skin.units, position, rotation, strict=True):
        half, colour = unit.sensor.angle / 2, _NEW if unit.board in new else _OLD
        faces.append((p + 0.014 * ring @ R.T, colour, colour))
        rim = p + (_BEAM_M * np.array([0, 0, 1]) + _BEAM_M * np.tan(half) * ring) @ R.T
        faces += [(np.array([p, *rim[i : i + 2]]), (0, 0, 0, 0.08), to_rgba(colour, 0.35)) for i in range(12)]
    return faces
