"""An arm's surface coloured by how much of all approaching objects is seen in time, with its units and their beams."""

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from pretouch.coverage.measure import Coverage
from pretouch.coverage.ways import Ways
from pretouch.perception.obstacles import placed_sensors
from pretouch.robot.body import surface_of
from pretouch.sensing.skin import Skin

_VIEWS = (("from the front left", 20, 40), ("from the back right", 20, 220), ("from below", -35, -50))
"""Title, elevation and azimuth of each view [deg]."""
_SPACING_M = 0.012
"""Distance between the dots that the surface is drawn by [m]."""
_BEAM_M = np.linspace(0.0, 0.15, 16)
"""Distances of dots on the rays of a beam [m]; the first is the unit."""
_NEW, _OLD, _NOTHING = "tab:red", "black", (0.75, 0.75, 0.75, 1.0)
_SMOOTH = 6
"""Surface points over which the colour of a dot is averaged."""


def coverage_figure(ways: Ways, coverage: Coverage, skin: Skin, new: frozenset[str] = frozenset()) -> Figure:
    """Draw the arm in its ready posture from three sides; units named in `new` are red."""
    model, share, scale = ways.model, coverage.point_share, ScalarMappable(Normalize(0.0, 1.0), colormaps["viridis"])
    kin = model.kinematics(model.description.q_ready)
    outside = surface_of(model.capsules, np.ones((len(model.links), 1), np.bool_), kin, _SPACING_M)
    colours = np.tile(_NOTHING, (len(outside.link), 1))
    for link in np.unique(ways.surface.link[np.isfinite(share)]):
        own, here = outside.link == link, (ways.surface.link == link) & np.isfinite(share)
        near = cKDTree(ways.surface.point[here]).query(outside.point[own], k=min(_SMOOTH, here.sum()))[1]
        colours[own] = scale.to_rgba(share[here][near.reshape(own.sum(), -1)].mean(axis=1))
    body = kin.position[outside.link] + np.einsum("nij,nj->ni", kin.rotation[outside.link], outside.point)
    position, rotation, _ = placed_sensors(skin.arrays, kin)
    rays = np.einsum("kij,krj->kri", rotation, skin.cones.rays[skin.cones.kind])
    beams = position[:, None, None] + _BEAM_M[:, None, None] * rays[:, None]
    # one set of dots, which Matplotlib sorts by depth
    dots = np.concatenate([body, beams.reshape(-1, 3)])
    inks = np.array([to_rgba(_NEW if unit.board in new else _OLD) for unit in skin.units]).reshape(-1, 4)
    inks = np.concatenate([colours, np.repeat(inks, rays.shape[1] * len(_BEAM_M), axis=0)])
    sizes = np.full(beams.shape[:3], 0.25)
    sizes[:, 0, 0] = 25.0
    sizes = np.append(np.full(len(body), 9.0), sizes)
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    panels = [figure.add_subplot(1, len(_VIEWS), i + 1, projection="3d") for i in range(len(_VIEWS))]
    for axes, (title, elevation, azimuth) in zip(panels, _VIEWS, strict=True):
        axes.scatter(*dots.T, c=inks, s=sizes, linewidths=0.0, depthshade=False)
        axes.set_box_aspect(np.ptp(dots, axis=0), zoom=1.25)
        axes.set_axis_off()
        axes.view_init(elev=elevation, azim=azimuth)
        axes.set_title(title, fontsize="medium")
    bar = figure.colorbar(scale, ax=panels, shrink=0.8, pad=0.02)
    bar.set_label("share of the paths to it seen in time")
    figure.suptitle(
        f"{model.description.name}, {len(skin.first)} units: {100 * coverage.arm.ways:.0f} % of the paths to its"
        " surface are seen in time (grey: the base, or no free path)",
        fontsize="medium",
    )
    return figure
