from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from gramoscope.camera.contents import Contents
from gramoscope.camera.frames_video import VideoFrames, VideoWriter
from gramoscope.camera.sensor import Sensor

av = pytest.importorskip("av")

GROUPS, FRAMES = 30, 3
SENSOR = Sensor(width_px=64, height_px=34)


@pytest.fixture(scope="module")
def film():
    """Pictures that a lossy codec cannot confuse: the number of the frame is written in broad bars."""
    numbers = np.arange(GROUPS * FRAMES)
    bars = (numbers[:, np.newaxis] >> np.arange(8)) & 1
    rows = np.repeat(40 + 170 * bars.astype(np.uint8), 8, axis=1)
    return np.ascontiguousarray(np.broadcast_to(rows[:, np.newaxis, :], (len(numbers), 34, 64)))


@pytest.fixture(scope="module")
def lossless(film, tmp_path_factory):
    path = tmp_path_factory.mktemp("video") / "film.mkv"
    writer = VideoWriter(path, sensor=SENSOR)
    writer.write(film)
    writer.close()
    return path


@pytest.fixture(scope="module")
def lossy(film, tmp_path_factory):
    """Pictures that lean on others before and after, with a key frame now and then."""
    path = tmp_path_factory.mktemp("video") / "film.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 34, "yuv420p"
        stream.options = {"g": "11", "bf": "2", "b": "4000000"}
        for image in film:
            colour = np.repeat(image[..., np.newaxis], 3, axis=-1)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(colour, format="rgb24")))
        container.mux(stream.encode())
    return path


def number_of(frame):
    grey = frame if frame.ndim == 2 else frame.mean(axis=-1)
    bars = grey.reshape(34, 8, 8).mean(axis=(0, 2)) > 125
    return int(bars @ (1 << np.arange(8)))


def numbers_of_group(source, group):
    return [number_of(frame) for frame in source.read_group(group, Contents())]


def expected(group):
    return list(range(group * FRAMES, (group + 1) * FRAMES))


@pytest.mark.parametrize("name", ["lossless", "lossy"])
@pytest.mark.parametrize(
    "order", [range(GROUPS), [0, 2, 1, 3, 5, 4], [29, 0, 17, 16, 18, 3, 28, 28, 29]], ids=["1", "2", "3"]
)
def test_every_order_of_reading_gives_the_right_frames(name, order, request):
    source = VideoFrames(request.getfixturevalue(name), frames_per_group=FRAMES)
    for group in order:
        assert numbers_of_group(source, group) == expected(group)


@pytest.mark.parametrize("name", ["lossless", "lossy"])
def test_several_threads_may_read_at_once(name, request):
    source = VideoFrames(request.getfixturevalue(name), frames_per_group=FRAMES)
    with ThreadPoolExecutor(4) as pool:
        read = list(pool.map(lambda group: numbers_of_group(source, group), range(GROUPS)))
    assert read == [expected(group) for group in range(GROUPS)]


def test_reading_in_nearly_the_right_order_decodes_nothing_twice(lossless, monkeypatch):
    source = VideoFrames(lossless, frames_per_group=FRAMES)
    monkeypatch.setattr(source._tape, "wind_to", lambda index: pytest.fail(f"wound to frame {index}"))
    for group in [0, 3, 1, 2, 4, 7, 5, 6]:
        assert numbers_of_group(source, group) == expected(group)


def test_few_passed_frames_are_kept(lossless):
    source = VideoFrames(lossless, frames_per_group=FRAMES)
    for group in range(0, GROUPS, 3):
        assert numbers_of_group(source, group) == expected(group)
        assert len(source._kept) <= 4 * FRAMES


def test_after_the_end_there_is_nothing(lossless):
    source = VideoFrames(lossless, frames_per_group=FRAMES)
    assert numbers_of_group(source, GROUPS) == []
    assert numbers_of_group(source, GROUPS + 40) == []
    assert numbers_of_group(source, 4) == expected(4)


def test_the_end_is_looked_for_once(lossless, monkeypatch):
    source = VideoFrames(lossless, frames_per_group=FRAMES)
    wound = []
    wind_to = source._tape.wind_to
    monkeypatch.setattr(source._tape, "wind_to", lambda index: wound.append(index) or wind_to(index))
    assert [numbers_of_group(source, group) for group in range(GROUPS, GROUPS + 50)] == [[]] * 50
    assert len(wound) <= 1


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_ffv1_loses_nothing(tmp_path, bits):
    sensor = Sensor(width_px=51, height_px=34, bits=bits, colour="rgb")
    frames = np.random.default_rng(8).integers(0, 2**bits, (4, 34, 51, 3)).astype(np.uint16)
    writer = VideoWriter(tmp_path / "film.mkv", sensor=sensor)
    writer.write(frames)
    writer.close()
    read = list(VideoFrames(tmp_path / "film.mkv", frames_per_group=4).read_group(0, Contents()))
    np.testing.assert_array_equal(np.stack(read), frames)
