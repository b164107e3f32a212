"""A simulated depth camera beside the arm: the port `Points`, seen by rays through the simulated room."""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np

from pretouch.checks import Checked, Fraction, NonNegative, Positive, PositiveCount
from pretouch.sim.plant import Plant
from pretouch.sim.under_way import ROUNDING_S, UnderWay
from pretouch.types import FloatArray, SeenPoints


@dataclass(frozen=True)
class DepthCameraParams(Checked):
    """How the camera sees and errs: about an Intel RealSense D435, thinned out to a tenth of its pixels in each way."""

    rate_hz: Positive = 30.0
    """Frames per second."""
    columns: PositiveCount = 84
    """Pixels across: the camera's 848, thinned out."""
    rows: PositiveCount = 48
    """Pixels down: the camera's 480, thinned out."""
    field_of_view_deg: Positive = 87.0
    """Width of the view (data sheet of the D400 family; its height, 58 degrees, follows from square pixels)."""
    range_min_m: NonNegative = 0.28
    """Least depth that is measured [m] (data sheet, at the full resolution)."""
    range_max_m: Positive = 3.0
    """Greatest depth that is used [m] (data sheet: ideal range)."""
    noise_1_m: NonNegative = 0.0036
    """Standard deviation of the depth over its square [1/m]. Stereo: disparity noise / (focal length * baseline) =
    0.08 px / (447 px * 0.05 m), with the data sheet's baseline and the focal length of 848 pixels over 87 degrees; the
    disparity noise is an assumption for a textured surface."""
    latency_s: NonNegative = 0.06
    """Time from measurement to arrival [s]: the maker's developers say 60 to 70 ms of depth streams (librealsense,
    discussion 1242)."""
    jitter_s: NonNegative = 0.005
    """Mean of the exponential addition to it [s]: an assumption."""
    frame_loss: Fraction = 0.005
    """Probability that a frame is lost: an assumption."""
    pixel_loss: Fraction = 0.02
    """Probability that a pixel shows nothing: an assumption."""
    edge_m: Positive = 0.1
    """Difference of the depth of neighbours from which there is an edge between them [m]."""
    edge_loss: Fraction = 0.5
    """Probability that a pixel at an edge shows nothing: an assumption."""
    flying: Fraction = 0.1
    """Probability that one that does shows a depth between its neighbours': an assumption."""
    support: PositiveCount = 3
    """Of eight neighbours, how many must lie within `support_m` of a pixel for it to be given out: what a driver's
    filter against flying pixels does."""
    support_m: Positive = 0.03
    """Difference in depth that counts as near there, and three standard deviations of noise [m]."""
    position_error_m: NonNegative = 0.005
    """Standard deviation along each axis by which the camera sits elsewhere than believed [m]: an assumption of a
    careful hand-eye calibration."""
    orientation_error_rad: NonNegative = 0.005
    """Standard deviation about each axis by which it looks elsewhere than believed [rad]: likewise, 0.3 degrees."""


_AROUND = tuple((i, j) for i, j in product((-1, 0, 1), repeat=2) if i or j)
_BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))


