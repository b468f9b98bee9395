"""Maps of map_server: which cells are occupied, where they are, and bad input."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from diagrams.scenario.ros_map import MOST_CELLS, RosMap, read_ros_map
from systems.framework.input_error import InputError
from systems.world.plane import beyond_rectangle

#: The image is 3 cells wide and 2 high; the first row has the larger y.
LEVELS = [[0, 205, 254], [89, 90, 255]]
HEADER = {
    "image": "map.png",
    "resolution": 0.5,
    "origin": [1.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write(folder, levels=LEVELS, picture=None, **header):
    """Writes map.yaml and its image, and returns the path of map.yaml."""
    picture = picture or Image.fromarray(np.array(levels, dtype=np.uint8))
    fields = {k: v for k, v in (HEADER | header).items() if v is not None}
    image = folder / fields.get("image", "map.png")
    if not image.exists():
        picture.save(image)
    file = folder / "map.yaml"
    file.write_text("".join(f"{k}: {v}\n" for k, v in fields.items()), "utf-8")
    return file


def test_the_first_row_of_the_image_has_the_largest_y(tmp_path):
    """(255 - 89) / 255 = 0.651 is above 0.65, and (255 - 90) / 255 = 0.647 is not."""
    found = read_ros_map(write(tmp_path))
    np.testing.assert_array_equal(found.occupied, [[1, 0, 0], [1, 0, 0]])
    assert (found.cell_m, found.origin) == (0.5, (1.0, 2.0, 0.0))
    points = [[1.25, 2.25], [1.25, 2.75], [1.75, 2.25], [0.9, 2.2], [1.2, 3.1]]
    assert found.covers(points).tolist() == [True, True, False, False, False]
    np.testing.assert_allclose(found.shape.rectangles, [[0.25, 0.5, 0, 0.5, 1.0, 0]])


def test_negate_makes_light_cells_occupied(tmp_path):
    found = read_ros_map(write(tmp_path, negate=1))
    np.testing.assert_array_equal(found.occupied, [[0, 0, 1], [0, 1, 1]])


@pytest.mark.parametrize(
    ("mode", "color", "occupied"),
    [
        ("1", 0, True),
        ("P", (10, 10, 10), True),
        ("RGB", (0, 0, 240), True),  # mean 80
        ("RGB", (0, 40, 240), False),  # mean 93.3
        # map_server takes the mean of all four channels in the mode trinary.
        ("RGBA", (0, 0, 0, 255), True),
        ("RGBA", (60, 60, 60, 255), False),
        ("RGBA", (0, 0, 0, 0), True),
        ("RGBA", (255, 255, 255, 0), False),
        ("LA", (0, 255), True),
    ],
)
def test_colors_are_averaged(tmp_path, mode, color, occupied):
    """One pixel of the color beside a white one and a black one."""
    image = Image.new("RGB" if mode == "P" else mode, (3, 1))
    white = {"1": 1, "LA": (255, 255), "RGBA": (255,) * 4}.get(mode, (255,) * 3)
    black = {"1": 0, "LA": (0, 255), "RGBA": (0, 0, 0, 255)}.get(mode, (0,) * 3)
    for x, value in enumerate((color, white, black)):
        image.putpixel((x, 0), value)
    if mode == "P":
        image = image.convert("P")
    found = read_ros_map(write(tmp_path, picture=image))
    assert found.occupied.tolist() == [[occupied, False, True]]


def test_rectangles_cover_the_occupied_cells_once():
    rng = np.random.default_rng(3)
    cells = ndimage.zoom(rng.random((12, 15)) < 0.4, 3, order=0)
    cells[rng.integers(0, 36, 40), rng.integers(0, 45, 40)] ^= True
    rectangles = RosMap(cells, 0.1, (0.0, 0.0, 0.0)).shape.rectangles
    counts = np.zeros(cells.shape, dtype=int)
    for x, y, theta, length, width, radius in rectangles:
        assert theta == radius == 0.0
        low = np.round([(x - length / 2) / 0.1, (y - width / 2) / 0.1]).astype(int)
        high = np.round([(x + length / 2) / 0.1, (y + width / 2) / 0.1]).astype(int)
        counts[low[1] : high[1], low[0] : high[0]] += 1
    np.testing.assert_array_equal(counts, cells)
    assert len(rectangles) < 0.5 * cells.sum()


def test_the_map_turns_about_its_origin():
    """Cells of a turned map are where the rectangles of its shape are."""
    rng = np.random.default_rng(4)
    origin = (3.0, -2.0, 0.7)
    found = RosMap(rng.random((9, 14)) < 0.4, 0.25, origin)
    points = rng.uniform([1.0, -2.0], [6.0, 3.0], (400, 2))
    rows = found.shape.at(origin)
    inside = [
        min(math.hypot(*beyond_rectangle(point, row)) for row in rows) == 0.0
        for point in points
    ]
    assert found.covers(points).tolist() == inside
    assert 20 < sum(inside) < 200


def test_a_changed_image_is_read_again(tmp_path):
    file = write(tmp_path)
    assert read_ros_map(file).occupied.sum() == 2
    assert read_ros_map(file) is read_ros_map(file)
    Image.fromarray(np.zeros((2, 3), dtype=np.uint8)).save(tmp_path / "map.png")
    os.utime(tmp_path / "map.png", (1.0, 1.0))
    assert read_ros_map(file).occupied.sum() == 6


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"image": None}, r"is no map of map_server; it needs image, resolution"),
        ({"image": "none.pgm", "levels": []}, r"none.pgm' is not a file; give .* PGM"),
        ({"resolution": 0}, r"has resolution: 0.0; give the side of a cell"),
        ({"resolution": -0.05}, r"has resolution: -0.05; give the side"),
        ({"resolution": ".nan"}, r"has resolution: nan; give a number"),
        ({"resolution": None}, r"has no resolution; give a number"),
        ({"occupied_thresh": 0.1}, r"free_thresh 0.196 and occupied_thresh 0.1; give"),
        ({"free_thresh": 0.65}, r"free_thresh 0.65 and occupied_thresh 0.65; give 0"),
        ({"occupied_thresh": 65}, r"occupied_thresh 65; give .* <= 1, for example"),
        ({"mode": "scale"}, r"has mode: 'scale'; only mode: trinary is read"),
        ({"mode": "raw"}, r"has mode: 'raw'; only mode: trinary is read"),
        ({"negate": 2}, r"has negate: 2; give 0 or 1"),
        ({"origin": [1.0]}, r"has origin: \[1.0\]; give \[x, y, theta\]"),
        ({"origin": ["a", 0, 0]}, r"give \[x, y, theta\] in m and rad"),
        ({"levels": [[254, 255]]}, r"without occupied cells; check negate"),
        ({"image": "map.yaml"}, r"cannot read the image .*; give a PGM or PNG"),
        ({"image": "map.tif", "mode16": True}, r"give 8 bits per channel: convert"),
    ],
)
def test_bad_input_has_one_line_with_the_remedy(tmp_path, header, message):
    header = dict(header)
    image = Image.new("I;16", (4, 4)) if header.pop("mode16", False) else None
    if header.get("levels") == []:  # no image
        del header["levels"]
        file = write(tmp_path, **(header | {"image": "map.png"}))
        file.write_text(file.read_text("utf-8").replace("map.png", "none.pgm"), "utf-8")
    else:
        if header.get("image") == "map.yaml":
            (tmp_path / "map.yaml").write_text("", "utf-8")
        file = write(tmp_path, picture=image, **header)
    with pytest.raises(InputError, match=message) as error:
        read_ros_map(file)
    assert error.value.field.startswith("map.file")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("size", [(5001, 5000), (20_000, 20_000)])
def test_an_image_with_too_many_cells_is_refused_by_its_header(tmp_path, size):
    wide, high = size
    (tmp_path / "map.png").write_bytes(b"P5\n%d %d\n255\n" % (wide, high))
    with pytest.raises(InputError, match=rf"more than {MOST_CELLS}.*cut the map"):
        read_ros_map(write(tmp_path))


def test_speckles_are_refused(tmp_path):
    cells = np.full((700, 700), 255)
    cells[::2, ::2] = 0
    with pytest.raises(InputError, match=r"make 122500 rectangles, more than 100000"):
        read_ros_map(write(tmp_path, cells))
