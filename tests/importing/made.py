"""Small robots to import: texts of URDF files; and units for what came of them."""

from pathlib import Path

from pretouch.coverage.measure import CoverageSetting
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import suggest
from pretouch.robot.description import load_description
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import OWN_SKIN, Skin, save_skin
from pretouch.sim.scene import floor_and_pedestal

BOX = '<geometry><box size="0.08 0.08 0.2"/></geometry>'


INERTIAL = '<inertial><mass value="2"/><inertia ixx=".02" ixy="0" ixz="0" iyy=".02" iyz="0" izz=".01"/></inertial>'


def link(name, shape="", inertial=INERTIAL, what="collision"):
    body = f'<{what}><origin xyz="0 0 0.1"/>{shape}</{what}>' if shape else ""
    return f'<link name="{name}">{inertial}{body}</link>'


def joint(name, parent, child, kind="revolute", axis="0 0 1", xyz="0 0 0.2", rpy="0 0 0",
          limit='<limit lower="-2.8" upper="2.8" velocity="2" effort="40"/>', more=""):  # fmt: skip
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{more}</joint>'
    )


_AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
_LENGTHS = (0.0, 0.2, 0.25, 0.35, 0.25, 0.25, 0.25)


def six_axis(tail="", changed=None):
    """An arm of six joints like the industrial ones, its links boxes, with a flange and a tool frame."""
    parts = [link("base", BOX)]
    for k in range(6):
        more = (changed or {}).get(k + 1, {})
        parts.append(link(f"link{k + 1}", BOX))
        given = {"axis": _AXES[k], "xyz": f"{0.05 * (k == 1)} {0.03 * (k == 3)} {_LENGTHS[k + 1]}", "rpy": "0 0 0.1"}
        parts.append(joint(f"joint{k + 1}", f"link{k}" if k else "base", f"link{k + 1}", **given | more))
    parts += [link("tool0", inertial=""), joint("flange", "link6", "tool0", "fixed", xyz="0 0 0.12", limit="")]
    return f'<robot name="sixer">{"".join(parts)}{tail}</robot>'


def small():
    """An arm of six joints whose links are 0.2 m long: all of its singular values are small."""
    can = '<geometry><cylinder radius="0.04" length="0.2"/></geometry>'
    parts = [link("base", can)]
    for k, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1"), 1):
        parts += [link(f"l{k}", can), joint(f"j{k}", f"l{k - 1}" if k > 1 else "base", f"l{k}", axis=axis)]
    return f'<robot name="small">{"".join(parts)}</robot>'


def written(folder: Path, text: str, name: str = "arm.urdf") -> Path:
    file = folder / name
    file.write_text(text)
    return file


def equipped(folder: Path, units: int = 8) -> Path:
    """Put a skin of suggested units into the folder of an imported arm."""
    model = RobotModel(load_description(folder))
    setting = CoverageSetting(model, floor_and_pedestal(-0.2), CoverageParams(), "paths", 12)
    chosen = suggest(setting.draw(), Skin([], model), units)
    save_skin(Skin([one.unit for one in chosen], model), folder / OWN_SKIN)
    return folder
