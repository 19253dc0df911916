"""Registry of data sets: source, licence, citation and the SHA-256 of each file."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from urllib.parse import quote

from toolkit.io.errors import UsageError

ASSETS = Path(__file__).parent / "assets"
TEXT_SUFFIXES = frozenset({".bvh", ".amc", ".asf"})
"""Text formats. Git may store them with either line end, so their digests are those of the file with LF line ends."""
GITHUB = "https://raw.githubusercontent.com/{repository}/{commit}/"
"""Address of a file of a GitHub repository at a commit."""


@dataclass(frozen=True)
class DataFile:
    """File of a data set: path inside the data folder, SHA-256, size in bytes, address (None: no public one)."""

    path: str
    sha256: str
    size: int
    url: str | None

    def is_at(self, folder: Path) -> bool:
        """Return True if the data folder holds this file with its content."""
        path = folder / self.path
        return path.is_file() and digest_of(path) == self.sha256


@dataclass(frozen=True)
class DataSet:
    """Data set with its source.

    Attributes
    ----------
    name : name on the command line
    folder : folder inside the data folder
    about : content in one line
    licence : licence of the source, "none stated" if it has none
    citation : text to cite or to acknowledge
    page : address of the publisher
    users : tests, benchmarks and scripts that read it
    repository, commit : GitHub repository and commit of the files; None where the files have no address of their own
    steps : steps that bring the files into the folder by hand; empty where they are fetched
    assets : folder of the lists of files (`NAME.tsv`: SHA-256, bytes, path, path in the source)
    """

    name: str
    folder: str
    about: str
    licence: str
    citation: str
    page: str
    users: tuple[str, ...]
    repository: str | None = None
    commit: str | None = None
    steps: str = ""
    assets: Path = ASSETS

    @property
    def source(self) -> str | None:
        """Address that the files' paths are appended to."""
        if self.repository is None or self.commit is None:
            return None
        return GITHUB.format(repository=self.repository, commit=self.commit)

    @cached_property
    def files(self) -> tuple[DataFile, ...]:
        """Files, sorted by path."""
        found = []
        for line in (self.assets / f"{self.name}.tsv").read_text(encoding="utf-8").splitlines():
            sha256, size, path, *renamed = line.split("\t")
            url = self.source and self.source + quote(renamed[0] if renamed else path)
            found.append(DataFile(f"{self.folder}/{path}", sha256, int(size), url))
        return tuple(found)

    @property
    def megabytes(self) -> float:
        """Size of all files in MB."""
        return sum(file.size for file in self.files) / 1e6

    def missing(self, folder: Path) -> list[DataFile]:
        """Return the files that the data folder does not hold with their content."""
        return [file for file in self.files if not file.is_at(folder)]

    def is_present(self, folder: Path) -> bool:
        """Return True if the data folder has a file of each name; contents are not read."""
        return all((folder / file.path).is_file() for file in self.files)


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal digits; of a text format, with LF line ends."""
    content = path.read_bytes()
    if path.suffix in TEXT_SUFFIXES:
        content = content.replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest()


CMU_NOTICE = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)
CMU_LICENCE = "free for all uses; not to be resold as data"
UTD_CITATION = (
    "C. Chen, R. Jafari, N. Kehtarnavaz: UTD-MHAD: A multimodal dataset for human action recognition utilizing "
    "a depth camera and a wearable inertial sensor. ICIP 2015"
)
UTD_PAGE = "https://www.utdallas.edu/~kehtar/UTD-MHAD.html"
UNPUBLISHED = "The project made this file and has not published it."

_SETS = (
    DataSet(
        "two-people", "depth/realsense", "20 real RealSense depth frames of two men in a room", "MIT",
        "Feiyu Chen: ros_openpose_rgbd, 2019", "https://github.com/felixchenfy/ros_openpose_rgbd",
        ("demo --real",), "felixchenfy/ros_openpose_rgbd", "6d8ddd6d93ae384dc99e5a1d9d8215a9e91c1371",
    ),
    DataSet(
        "realsense", "depth/realsense", "41 real RealSense frames of two people with colour", "MIT",
        "Feiyu Chen: ros_openpose_rgbd, 2019", "https://github.com/felixchenfy/ros_openpose_rgbd",
        ("tests", "bench joints", "bench upper"),
        "felixchenfy/ros_openpose_rgbd", "6d8ddd6d93ae384dc99e5a1d9d8215a9e91c1371",
    ),
    DataSet(
        "cmu-mocap", "mocap/cmu", "50 BVH clips of the CMU motion capture database, 120 Hz", CMU_LICENCE,
        CMU_NOTICE, "http://mocap.cs.cmu.edu",
        ("tests", "database build", "most benchmarks"),
        "una-dinosauria/cmu-mocap", "5d98bb6b62b4735d89ff5f53e96899de2b92d8b4",
    ),
    DataSet(
        "cmu-mocap-more", "mocap_more/cmu", "42 CMU files: playground, uneven ground, Indian dance, salsa", CMU_LICENCE,
        CMU_NOTICE, "http://mocap.cs.cmu.edu",
        ("tests", "scripts/make_default_database.py"),
        steps="Download subjects 01 and 03 as ASF/AMC and keep every fourth frame, numbered from 1; "
        "of the dances (BVH at 30 Hz, joints hip, abdomen, ...) no public address is known.",
    ),
    DataSet(
        "hdm05", "mocap/hdm05", "188 cut clips of HDM05, 11 motion classes, ASF/AMC at 120 Hz", "CC BY-SA 3.0",
        "M. Müller, T. Röder, M. Clausen, B. Eberhardt, B. Krüger, A. Weber: Documentation Mocap Database HDM05. "
        "Technical report CG-2007-2, Universität Bonn, 2007",
        "https://resources.mpi-inf.mpg.de/HDM05/",
        ("tests", "most benchmarks"),
        "zhangchi8620/JointLearning-HDM05", "b252ad65598e052c38f49490c1ac9dbadc283fd3",
    ),
    DataSet(
        "utd-mhad", "depth/utd_mhad", "108 real Kinect v1 recordings with skeletons, 27 actions by 4 subjects",
        "freely available; citation asked; no copies", UTD_CITATION, UTD_PAGE,
        ("tests", "bench real", "bench feet", "bench joints", "bench by_example"),
        steps="Download the depth and skeleton archives and keep subjects 1, 3, 5 and 7, first trial (a*_s*_t1_*.mat).",
    ),
    DataSet(
        "utd-mhad-inertial", "inertial/utd_mhad", "wearable sensor of the recordings of utd-mhad, 50 Hz",
        "freely available; citation asked; no copies", UTD_CITATION, UTD_PAGE,
        ("tests",),
        steps="Download the inertial archive and keep subjects 1, 3, 5 and 7, first trial (a*_s*_t1_inertial.mat).",
    ),
    DataSet(
        "msr-action3d", "depth/msr_action3d", "36 real depth recordings with skeletons, 15 Hz, people 1 to 5",
        "research use; no copies",
        "W. Li, Z. Zhang, Z. Liu: Action recognition based on a bag of 3D points. CVPR Workshops 2010",
        "https://sites.google.com/view/wanqingli/data-sets/msr-action3d",
        ("bench real",),
        steps="Download depth and skeletons and save each take with the names and keys of UTD-MHAD (depth in mm).",
    ),
    DataSet(
        "skeltrack", "depth/skeltrack", "8 real Kinect v1 frames of an upper body, background removed", "LGPL-3.0",
        "J. Rocha: Skeltrack, 2012", "https://github.com/joaquimrocha/Skeltrack",
        ("tests", "bench upper"),
        "joaquimrocha/Skeltrack", "ab954d9ec0f632e53f160655931dc72b50429c98",
    ),
    DataSet(
        "five-people", "depth/pcl", "one real Kinect cloud of five standing people in a room", "BSD-3-Clause",
        "R. B. Rusu, S. Cousins: 3D is here: Point Cloud Library (PCL). ICRA 2011",
        "https://github.com/PointCloudLibrary/pcl",
        ("tests",),
        "PointCloudLibrary/pcl", "1fdb03883eab28f642e938d9bf4d317903212cb4",
    ),
    DataSet(
        "pairs", "depth/pairs", "five real scenes of two RGB-D frames each, one or two people", "GPL-3.0",
        "M. Jaimez, C. Kerl, J. Gonzalez-Jimenez, D. Cremers: Fast odometry and scene flow from RGB-D cameras based on "
        "geometric clustering. ICRA 2017",
        "https://github.com/MarianoJT88/Joint-VO-SF",
        ("tests",),
        "MarianoJT88/Joint-VO-SF", "40f3265565502d00006f8595eafc6aec641a476b",
    ),
    DataSet(
        "rooms", "rooms", "six real sequences of rooms with up to five people; annotations are in the repository",
        "none stated", "IST Lisbon, course PIV: P. Vasco: PIV_Project, 2017",
        "https://github.com/pedrovasco96/PIV_Project/tree/05a648daf566c2a78f4c6ae51d945823503f6087",
        ("bench rooms", "bench ablation"),
        steps="The files there are MATLAB depth arrays and JPEG; save frame N of each sequence as "
        "SEQUENCE/depth/NNNNN.png (16 bit, mm) and SEQUENCE/color/NNNNN.jpg, N from 0.",
    ),
    DataSet(
        "turning", "depth/turning", "100 real Kinect v1 frames of a man who turns by 360 degrees, masks, poses",
        "none stated", "course material; its author is not known to this project",
        "", ("docs/figures.md",), steps="No public address is known.",
    ),
    DataSet(
        "desk", "depth/repro", "simulated person behind a desk, 150 frames", "MIT", "this project", "",
        ("tests",), steps=UNPUBLISHED,
    ),
    DataSet(
        "azure-kinect", "containers", "one Azure Kinect recording (MKV) without people, and its calibration", "MIT",
        "E. Dube: pyk4a, 2019", "https://github.com/etiennedub/pyk4a",
        ("tests",), "etiennedub/pyk4a", "8c153164b484037bd7afc02db0c2be89e7bb8b38",
    ),
    DataSet(
        "realsense-bag", "containers", "one RealSense recording (ROS 1 bag) of two depth frames", "Apache-2.0",
        "Intel: librealsense, recordings of its unit tests", "https://github.com/IntelRealSense/librealsense",
        ("tests",),
        steps="Build librealsense with its unit tests, which download single_depth_color_640x480.bag, and copy it.",
    ),
    DataSet(
        "tof-cloud", "containers", "one time-of-flight cloud (PLY) whose y and z are pixel numbers", "MIT",
        "RogueBaker01: ToF_Camera_Clustering, 2025", "https://github.com/RogueBaker01/ToF_Camera_Clustering",
        (), "RogueBaker01/ToF_Camera_Clustering", "7e54c10f4dc1d00f419ebc76988f44017aec4a42",
    ),
    DataSet(
        "opensim", "opensim", "two OpenSim models, real marker recordings and their joint angles", "none stated",
        "S. Delp et al.: OpenSim: Open-source software to create and analyze dynamic simulations of movement. "
        "IEEE Transactions on Biomedical Engineering 54(11), 2007",
        "https://github.com/opensim-org/opensim-models",
        ("tests",), "opensim-org/opensim-models", "20a888b9655e73fb84963d6e03eee3752cf6074b",
    ),
    DataSet(
        "ansur", "anthropometry", "ANSUR II: 93 body measurements of 6,068 people", "public domain",
        "C. C. Gordon et al.: 2012 Anthropometric survey of U.S. Army personnel. NATICK/TR-15/007, 2014",
        "https://github.com/coleharlow12/ANSURDataAnalysis",
        (), "coleharlow12/ANSURDataAnalysis", "c313806694ede58195024eb34dcafc8cefb26eb2",
    ),
    DataSet(
        "makehuman", "body/makehuman_cc0", "MakeHuman base mesh, rig and skinning weights", "CC0-1.0",
        "MakeHuman community", "https://github.com/makehumancommunity/mpfb2",
        (), "makehumancommunity/mpfb2", "80919fa4682335c41847f761a4d79dcad4124732",
    ),
    DataSet(
        "body-templates", "body/templates", "four small bodies and a shape space made from MakeHuman", "CC0-1.0",
        "this project", "", (), steps=UNPUBLISHED,
    ),
)  # fmt: skip
DATA_SETS = {data_set.name: data_set for data_set in _SETS}
"""Data sets by name."""


def data_set_of(name: str) -> DataSet:
    """Return a data set by its name.

    Raises
    ------
    UsageError
        The registry has no such name.
    """
    if name not in DATA_SETS:
        raise UsageError(f"there is no data set {name!r}; the registry has: {', '.join(DATA_SETS)}")
    return DATA_SETS[name]
