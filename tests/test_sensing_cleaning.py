"""Cleaning and segmentation: segmented person, and the values of pixels."""

import numpy as np
import pytest

from tests.sensing_scenes import KINECT, TOF, person_alone, scene
from toolkit.io.errors import SegmentationError
from toolkit.people.single_person import SinglePersonSegmenter
from toolkit.people.survey import find_person
from toolkit.recordings.opening import open_recording
from toolkit.sensing.camera import Camera
from toolkit.sensing.sensing_settings import SensingSettings


def overlap(mask, truth):
    """Return intersection over union of two masks."""
    return (mask & truth).sum() / max((mask | truth).sum(), 1)


def clean(depth, camera=KINECT, background=None, **options):
    return SinglePersonSegmenter(camera, background, SensingSettings(**options)).clean(depth)


def test_a_segmented_person_stays_whole_and_in_metres():
    depth = person_alone(KINECT)
    cleaned = clean(depth)
    assert cleaned.dtype == np.float32
    assert overlap(cleaned > 0, depth > 0) > 0.97
    both = (cleaned > 0) & (depth > 0)
    assert np.median(np.abs(cleaned[both] - depth[both] / 1000)) < 0.002


@pytest.mark.parametrize("noise", [0.0, 15.0])
def test_background_subtraction_cuts_the_person_out(noise):
    rng = np.random.default_rng(0)
    background, _ = scene(KINECT, (), tilt=0.2, height=1.6, wall=4.0, floor=True)
    frame, who = scene(KINECT, ((0.2, 2.8),), tilt=0.2, height=1.6, wall=4.0, floor=True)
    noisy = (frame + np.rint(rng.normal(scale=noise, size=frame.shape))).astype(np.uint16)
    assert overlap(clean(noisy, background=background) > 0, who == 1) > 0.9


def test_the_background_can_be_learnt_from_empty_frames():
    rng = np.random.default_rng(0)
    empty, _ = scene(TOF, (), height=1.2, wall=4.0, floor=True)
    frame, who = scene(TOF, ((0.2, 2.8),), height=1.2, wall=4.0, floor=True)
    cleaner = SinglePersonSegmenter(TOF, None, SensingSettings(segment="empty-frames:5"))
    for _ in range(5):
        holes = rng.random(TOF.shape) < 0.2
        assert not cleaner.clean(np.where(holes, 0, empty).astype(np.uint16)).any()
    assert overlap(cleaner.clean(frame) > 0, who == 1) > 0.9


def test_a_range_cuts_the_person_out():
    frame, who = scene(KINECT, ((0.0, 2.5),), wall=4.0)
    assert overlap(clean(frame, segment="range:1.5,3.2") > 0, who == 1) > 0.95


def test_a_room_without_background_is_an_error_that_names_the_option():
    frame, _ = scene(KINECT, wall=4.0, floor=True)
    with pytest.raises(SegmentationError, match="give --segment person"):
        clean(frame)


def test_a_room_with_many_holes_is_not_taken_for_a_person():
    frame, _ = scene(KINECT, wall=4.0, floor=True)
    frame[:, :80] = 0
    with pytest.raises(SegmentationError, match="larger than a person; give --segment"):
        clean(frame)


def test_two_segmented_people_are_an_error_unless_one_is_meant():
    frame, who = scene(KINECT, ((-0.5, 2.4), (0.5, 3.4)))
    with pytest.raises(SegmentationError, match="2 people are in view; give --people all"):
        clean(frame)
    assert overlap(clean(frame, subject="nearest") > 0, who == 1) > 0.95
    frame[:, :95] = 0  # the nearer one cut in half
    assert overlap(clean(frame, subject="largest") > 0, who == 2) > 0.95


def test_who_was_there_first_is_followed_when_a_second_person_comes():
    cleaner = SinglePersonSegmenter(KINECT)
    cleaner.clean(scene(KINECT, ((0.4, 3.2),))[0])
    frame, who = scene(KINECT, ((0.4, 3.2), (-0.6, 2.2)))
    assert overlap(cleaner.clean(frame) > 0, who == 1) > 0.9


def test_limbs_in_front_of_the_body_belong_to_it():
    depth = person_alone(KINECT, distance=3.0)
    depth[115:135, 130:190] = 2550  # both forearms, 0.4 m before the chest, cut the body in two
    cleaned = clean(depth)
    assert (cleaned[115:135, 130:190] > 0).mean() > 0.95
    assert overlap(cleaned > 0, depth > 0) > 0.95


def test_a_limb_that_points_at_the_camera_is_not_taken_for_mixed_pixels():
    depth = person_alone(KINECT)
    for i in range(8):  # 8 cm a pixel, 5 pixels wide
        depth[100 + i, 157:162] = 2850 - 80 * i
    cleaned = clean(depth)
    assert (cleaned[100:107, 157:162] > 0).all(), "only the tip's last row has nothing to lean on"
    assert (cleaned[100:108, 157:162] > 0).mean() > 0.8


def test_mixed_pixels_go_and_thin_limbs_stay():
    depth = np.zeros(TOF.shape, np.uint16)
    depth[40:120, 60:110] = 3000
    depth[20:40, 84:87] = 3000  # three pixels wide, as a forearm at 176x144
    mixed = depth.copy()
    rng = np.random.default_rng(0)
    mixed[40:120, 110] = rng.integers(3150, 3900, 80)
    kept = clean(mixed, TOF) > 0
    assert kept[42:118, 110].mean() < 0.05
    assert kept[20:40, 84:87].all()
    assert kept[41:119, 61:109].all()


