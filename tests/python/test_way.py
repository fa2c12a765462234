"""The whole way: scenes, points, light fields, frames, what is seen of them; and through files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT

RAYS = (60, 60)


@pytest.fixture(scope="module")
def points(room: hd.Scene, wide: hd.Panel) -> hd.Points:
    return room.points(wide, rays=RAYS)


@pytest.fixture(scope="module")
def light(points: hd.Points, wide: hd.Panel) -> hd.LightField:
    return hd.light_field(points, wide)


def test_a_scene_becomes_points_behind_the_panel(room: hd.Scene, points: hd.Points) -> None:
    assert room.triangles > 20 and room.bounds is not None
    # What the rays pass beside the room's open front is no point.
    assert 2500 < len(points) <= 3600
    near, far = points.depth or (0, 0)
    assert near == pytest.approx(-0.1, abs=2e-3) and far == pytest.approx(-0.15, abs=2e-3)
    assert points.picture is not None and points.picture.shape == (60, 60, 3) and points.picture.max() > 0
    assert set(points.focus) == {"near", "far", "mirror"}
    assert points.positions.shape == (len(points), 3) and points.positions.dtype == np.float64
    assert points.amplitudes.dtype == np.float32 and (points.amplitudes >= 0).all()
    assert np.ptp(points.phases) > 6 and points.rgb is not None and points.rgb.shape == (len(points), 3)


def test_depths_are_where_they_are_asked_for(room: hd.Scene, wide: hd.Panel) -> None:
    moved = room.points(wide, rays=(30, 30), near="50mm", far="-20mm", phase="zero")
    near, far = moved.depth or (0, 0)
    assert near == pytest.approx(0.05, abs=3e-3) and far == pytest.approx(-0.02, abs=3e-3)
    assert not moved.phases.any()


def test_a_number_of_points_and_seeds_are_kept(room: hd.Scene, wide: hd.Panel) -> None:
    few = room.points(wide, points=1000)
    assert abs(len(few) - 1000) < 50
    a, b, c = (room.points(wide, rays=(20, 20), seed=seed).phases for seed in (5, 5, 6))
    assert np.array_equal(a, b) and not np.array_equal(a, c)


def test_a_model_keeps_its_proportions(room: hd.Scene, wide: hd.Panel) -> None:
    small, large = (room.points(wide, rays=(40, 40), placement="model", scale=scale) for scale in (0.001, 0.002))
    assert room.bounds is not None
    across = np.ptp(large.positions[:, :2], axis=0)
    assert (across <= 0.002 * np.ptp(np.array(room.bounds), axis=0)[:2] * 1.05).all() and across.max() > 0.5e-3
    deep = [np.ptp(model.positions[:, 2]) for model in (small, large)]
    assert deep[1] == pytest.approx(2 * deep[0], rel=0.1)


def test_points_go_through_a_ply_and_come_back(points: hd.Points, tmp_path: Path) -> None:
    points.write(tmp_path / "points.ply")
    back = hd.Points.read(tmp_path / "points.ply")
    assert np.array_equal(back.positions, points.positions) and np.array_equal(back.phases, points.phases)
    assert back.rgb is not None and np.array_equal(back.rgb, points.rgb)


def test_points_of_arrays_go_through_a_ply(tmp_path: Path) -> None:
    made = hd.Points([[1e-3, 2e-3, -0.1], [0, 0, 0.2]], amplitudes=[0.5, 2], phases=[1, 2])
    made.write(tmp_path / "made.ply")
    back = hd.Points.read(tmp_path / "made.ply")
    assert np.array_equal(back.positions, made.positions) and back.rgb is None
    assert np.array_equal(back.amplitudes, [0.5, 2]) and np.array_equal(back.phases, [1, 2])
    assert back.depth == (0.2, -0.1)


@pytest.mark.parametrize("ending", ["npy", "mat", "h5"])
def test_fields_go_through_files(panel: hd.Panel, tmp_path: Path, ending: str) -> None:
    field = hd.hologram(hd.Points([[0, 0, -0.1]]), panel)
    path = tmp_path / f"field.{ending}"
    field.save(path)
    back = hd.Field.load(path)
    assert np.array_equal(back, field) and back.pitch == pytest.approx(field.pitch)
    assert back.wavelength == field.wavelength and back.depth == (-0.1, -0.1)
    if ending == "npy":
        assert np.array_equal(np.load(path), field)


def test_frames_go_through_files_with_all_that_is_known(panel: hd.Panel, tmp_path: Path) -> None:
    frame = hd.encode(hd.hologram(hd.Points([[0, 0, -0.1]]), panel), panel)
    frame.save(tmp_path / "frame.png")
    back = hd.Frame.load(tmp_path / "frame.png")
    assert np.array_equal(back.levels, frame.levels)
    assert all(back.metadata[key] == frame.metadata[key] for key in ("panel", "wavelength", "applied", "origin"))
    assert back.metadata["encoding"]["scale"] == pytest.approx(frame.metadata["encoding"]["scale"], rel=1e-12)
    assert back.metadata["encoding"]["method"] == "double-phase" and back.depth == (-0.1, -0.1)
    assert back.report is None and frame.report is not None and 0 < frame.report["efficiency"] <= 1
    a, b = hd.reconstruct(frame, "-0.1m"), hd.reconstruct(back, "-0.1m")
    assert np.allclose(a, b, rtol=1e-5)


def test_more_than_eight_bits_are_uint16_without_a_copy() -> None:
    panel = hd.Panel("santec-slm-200", wavelength="532nm")
    assert panel.bits == 10 and panel.levels == 1024
    levels = np.arange(panel.shape[0] * panel.shape[1]).reshape(panel.shape) % 1024
    frame = hd.Frame(levels, panel)
    assert frame.levels.dtype == np.uint16 and np.array_equal(frame.levels, levels)
    assert np.shares_memory(frame.levels, frame.levels) and not frame.levels.flags.writeable


def test_every_panel_that_is_known_can_be_made() -> None:
    names = hd.panels()
    assert len(names) >= 15
    for name in names:
        panel = hd.Panel(name)
        assert panel.name == name and len(panel.curve) == panel.levels and panel.shape[0] > 100
        assert name in repr(panel) and panel.x.shape == (panel.shape[1],) and panel.y[0] > panel.y[-1]


def test_a_panel_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text((ROOT / "calib" / "generic.toml").read_text().replace("width = 1920", "width = 320"))
    panel = hd.Panel(tmp_path / "mine.toml", wavelength="520nm")
    assert panel.shape == (1080, 320) and panel.wavelength == pytest.approx(520e-9)


def test_a_light_field_is_what_the_scene_looks_like(light: hd.LightField, points: hd.Points) -> None:
    rows, columns, height, width = light.shape
    assert rows == columns == 9 and light.channels == 1 and light.eye == (0, 0, 0.6)
    middle = light.view()
    assert middle.shape == (height, width) and middle.dtype == np.float32 and 0.2 < middle.max() <= light.peak * 1.001
    codes = light.codes()
    assert codes.shape == light.shape and not codes.flags.writeable
    assert np.allclose(light.peak * (codes[4, 4] / 65535.0) ** 2, middle, atol=1e-6)
    # The floor of the room is brighter than what lies beside its window.
    assert points.picture is not None and middle.mean() > 0.01


def test_light_fields_go_through_files(light: hd.LightField, tmp_path: Path) -> None:
    light.save(tmp_path / "views.npz")
    back = hd.LightField.load(tmp_path / "views.npz")
    assert back.shape == light.shape and back.depth == pytest.approx(light.depth)
    # The file says radiance as 16-bit floats.
    assert all(np.allclose(back.view(i, i), light.view(i, i), rtol=1e-3, atol=1e-4) for i in range(9))


def test_a_frame_for_an_eye_shows_it_the_scene(light: hd.LightField, wide: hd.Panel, points: hd.Points) -> None:
    frame = hd.encode(light, wide, encoding="view", iterations=40)
    figures = hd.judge(frame, light)
    assert figures["psnr"] > 25 and figures["ssim"] > 0.7, figures
    plain = hd.encode(hd.hologram(points, wide), wide, encoding="kinoform")
    assert hd.judge(plain, light)["psnr"] < figures["psnr"] - 10
    assert frame.metadata["encoding"]["method"] == "view" and frame.depth == pytest.approx(light.depth)


def test_sub_frames_for_an_eye_box_are_a_list(wide: hd.Panel, room: hd.Scene) -> None:
    points = room.points(wide, rays=(40, 40))
    box = dict(eye_box=("6mm", "0mm"), pupil="4mm")
    light = hd.light_field(points, wide, **box)  # type: ignore[arg-type]
    frames = hd.encode(light, wide, subframes=2, iterations=15, eye_box=("6mm", "0mm"))
    assert isinstance(frames, list) and len(frames) == 2
    assert not np.array_equal(frames[0].levels, frames[1].levels)
    together = hd.judge(frames, light, eye_box=("6mm", "0mm"), looks=6)
    alone = hd.judge(frames[:1], light, eye_box=("6mm", "0mm"), looks=6)
    assert together["psnr"] > alone["psnr"]


def test_views_of_ones_own_are_a_light_field(wide: hd.Panel) -> None:
    # A wall at the panel's depth: every eye sees the same.
    wall = np.zeros((40, 60), np.float32)
    wall[10:30, 15:45] = 0.8
    light = hd.LightField(
        np.broadcast_to(wall, (10, 10, 40, 60)),
        eye=(0, 0, 0.6),
        spacing="0.5mm",
        window=("3.84mm", "2.16mm"),
        depth=(-0.01, -0.01),
    )
    assert np.allclose(light.view(0, 9), wall, atol=1e-4)
    frame = hd.encode(light, wide, iterations=30)
    seen = np.asarray(hd.reconstruct(frame, -0.01, eye=(0, 0, 0.6), pupil="4mm", size=(60, 40)))
    assert seen[12:28, 18:42].mean() > 20 * seen[:6].mean()


def test_views_in_colour_have_three_channels(wide: hd.Panel) -> None:
    views = np.zeros((9, 9, 20, 30, 3), np.float32)
    views[..., 1] = 0.5
    light = hd.LightField(views, eye=(0, 0, 0.6), spacing="0.5mm", window=("3mm", "2mm"), depth=(-0.01, -0.02))
    assert light.channels == 3 and "in colour" in repr(light)
    assert not light.view(channel=0).any() and np.allclose(light.view(channel=1), 0.5, atol=1e-4)
    with pytest.raises(hd.ParameterError, match="3: there are 3"):
        light.codes(3)
    with pytest.raises(hd.ParameterError, match="row 9"):
        light.view(9, 0)


def test_views_on_the_panels_lattice_are_taken_as_they_are(light: hd.LightField, wide: hd.Panel) -> None:
    assert np.array_equal(hd.light_field(light, wide).codes(), light.codes())
    with pytest.raises(hd.OutOfRangeError, match="is not where the views stand"):
        hd.light_field(light, wide, eye=(0, 0, 0.5))


def test_a_light_field_of_points_shows_them_where_they_stand(wide: hd.Panel) -> None:
    # Seen from the eye, a point 0.1 m behind the panel stands at 6/7 of its place on the panel.
    light = hd.light_field(hd.Points([[7e-4, -3.5e-4, -0.1]]), wide)
    row, column = np.unravel_index(int(light.view().argmax()), light.shape[2:])
    width, height = light.window
    x, y = ((column + 0.5) / light.shape[3] - 0.5) * width, (0.5 - (row + 0.5) / light.shape[2]) * height
    assert abs(x - 6e-4) < 1e-4 and abs(y + 3e-4) < 1e-4


def test_a_scene_and_points_are_encoded_for_an_eye_at_once(
    room: hd.Scene, points: hd.Points, light: hd.LightField, wide: hd.Panel
) -> None:
    by_points = hd.encode(points, wide, iterations=3)
    assert np.array_equal(by_points.levels, hd.encode(light, wide, iterations=3).levels)
    assert hd.encode(room, wide, iterations=1).metadata["encoding"]["method"] == "view"


def test_all_of_the_light_is_a_pupil(points: hd.Points, wide: hd.Panel) -> None:
    light = hd.light_field(points, wide, pupil="all")
    frame = hd.encode(light, wide, pupil="all", iterations=3)
    figures = hd.judge(frame, light, pupil="all", looks=2)
    assert figures["efficiency"] > 0.9


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(views=np.zeros((3, 4, 5))), r"\(3, 4, 5\) is not"),
        (dict(views=-np.ones((9, 9, 4, 6))), "not negative"),
        (dict(eye=(0, 0, -1)), "distance of the views"),
        (dict(window=(0, 0)), "pitch"),
    ],
)
def test_views_that_are_none_are_refused(arguments: Any, words: str) -> None:
    usual = dict(views=np.ones((9, 9, 4, 6)), eye=(0, 0, 0.6), spacing="0.5mm", window=("4mm", "3mm"), depth=(-0.1, -0.1))
    with pytest.raises(hd.ParameterError, match=words):
        hd.LightField(**{**usual, **arguments})


def test_pictures_are_seen_and_written(panel: hd.Panel, tmp_path: Path) -> None:
    field = hd.hologram(hd.Points([[0, 0, -0.05]]), panel)
    picture = hd.reconstruct(field, "-50mm")
    assert picture.focus == -0.05 and not picture.values.flags.writeable
    picture.save(tmp_path / "picture.npy")
    assert np.array_equal(np.load(tmp_path / "picture.npy"), picture)
    picture.save(tmp_path / "picture.png")
    for png in (picture._repr_png_(), hd.encode(field, panel)._repr_png_(), (tmp_path / "picture.png").read_bytes()):
        assert png.startswith(b"\x89PNG\r\n\x1a\n") and png.endswith(b"IEND\xaeB`\x82")
    codes = picture.coded()
    assert codes.dtype == np.uint8 and codes.max() == 255
    assert picture.coded(white=10 * float(picture.values.max())).max() < 100


def test_pngs_of_notebooks_hold_the_levels(panel: hd.Panel, tmp_path: Path) -> None:
    levels = np.random.default_rng(4).integers(0, 256, (48, 64))
    (tmp_path / "levels.png").write_bytes(hd.Frame(levels, panel)._repr_png_())
    assert np.array_equal(hd.Frame.load(tmp_path / "levels.png", panel).levels, levels)


def test_faults_of_the_bench_cost_light(panel: hd.Panel) -> None:
    frame = hd.encode(hd.hologram(hd.Points([[0, 0, -0.05]]), panel), panel)
    clean = np.asarray(hd.reconstruct(frame, -0.05)).max()
    blurred = np.asarray(hd.reconstruct(frame, -0.05, crosstalk=0.7)).max()
    assert blurred < 0.9 * clean


def test_a_plate_is_planned(tmp_path: Path) -> None:
    plan = hd.print_plate(
        ROOT / "scenes" / "cornell.gltf", ROOT / "calib" / "plate-small.toml", tmp_path / "plate", dry_run=True
    )
    assert plan["size"][0] > 100 and plan["seconds"] > 0 and not (tmp_path / "plate").exists()


def test_a_plate_is_gone_on_with(tmp_path: Path) -> None:
    source, plate, folder = ROOT / "scenes" / "cornell.gltf", ROOT / "calib" / "plate-small.toml", tmp_path / "plate"
    part = hd.print_plate(source, plate, folder, shard="0/2")
    assert not part["complete"] and part["done"]["computed"] == 6
    told: "list[str]" = []
    whole = hd.print_plate(source, plate, folder, progress=lambda step, done, total: told.append(step))
    assert whole["complete"] and whole["done"]["kept"] == 6 and whole["done"]["computed"] == 6 and told
    with pytest.raises(hd.ParameterError, match="is not i/n"):
        hd.print_plate(source, plate, folder, shard="half")


def test_what_is_shown_says_the_essentials(room: hd.Scene, panel: hd.Panel, points: hd.Points, light: hd.LightField) -> None:
    field = hd.hologram(hd.Points([[0, 0, -0.1]]), panel)
    for thing, words in [
        (room, ["cornell.gltf", "triangles"]),
        (panel, ["64 × 48", "8um", "532nm", "256 levels"]),
        (points, [str(len(points)), "in colour", "mm"]),
        (field, ["64 × 48", "8um", "532nm"]),
        (light, ["9 × 9 views", "600mm"]),
        (hd.encode(field, panel), ["64 × 48", "levels"]),
        (hd.reconstruct(field, "-0.1m"), ["64 × 48", "-100mm"]),
    ]:
        assert repr(thing).startswith("<holodrive.") and all(word in repr(thing) for word in words), repr(thing)
