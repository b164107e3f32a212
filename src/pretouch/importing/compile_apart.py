"""A program that compiles an MJCF file, for `importing.mjcf`: MuJoCo bounds neither time nor memory, the system does.

It takes the file, a place for the compiled model, and the bounds. It imports nothing of pretouch, to begin soon.
"""

import resource
import sys

import mujoco


def main(file: str, compiled: str, memory: str, most: str) -> None:
    """Compile a file with so many bytes of memory at most, and refuse more bodies, joints and the like than `most`."""
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        model = mujoco.MjModel.from_xml_path(file)
    except Exception as error:
        sys.exit(" ".join(str(error).split())[:300] or type(error).__name__)
    for name in ("nbody", "njnt", "ngeom", "nu", "neq", "nmesh"):
        if getattr(model, name) > int(most):
            sys.exit(f"{name} is {getattr(model, name)}, more than {most}, so leave out what the arm does not need")
    mujoco.mj_saveModel(model, compiled)


if __name__ == "__main__":
    main(*sys.argv[1:])