def test_deleting_the_contour_is_an_option():
    depth = np.zeros(TOF.shape, np.uint16)
    depth[40:120, 60:110] = 3000
    for contour, pixels in (("silhouette", 78 * 48), ("mixed", 80 * 50), ("keep", 80 * 50)):
        assert (clean(depth, TOF, contour=contour) > 0).sum() == pixels


def test_half_resolution_keeps_every_second_pixel_and_adapts_the_camera():
    cleaner = SinglePersonSegmenter(KINECT, None, SensingSettings(half_resolution=True))
    half, full = cleaner.clean(person_alone(KINECT)), clean(person_alone(KINECT))
    np.testing.assert_array_equal(half, full[::2, ::2])
    assert half.shape == cleaner.camera.shape
    np.testing.assert_allclose(cleaner.camera.rays(), KINECT.rays()[::2, ::2])


def test_lens_distortion_is_removed():
    import cv2

    bent = Camera(*KINECT.intrinsics, 320, 240, (0.3, -0.1, 0.002, 0.002, 0.0))
    straight = person_alone(KINECT, 0.7, 3.2)
    rays = bent.rays()  # an undistorted ray per pixel: look the straight image up there
    u, v = rays[..., 0] * KINECT.fx + KINECT.cx, rays[..., 1] * KINECT.fy + KINECT.cy
    seen = cv2.remap(straight, u.astype(np.float32), v.astype(np.float32), cv2.INTER_NEAREST)
    assert overlap(seen > 0, straight > 0) < 0.97, "the lens bends the picture"
    cleaner = SinglePersonSegmenter(bent)
    assert cleaner.camera == KINECT
    cleaned = cleaner.clean(seen)
    assert overlap(cleaned > 0, straight > 0) > 0.92, "a pixel of rounding each way along a thin outline"
    v, u = np.nonzero(cleaned)
    np.testing.assert_allclose((u.mean(), v.mean()), np.argwhere(straight)[:, ::-1].mean(axis=0), atol=0.5)


@pytest.mark.parametrize("options", [{}, {"segment": "range:1,5"}, {"half_resolution": True}])
def test_an_empty_frame_is_empty_and_the_next_one_is_not(options):
    cleaner = SinglePersonSegmenter(KINECT, None, SensingSettings(**options))
    assert not cleaner.clean(np.zeros(KINECT.shape, np.uint16)).any()
    assert cleaner.clean(person_alone(KINECT)).any()
    assert not cleaner.clean(np.zeros(KINECT.shape, np.uint16)).any()
    assert cleaner.clean(person_alone(KINECT, 0.1)).any()


@pytest.mark.parametrize("x", [-1.45, 1.45])
@pytest.mark.parametrize("options", [{}, {"half_resolution": True}])
def test_a_person_cut_off_by_the_border_is_kept_up_to_it(x, options):
    depth = person_alone(KINECT, x, 2.6)
    cleaned = clean(depth, **options)
    edge = cleaned[:, 0] if x < 0 else cleaned[:, -1]
    assert depth[:, 0 if x < 0 else -1].any()
    if options.get("half_resolution") and x > 0:
        assert cleaned.any()
    else:
        assert edge.any()


@pytest.mark.data("utd-mhad")
def test_real_segmented_recordings_keep_their_pixels(data_folder):
    for name in ("a27_s7_t1", "a21_s1_t1"):
        recording = open_recording(data_folder / "depth" / "utd_mhad" / f"{name}_depth.mat")
        cleaner = SinglePersonSegmenter.of(recording)
        for frame in recording.frames():
            assert (cleaner.clean(frame) > 0).sum() > 0.95 * (frame > 0).sum()


@pytest.mark.data("skeltrack")
def test_the_second_person_of_a_real_recording_is_left_out(data_folder):
    recording = open_recording(data_folder / "depth" / "skeltrack", intrinsics=(575, 575, 320, 240))
    frame = recording.depth(7)
    with pytest.raises(SegmentationError, match="2 people"):
        SinglePersonSegmenter.of(recording).clean(frame)
    cleaned = SinglePersonSegmenter.of(recording, SensingSettings(subject="nearest")).clean(frame)
    assert cleaned.max() < 1.6 < frame.max() / 1000


@pytest.mark.data("five-people")
def test_one_of_five_real_people_is_cut_out(data_folder):
    recording = open_recording(data_folder / "depth" / "pcl" / "five_people.pcd")
    frame = recording.depth(0)
    with pytest.raises(SegmentationError, match="give --segment"):
        SinglePersonSegmenter.of(recording).clean(frame)
    with pytest.raises(SegmentationError, match="give --people all"):
        find_person(recording, SensingSettings(segment="person"))
    finder = find_person(recording, SensingSettings(segment="person", subject="nearest"))
    cleaned = finder.find(frame, 0.0, {})[0].depth
    v, u = np.nonzero(cleaned)
    assert u.min() > 440 and v.max() - v.min() > 380, "the one on the right, from head to feet"
    area = (cleaned**2).sum() / (recording.camera.fx * recording.camera.fy)
    assert 0.35 < area < 0.8


@pytest.mark.data("realsense")
def test_a_real_person_in_a_cluttered_room_is_followed(data_folder):
    recording = open_recording(data_folder / "depth" / "realsense" / "images_n40")
    finder = find_person(recording, SensingSettings(segment="seed:450,200"))
    for i, frame in enumerate(recording.frames()):
        v, u = np.nonzero(finder.find(frame, float(recording.timestamps[i]), {})[0].depth)
        assert abs(np.median(u) - 440) < 60, "the one who stands on the right"
        assert np.ptp(v) > 280
