"""Robots that PyPI packages ship: where they are, and the lists that tests and the benchmark go through."""

from importlib.metadata import distribution
from importlib.util import find_spec
from pathlib import Path

EXAMPLES = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))


def package_folder(name: str) -> Path | None:
    """The folder of an installed package, without importing it."""
    spec = find_spec(name)
    return None if spec is None or spec.origin is None else Path(spec.origin).parent


PYBULLET = package_folder("pybullet_data")  # no wheel for Python 3.12 and later

#: Robot -> file, whether its base floats, and joints to lock (links without mass, or the many joints of hands).
URDF: dict[str, tuple[str, bool]] = {
    "ur3": ("ur_description/urdf/ur3_gripper.urdf", False),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", False),
    "ur10": ("ur_description/urdf/ur10_robot.urdf", False),
    "panda": ("panda_description/urdf/panda.urdf", False),
    "kinova": ("kinova_description/robots/kinova.urdf", False),
    "xarm7": ("xarm_description/urdf/xarm7.urdf", False),
    "z1": ("z1_description/urdf/z1.urdf", False),
    "so101": ("so_arm_description/urdf/so101.urdf", False),
    "talos arm": ("talos_data/robots/talos_left_arm.urdf", False),
    "allegro hand": ("allegro_hand_description/urdf/allegro_right_hand.urdf", False),
    "finger": ("finger_edu_description/robots/finger_edu.urdf", False),
    "double pendulum": ("double_pendulum_description/urdf/double_pendulum.urdf", False),
    "two dofs": ("asr_twodof_description/urdf/TwoDofs.urdf", False),
    "baxter": ("baxter_description/urdf/baxter.urdf", False),
    "tiago": ("tiago_description/robots/tiago_no_hand.urdf", False),
    "pr2": ("pr2_description/urdf/pr2.urdf", False),
    "bolt": ("bolt_description/robots/bolt.urdf", True),
    "solo": ("solo_description/robots/solo.urdf", True),
    "solo12": ("solo_description/robots/solo12.urdf", True),
    "quadruped": ("quadruped_description/urdf/quadruped.urdf", True),
    "a1": ("a1_description/urdf/a1.urdf", True),
    "b1 with z1": ("b1_description/urdf/b1-z1.urdf", True),
    "go1": ("go1_description/urdf/go1.urdf", True),
    "anymal": ("anymal_b_simple_description/robots/anymal.urdf", True),
    "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", True),
    "laikago": ("laikago_description/urdf/laikago.urdf", True),
    "iris": ("iris_description/robots/iris_simple.urdf", True),
    "borinot": ("borinot_description/urdf/borinot_flying_arm_2.urdf", True),
    "simple humanoid": ("simple_humanoid_description/urdf/simple_humanoid.urdf", True),
    "g1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", True),
    "icub": ("icub_description/robots/icub.urdf", True),
    "talos": ("talos_data/robots/talos_reduced.urdf", True),
}
#: The same of pybullet_data.
URDF_PYBULLET: dict[str, tuple[str, bool]] = {
    "kuka iiwa": ("kuka_iiwa/model.urdf", False),
    "cart-pole": ("cartpole.urdf", False),
    "pendulum of five": ("pendulum5.urdf", False),
    "racecar": ("racecar/racecar.urdf", True),
    "mini cheetah": ("mini_cheetah/mini_cheetah.urdf", True),
    "minitaur": ("quadruped/minitaur.urdf", True),
}


def urdf_robots() -> dict[str, tuple[Path, bool]]:
    """Name -> file and whether the base floats, of all robots that are installed here."""
    found = {name: (EXAMPLES / file, floating) for name, (file, floating) in URDF.items()}
    if PYBULLET is not None:
        found |= {name: (PYBULLET / file, floating) for name, (file, floating) in URDF_PYBULLET.items()}
    return found


#: Model -> package and file; the folder of its assets is that of the first two parts.  None has equalities, which
#: MuJoCo's ``qacc_smooth`` does not know.
MJCF: dict[str, tuple[str, str]] = {
    "acrobot": ("dm_control", "suite/acrobot.xml"),
    "cart-pole": ("dm_control", "suite/cartpole.xml"),
    "cheetah": ("dm_control", "suite/cheetah.xml"),
    "hopper": ("dm_control", "suite/hopper.xml"),
    "walker": ("dm_control", "suite/walker.xml"),
    "humanoid": ("dm_control", "suite/humanoid.xml"),
    "humanoid of motion capture": ("dm_control", "suite/humanoid_CMU.xml"),
    "fish": ("dm_control", "suite/fish.xml"),
    "ball in cup": ("dm_control", "suite/ball_in_cup.xml"),
    "jaco arm": ("dm_control", "third_party/kinova/jaco_arm.xml"),
    "ant": ("gymnasium_robotics", "envs/mujoco/assets/ant.xml"),
    "humanoid of Gymnasium": ("gymnasium_robotics", "envs/mujoco/assets/humanoid.xml"),
    "pusher": ("gymnasium_robotics", "envs/mujoco/assets/pusher.xml"),
    "shadow hand": ("gymnasium_robotics", "envs/assets/hand/reach.xml"),
}


def mjcf_models() -> dict[str, tuple[Path, Path]]:
    """Name -> file and the folder of its assets."""
    found = {}
    for name, (package, file) in MJCF.items():
        folder = package_folder(package)
        assert folder is not None, package
        found[name] = folder / file, (folder / file).parents[1]
    return found
