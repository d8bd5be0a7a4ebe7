"""Random URDFs: every type of joint and of shape, mimics, in any order of the file."""

import numpy as np

Rng = np.random.Generator

KINDS = (
    *("revolute", "continuous", "prismatic", "fixed", "planar", "floating"),
    *("revolute", "prismatic"),
)
SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")
MESH = "m.stl"
"""The one mesh that they name."""


def _words(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.asarray(values).ravel())


def _origin(rng: Rng, far: float) -> str:
    shift, turn = rng.normal(size=3) * far, rng.uniform(-3.0, 3.0, 3)
    return f"<origin xyz='{_words(shift)}' rpy='{_words(turn)}'/>"


def _collision(rng: Rng) -> str:
    radius, length = rng.uniform(0.01, 0.05), rng.uniform(0.02, 0.1)
    scale = rng.uniform(0.005, 0.01, 3) * rng.choice([-1.0, 1.0], 3)
    round_ = f"radius='{radius}' length='{length}'"
    shape = {
        "box": f"<box size='{_words(rng.uniform(0.02, 0.1, 3))}'/>",
        "sphere": f"<sphere radius='{radius}'/>",
        "cylinder": f"<cylinder {round_}/>",
        "capsule": f"<capsule {round_}/>",
        "mesh": f"<mesh filename='{MESH}' scale='{_words(scale)}'/>",
    }[str(rng.choice(SHAPES))]
    return f"<collision>{_origin(rng, 0.05)}<geometry>{shape}</geometry></collision>"


def _joint(rng: Rng, child: int, leaders: list[str]) -> str:
    kind, parts = str(rng.choice(KINDS)), [_origin(rng, 0.4)]
    name, single = f"j{child}", kind in ("revolute", "continuous", "prismatic")
    if kind == "planar":
        parts.append("<axis xyz='0 0 1'/>")
    elif single and rng.random() < 0.8:
        parts.append(f"<axis xyz='{_words(rng.normal(size=3))}'/>")
    if single and leaders and rng.random() < 0.3:
        factor, more = rng.normal(), rng.normal() * 0.1
        leader = rng.choice(leaders)
        followed = f"joint='{leader}' multiplier='{factor}' offset='{more}'"
        parts.append(f"<mimic {followed}/>")
    if kind in ("revolute", "prismatic"):
        parts.append("<limit lower='-3' upper='3' effort='1' velocity='0'/>")
    leaders += [name] if single else []
    ends = f"<parent link='l{rng.integers(0, child)}'/><child link='l{child}'/>"
    return f"<joint name='{name}' type='{kind}'>{ends}{''.join(parts)}</joint>"


def random_urdf(rng: Rng, joints: int) -> str:
    """A robot of so many joints; link l0 is its root."""
    leaders = list[str]()
    moves = [_joint(rng, k, leaders) for k in range(1, joints + 1)]
    links = []
    for k in range(joints + 1):
        count = int(rng.integers(0, 3)) or int(k == 0)
        solids = "".join(_collision(rng) for _ in range(count))
        links.append(f"<link name='l{k}'>{solids}</link>")
    parts = [*links, *moves]
    mixed = [parts[k] for k in rng.permutation(len(parts))]
    return f"<robot name='random'>{''.join(mixed)}</robot>"
