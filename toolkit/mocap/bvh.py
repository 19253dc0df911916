"""Reader of Biovision hierarchy files (BVH): joint tree, channels and rotation order per joint, table of frames."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from toolkit.io.errors import MocapError
from toolkit.io.yaml_reader import read_text
from toolkit.mocap.clip import Clip
from toolkit.mocap.file_skeleton import FileSkeleton, metres_per_unit

CHANNELS = {
    "xposition": "tX", "yposition": "tY", "zposition": "tZ", "xrotation": "rX", "yrotation": "rY", "zrotation": "rZ",
}  # fmt: skip
"""Channel in small letters -> that of `FileSkeleton`."""


def read_bvh(path: str | Path) -> Clip:
    """Read a BVH file.

    The channels of a joint apply in the order of their list (`Zrotation Yrotation Xrotation` is Rz Ry Rx). A position
    channel of any joint replaces that axis of its OFFSET, as in other readers. Angles in the file are degrees.

    Parameters
    ----------
    path : the file

    Raises
    ------
    MocapError
        The file is missing, empty or truncated, its number of frames or columns differs from its header, a value is not
        finite, a word is unknown, or its unit cannot be guessed.
    """
    file = Path(path)
    head, motion = _sections(file)
    tree = _parse_hierarchy(head, file.name)
    values, frame_rate = _parse_motion(motion, sum(map(len, tree.channels)), file.name)
    if not (size := tree.size()):
        raise MocapError(f"all joints of {file.name} lie in one place: its offsets are 0; export it again")
    return tree.clip(file.stem, values, frame_rate, metres_per_unit(size, file.name))


def _sections(file: Path) -> tuple[str, str]:
    text = read_text(file, MocapError, "check the path", errors="replace")
    if not text.strip():
        raise MocapError(f"{file.name} is empty; export it again")
    head, word, motion = text.partition("MOTION")
    if not head.lstrip("\ufeff \t\r\n").startswith("HIERARCHY"):
        raise MocapError(f"{file.name} does not begin with HIERARCHY; it is not a BVH file")
    if not word:
        raise MocapError(f"{file.name} has no MOTION section; the file is truncated")
    return head, motion


def _parse_hierarchy(head: str, name: str) -> FileSkeleton:
    tree = FileSkeleton(name)
    stack: list[int] = []  # joints with an open brace; -1 is an end site
    tokens = iter(head.lstrip("\ufeff").split()[1:])
    pending = -2  # joint of the next brace; -2 means none
    try:
        for token in tokens:
            if token in ("ROOT", "JOINT"):
                if (token == "ROOT") != (not stack) or (token == "ROOT" and tree.names):
                    raise MocapError(f"{name} has {token} where it cannot stand; one ROOT holds all joints")
                pending = len(tree.names)
                tree.names.append(next(tokens))
                tree.parents.append(stack[-1] if stack else -1)
                tree.offsets.append(np.zeros(3))
                tree.channels.append([])
            elif token == "End":
                next(tokens)
                pending = -1
            elif token == "{":
                stack.append(pending)
                pending = -2
            elif token == "}":
                stack.pop()
            elif token == "OFFSET":
                offset = np.array([float(next(tokens)) for _ in range(3)])
                if stack[-1] >= 0:
                    tree.offsets[stack[-1]] = offset
                else:
                    tree.tips.setdefault(tree.names[stack[-2]], offset)
            elif token == "CHANNELS":
                if stack[-1] < 0:
                    raise ValueError("an End Site has channels")
                tree.channels[stack[-1]] = [_channel(next(tokens), name) for _ in range(int(next(tokens)))]
            else:
                raise MocapError(f"{name} has the unknown word {token!r} in its hierarchy; export it again")
    except StopIteration:
        raise MocapError(f"{name} stops within its hierarchy; the file is truncated") from None
    except (IndexError, ValueError) as error:
        raise MocapError(f"{name} has a broken hierarchy ({error}); export it again") from error
    if stack or not tree.names:
        raise MocapError(f"{name} has {len(stack)} unclosed braces and {len(tree.names)} joints; the file is truncated")
    tree.check()
    return tree


def _channel(word: str, name: str) -> str:
    if (channel := CHANNELS.get(word.lower())) is None:
        raise MocapError(f"{name} has the unknown channel {word!r}; known are {', '.join(CHANNELS)}")
    return channel


def _parse_motion(motion: str, columns: int, name: str) -> tuple[np.ndarray, float]:
    """Return the table of frames (T, columns) as written, and the frame rate."""
    header = motion.split(maxsplit=5)
    try:
        if header[0] != "Frames:" or header[2:4] != ["Frame", "Time:"]:
            raise ValueError("'Frames:' and 'Frame Time:' must follow MOTION")
        frames, step = int(header[1]), float(header[4])
    except (IndexError, ValueError) as error:
        raise MocapError(f"{name} has a broken MOTION header ({error}); the file is truncated or damaged") from error
    if not (np.isfinite(step) and step > 0):
        raise MocapError(f"{name} has frame time {step}; it must be positive seconds")
    body = header[5] if len(header) > 5 else ""
    values = _numbers(body, name)
    if frames < 1 or len(values) == 0:
        raise MocapError(f"{name} has no frames; remove the file or export it again")
    if len(values) != frames * columns:
        raise MocapError(
            f"{name} announces {frames} frames of {columns} columns, but holds {len(values)} numbers and not "
            f"{frames * columns}; the file is truncated or its header is wrong"
        )
    first_line = len(body.split("\n", 1)[0].split())
    if first_line != columns:
        raise MocapError(f"{name} has {first_line} columns in its first frame where its channels need {columns}")
    if not np.isfinite(values).all():
        row = int(np.flatnonzero(~np.isfinite(values))[0]) // columns
        raise MocapError(f"{name} holds a value that is not finite in frame {row}; repair or remove the file")
    return values.reshape(frames, columns), round(1.0 / step, 3)


def _numbers(text: str, name: str) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # NumPy warns about text that is no number
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            raise MocapError(f"{name} holds text among its frames where numbers belong; the file is damaged") from None
