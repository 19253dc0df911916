"""Acclaim files: a skeleton (ASF) whose bones have their own axes and degrees of freedom, and its motion (AMC)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.body.rotations.matrices import of_euler
from toolkit.io.errors import MocapError
from toolkit.io.yaml_reader import read_text
from toolkit.mocap.clip import Clip
from toolkit.mocap.file_skeleton import FileSkeleton, is_person, metres_per_unit

ROOT = "root"


@dataclass(frozen=True)
class Bone:
    """Bone of an ASF skeleton, which starts at its parent's end.

    Attributes
    ----------
    vector : float64 (3,), from its beginning to its end in the rest pose, file units
    frame : float64 (3, 3), the bone's own axes `C` in the rest pose
    channels : degrees of freedom in file order, of tx, ty, tz, rx, ry, rz and l
    """

    name: str
    vector: np.ndarray
    frame: np.ndarray
    channels: list[str]


def _read_asf(file: Path) -> tuple[FileSkeleton, float, bool]:
    """Return an ASF skeleton, the metres of one file unit, and True if its angles are degrees.

    A file unit is an inch divided by the file's `length`, or `metres_per_unit` if that is no person's size.
    """
    sections = _asf_sections(_read(file), file.name)
    for needed in ("root", "bonedata", "hierarchy"):
        if needed not in sections:
            raise MocapError(f"{file.name} has no :{needed} section; it is truncated or not an ASF skeleton")
    try:
        units = {
            line.split()[0].lower(): line.split()[1] for line in sections.get("units", []) if len(line.split()) > 1
        }
        degrees = units.get("angle", "deg").lower().startswith("deg")
        bones = {ROOT: _root_bone(sections["root"], degrees)}
        for block in _blocks(sections["bonedata"], file.name):
            bone = _bone(block, degrees)
            if bone.name in bones:
                raise MocapError(f"{file.name} defines the bone {bone.name!r} twice; remove one")
            bones[bone.name] = bone
        tree = _tree(sections["hierarchy"], bones, file.name)
        length = float(units.get("length", 1.0))
        if not (np.isfinite(length) and length > 0):
            raise ValueError(f"its length unit is {length}")
    except (IndexError, KeyError, ValueError) as error:
        raise MocapError(f"{file.name} cannot be understood ({error!r}); the skeleton is damaged") from error
    size = tree.size()
    metres = 0.0254 / length if is_person(size * 0.0254 / length) else metres_per_unit(size, file.name)
    return tree, metres, degrees


def read_amc(path: str | Path) -> Clip:
    """Read an AMC motion together with the ASF skeleton beside it (`find_asf`).

    A bone's rotation relative to its parent is `C M C^-1`, with its rest frame `C` and `M` composed of its own degrees
    of freedom, the first one applied first. Each joint of the clip is the start of the bone of its name.
    The frame rate is a trailing `_120` of the file name, else 120 (CMU and HDM05), because AMC has none.

    Raises
    ------
    MocapError
        The file is missing, empty or truncated, a frame is missing or has other bones or columns than the skeleton, a
        value is not finite, or no skeleton is found.
    """
    file = Path(path)
    text = _read(file)
    tree, metres, degrees = _read_asf(find_asf(file))
    degrees, body = _amc_header(text, degrees, file.name)
    values = _amc_values(body, tree, file.name)
    named = re.search(r"_(\d+)$", file.stem)
    rate = float(named[1]) if named and 10 <= int(named[1]) <= 1000 else 120.0
    return tree.clip(file.stem, values, rate, metres, degrees=degrees)


def find_asf(amc: str | Path) -> Path:
    """Return the skeleton of an AMC file: the ASF beside it with the longest matching prefix, or the only one.

    Raises
    ------
    MocapError
        There is none, or there are several without a matching name.
    """
    file = Path(amc)
    found = sorted(p for p in file.parent.glob("*") if p.suffix.lower() == ".asf")
    fitting = [p for p in found if file.stem.lower().startswith(p.stem.lower())]
    if fitting:
        return max(fitting, key=lambda p: len(p.stem))
    if len(found) == 1:
        return found[0]
    listed = ", ".join(p.name for p in found) or "none"
    raise MocapError(f"no ASF skeleton for {file.name} beside it (there are: {listed}); put it there")


def _read(file: Path) -> str:
    text = read_text(file, MocapError, "check the path", encoding="latin-1")
    if not text.strip():
        raise MocapError(f"{file.name} is empty; copy it again")
    return text


def _asf_sections(text: str, name: str) -> dict[str, list[str]]:
    sections: dict[str, list[str]] = {}
    lines: list[str] = []
    for raw in text.splitlines():
        line = raw.split("#", 1)[0].strip()
        if line.startswith(":"):
            word, _, rest = line[1:].partition(" ")
            lines = sections.setdefault(word.lower(), [])
            line = rest.strip()
        if line:
            lines.append(line)
    if not sections:
        raise MocapError(f"{name} has no sections (:root, :bonedata, ...); it is not an ASF skeleton")
    return sections


def _blocks(lines: list[str], name: str) -> list[list[str]]:
    blocks: list[list[str]] = []
    inside = False
    for line in lines:
        if line == "begin":
            if inside:
                raise MocapError(f"a bone of {name} has no end; the file is damaged")
            blocks.append([])
            inside = True
        elif line == "end":
            inside = False
        elif inside:
            blocks[-1].append(line)
    if inside:
        raise MocapError(f"{name} stops within a begin/end block; the file is truncated")
    return blocks


def _frame(words: list[str], degrees: bool) -> np.ndarray:
    """Return the matrix of three angles and an order such as XYZ, the first axis applied first."""
    order = words[3].lower()
    return of_euler(order, np.array([float(w) for w in words[:3]]), degrees=degrees, name="a bone's frame")


def _root_bone(lines: list[str], degrees: bool) -> Bone:
    fields = {line.split()[0].lower(): line.split()[1:] for line in lines}
    channels = _channels_of(ROOT, fields.get("order", "TX TY TZ RX RY RZ".split()))
    axes = _frame([*fields.get("orientation", ["0", "0", "0"]), fields.get("axis", ["XYZ"])[0]], degrees)
    return Bone(ROOT, np.zeros(3), axes, channels)


def _channels_of(bone: str, words: list[str]) -> list[str]:
    channels = [word.lower() for word in words]
    if unknown := sorted(set(channels) - {"tx", "ty", "tz", "rx", "ry", "rz", "l"}):
        raise ValueError(f"bone {bone!r} has the unknown degree of freedom {unknown[0]!r}")
    return channels


def _bone(lines: list[str], degrees: bool) -> Bone:
    fields = {line.split()[0].lower(): line.split()[1:] for line in lines}
    direction = np.array([float(w) for w in fields["direction"]])
    if direction.shape != (3,) or not np.isfinite(direction).all():
        raise ValueError(f"bone {fields['name'][0]!r} has the direction {fields['direction']}")
    norm = float(np.linalg.norm(direction))
    vector = direction * (float(fields["length"][0]) / norm) if norm > 0 else np.zeros(3)
    name = fields["name"][0]
    return Bone(name, vector, _frame(fields["axis"], degrees), _channels_of(name, fields.get("dof", [])))


def _tree(lines: list[str], bones: dict[str, Bone], name: str) -> FileSkeleton:
    """Return the skeleton of the hierarchy; each joint is the start of the bone of its name."""
    names, parents = [ROOT], [-1]
    for block in _blocks(lines, name):
        for line in block:
            parent, *children = line.split()
            for child in (parent, *children):
                if child not in bones:
                    raise MocapError(f"{name} has the unknown bone {child!r} in its hierarchy")
            if parent not in names:
                raise MocapError(f"{name} lists the children of {parent!r} before {parent!r} itself")
            names += children
            parents += [names.index(parent)] * len(children)
    ordered, inner = [bones[bone] for bone in names], set(parents)
    tree = FileSkeleton(
        file=name,
        names=names,
        parents=parents,
        offsets=[ordered[parent].vector if parent >= 0 else np.zeros(3) for parent in parents],
        channels=[bone.channels for bone in ordered],
        tips={bone.name: bone.vector for j, bone in enumerate(ordered) if j not in inner},
        frames=[bone.frame for bone in ordered],
        shifted=True,
    )
    tree.check()
    return tree


def _amc_header(text: str, degrees: bool, name: str) -> tuple[bool, str]:
    """Return True if angles are degrees, and the text from the first frame on."""
    place = re.search(r"^\s*1\s*$", text, flags=re.MULTILINE)
    if place is None:
        raise MocapError(f"{name} has no frame 1; it is truncated or not an AMC motion")
    head = text[: place.start()].upper()
    return ":RADIANS" not in head and (degrees or ":DEGREES" in head), text[place.start() :]


def _amc_values(body: str, tree: FileSkeleton, name: str) -> np.ndarray:
    """Return the values (T, columns) as written, in the order of the skeleton's joints."""
    tokens = body.split()
    width = {bone: len(channels) for bone, channels in zip(tree.names, tree.channels, strict=True)}
    layout: list[str] = []
    place = 1
    while place < len(tokens) and not (layout and tokens[place + 1 : place + 2] == layout[:1]):
        bone = tokens[place]
        if bone not in width:
            if layout and not bone[0].isalpha():
                raise MocapError(
                    f"{name} gives bone {layout[-1]!r} more values than the {width[layout[-1]]} of its skeleton"
                )
            raise MocapError(f"{name} moves the bone {bone!r}, which its skeleton {tree.file} does not have")
        layout.append(bone)
        place += 1 + width[bone]
    missing = [bone for bone in tree.names if width[bone] and bone not in layout]
    if missing or not layout:
        raise MocapError(
            f"{name} does not move {', '.join(missing) or 'any bone'} of its skeleton {tree.file} in frame 1"
        )
    stride = place
    frames, left = divmod(len(tokens), stride)
    if left:
        raise MocapError(f"{name} stops within frame {frames + 1}, or a frame has other columns than frame 1")
    if tokens[::stride] != [str(i + 1) for i in range(frames)]:
        raise MocapError(
            f"{name} does not count its frames from 1 to {frames}; frames are missing or have other columns"
        )
    table = {}
    column = 1
    for bone in layout:
        if tokens[column::stride].count(bone) != frames:
            raise MocapError(f"{name} does not list bone {bone!r} at the same place in every frame")
        try:
            columns = [list(map(float, tokens[column + 1 + c :: stride])) for c in range(width[bone])]
        except ValueError as error:
            raise MocapError(f"{name} holds text where bone {bone!r} needs numbers ({error})") from error
        table[bone] = np.array(columns, dtype=np.float64).reshape(width[bone], frames).T
        if not np.isfinite(table[bone]).all():
            raise MocapError(f"{name} holds a value of bone {bone!r} that is not finite; repair or remove the file")
        column += 1 + width[bone]
    return np.concatenate([table[bone] for bone in tree.names if bone in table], axis=1)