class DepthCamera:
    """A depth camera that stands in the simulated room: the port `Points`, sampled and held.

    It sees whatever MuJoCo's rays hit first: objects, the person's hand, the floor, and the arm, which hides what is
    behind it. Its driver leaves out what has no support by its neighbours, and what is out of range. Where the camera
    stands is known only up to an error that the seed draws; `sigma` of each point tells of it as of the noise.
    """

    def __init__(self, plant: Plant, T_O_camera: FloatArray, params: DepthCameraParams, seed: int) -> None:
        """Put a camera where it is believed to be, T_O_camera (4, 4), z along its view and x to the right of it."""
        from scipy.spatial.transform import Rotation  # a fifth of a second, and most trials have no camera

        self._plant, self._params = plant, params
        self._rng = np.random.default_rng([seed, 5])
        self.T_O_camera = np.array(T_O_camera, dtype=np.float64)
        """Where the camera is believed to be."""
        off, turn = self._rng.standard_normal((2, 3))
        error = Rotation.from_rotvec(params.orientation_error_rad * turn).as_matrix()
        self._origin = self.T_O_camera[:3, 3] + params.position_error_m * off
        self._pixels = _rays(params)
        self._rays = np.ascontiguousarray(self._pixels @ (self.T_O_camera[:3, :3] @ error).T)
        rays = len(self._rays)
        self._geom, self._hit, self._normal = np.zeros(rays, np.int32), np.zeros(rays), np.zeros(3 * rays)
        self._due = float(self._rng.uniform(0, 1 / params.rate_hz))
        self._sent = UnderWay[SeenPoints]()
        self._newest = SeenPoints(-np.inf, np.zeros(0), np.zeros((0, 3)), np.zeros(0))
        self.silenced = False
        """Whether it no longer sends."""
        plant.before_each_step(self._sample)

    def read(self) -> SeenPoints:
        """Return the points of the newest frame that has arrived by now."""
        for frame in self._sent.arrived(self._plant.time + ROUNDING_S):
            if frame.heard > self._newest.heard:
                self._newest = frame
        return self._newest

    def _sample(self, time: float) -> None:
        if time < self._due:
            return
        p, rng = self._params, self._rng
        self._due += 1 / p.rate_hz
        frame = self._frame(time)
        arrival, lost = time + p.latency_s + rng.exponential(p.jitter_s), rng.random() < p.frame_loss
        if not lost and not self.silenced:
            self._sent.send(arrival, frame)

    def _frame(self, time: float) -> SeenPoints:
        """Measure; the points are where they would be if the camera were where it is believed to be."""
        p = self._params
        # a pixel at the corner of the view sees as deep, but farther
        farthest = p.range_max_m / float(self._pixels[:, 2].min())
        mujoco.mj_multiRay(
            self._plant.mj_model, self._plant.mj_data, self._origin, self._rays.reshape(-1), None, True, -1,
            self._geom, self._hit, self._normal, len(self._rays), farthest,
        )  # fmt: skip
        true = np.where(self._hit >= 0, self._hit * self._pixels[:, 2], np.inf).reshape(p.rows, p.columns)
        depth = measured_depth(true, p, self._rng)
        given = np.isfinite(depth).ravel()
        away = depth.ravel()[given] / self._pixels[given, 2]
        point = self.T_O_camera[:3, 3] + (away[:, None] * self._pixels[given]) @ self.T_O_camera[:3, :3].T
        noise, turned = p.noise_1_m * depth.ravel()[given] * away, p.orientation_error_rad * away
        sigma = np.sqrt(noise**2 + p.position_error_m**2 + turned**2)
        return SeenPoints(time, np.full(len(point), time), point, sigma)


def looking(position: FloatArray, at: FloatArray) -> FloatArray:
    """Pose T_O_camera (4, 4) of a camera at a place (3,) [m] that looks at another (3,) [m], base frame, upright.

    It must not look straight up or down.
    """
    z = np.asarray(at) - np.asarray(position)
    z = z / np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x = x / np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.column_stack((x, np.cross(z, x), z)), position
    return T


def measured_depth(true: FloatArray, params: DepthCameraParams, rng: np.random.Generator) -> FloatArray:
    """Depth image (rows, columns) [m] that the camera gives out of the true one, NaN where it gives nothing.

    Pixels at edges may show nothing, or fly: a depth anywhere between those of both sides. `true` is infinite where
    there is nothing to be seen; `rng` draws the same numbers whatever is seen.
    """
    p, shape = params, true.shape
    lost, edge_lost, flies, between = rng.random((4, *shape))
    noise = rng.standard_normal(shape)
    beyond = np.where(np.isfinite(true), true, 2.0 * p.range_max_m)
    beside = np.array([_shifted(beyond, i, j) for i, j in _BESIDE])
    low, high = np.fmin.reduce(beside, initial=np.inf), np.fmax.reduce(beside, initial=0.0)
    low, high = np.fmin(low, beyond), np.fmax(high, beyond)
    edge = high - low > p.edge_m
    depth = beyond + p.noise_1_m * beyond**2 * noise
    depth = np.where(edge & (flies < p.flying), low + between * (high - low), depth)
    shown = (lost >= p.pixel_loss) & ~(edge & (edge_lost < p.edge_loss))
    depth = np.where(shown & (depth >= p.range_min_m) & (depth <= p.range_max_m), depth, np.nan)
    near = p.support_m + 3.0 * p.noise_1_m * np.nan_to_num(depth) ** 2
    # a comparison with NaN is never true: pixels without a depth support nothing
    support = sum(np.abs(_shifted(depth, i, j) - depth) <= near for i, j in _AROUND)
    return np.where(support >= p.support, depth, np.nan)


def _shifted(image: FloatArray, down: int, right: int) -> FloatArray:
    """Return an image whose pixels are those beside it, NaN beyond its border."""
    padded = np.pad(image, 1, constant_values=np.nan)
    rows, columns = image.shape
    return padded[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]


def _rays(params: DepthCameraParams) -> FloatArray:
    """Unit vectors (rows * columns, 3) of the pixels, camera frame: x to the right, y down, z along the view."""
    half = np.tan(np.radians(params.field_of_view_deg) / 2)
    across = half * (2 * np.arange(params.columns) + 1 - params.columns) / params.columns
    down = half * (2 * np.arange(params.rows) + 1 - params.rows) / params.columns
    x, y = np.meshgrid(across, down)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1)[:, None])
