"""The printable holder of a sensor unit."""

import sys

import numpy as np
import pytest
from tools.holder import Holder, main, solid


def inside(part, points):
    """Whether points (N, 3) are in a closed mesh: its triangles fill the whole solid angle round them."""
    a, b, c = (part.triangles[None, :, k] - np.asarray(points)[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    below = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
    angle = 2 * np.arctan2((a * np.cross(b, c)).sum(2), below)
    return angle.sum(axis=1) > 2 * np.pi


def test_a_box_with_a_hole_by_hand():
    made = solid([((0, 4), (0, 3), (0, 2))], [((1, 2), (1, 2), (0, 2))])
    assert made.is_volume
    assert made.volume == pytest.approx(4 * 3 * 2 - 2)
    assert made.area == pytest.approx(2 * (12 - 1) + 2 * (4 + 3) * 2 + 4 * 2)


@pytest.mark.parametrize("holder", [Holder(), Holder(length=45.0, wall=1.6, strap=20.0)])
def test_parts_are_whole_and_fit_each_other(holder):
    tray, lid = holder.tray(), holder.lid()
    for part in (tray, lid):
        assert part.is_volume
        assert part.body_count == 1
        assert part.bounds[0, 2] == 0
    np.testing.assert_allclose(lid.extents[:2], [holder.length + 2 * holder.wall, holder.width + 2 * holder.wall])
    assert tray.extents[0] == pytest.approx(lid.extents[0])
    assert tray.extents[2] == holder.wall + holder.height


def test_volume_of_the_lid_by_hand():
    # wires 8 x 5, four screws 2.2 x 2.2, four slots 2.2 x 6, through 2 mm
    assert Holder().lid().volume == pytest.approx(2 * (70 * 38 - 40 - 4 * 2.2**2 - 4 * 2.2 * 6))


def test_the_cell_lies_between_the_posts_and_screws_meet_their_holes():
    holder = Holder()
    tray, lid = holder.tray(), holder.lid()
    rng = np.random.default_rng(1)
    assert not inside(tray, rng.uniform([-26.9, -16.9, 2.1], [26.9, 16.9, 17.9], (200, 3))).any()
    pilot = np.array([holder.length / 2 - 3, holder.width / 2 - 3, 17.0])
    assert not inside(tray, [pilot]).any()
    assert inside(tray, [pilot - [0, 0, 10]]).all(), "the post is solid below its hole"
    assert not inside(lid, [[*pilot[:2], 1.0]]).any()
    assert inside(lid, [[*pilot[:2] - 3, 1.0]]).all()


def test_nonsense_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["holder", str(tmp_path), "--wall", "-1"])
    with pytest.raises(SystemExit, match="--wall is -1 mm"):
        main()
    with pytest.raises(SystemExit, match="too small"):
        Holder(length=20.0)
