"""Three lasers, and scenes that come as bytes."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import holodrive as hd
import numpy as np
import pytest
from conftest import ROOT, distance, sphere

LASERS = ("450nm", "638nm", "520nm")


def test_three_lasers_make_three_fields_each_of_its_wavelength(panel: hd.Panel) -> None:
    place = (2e-5, 1e-5, -0.1)
    white = hd.Points([place], rgb=[[1, 1, 1]])
    fields = hd.hologram(white, panel, wavelengths=LASERS)
    assert [round(1e9 * field.wavelength) for field in fields if field] == [638, 520, 450]
    for field in fields:
        assert field is not None and field.report is not None
        wave = sphere(panel, place, field.wavelength)
        samples = np.asarray(field)
        # Up to the amplitude, which is the laser's power.
        assert distance(samples * (np.vdot(samples, wave) / np.vdot(samples, samples)), wave) < 2e-3
    frames = hd.encode(fields, panel, encoding="kinoform")
    for frame, field in zip(frames, fields):
        assert frame is not None and field is not None and frame.wavelength == field.wavelength
        alone = hd.encode(field, panel.at(field.wavelength), encoding="kinoform")
        assert np.array_equal(frame.levels, alone.levels)
    # Red alone: of three lasers that cannot make it purely the first gives most; one without light has no field.
    powers = [0.0 if field is None else field.energy for field in hd.hologram(hd.Points([place], rgb=[[1, 0, 0]]), panel, wavelengths=LASERS)]
    assert powers[0] > 3 * max(powers[1:])
    assert hd.encode([fields[0], None, fields[2]], panel, encoding="kinoform")[1] is None


def test_an_eye_sees_frames_in_colour(wide: hd.Panel, room: hd.Scene) -> None:
    points = room.points(wide, rays=(40, 40))
    frames = hd.encode(points, wide, wavelengths=LASERS, iterations=3)
    lasers = [round(1e9 * frame.wavelength) for frame in frames if frame is not None]
    assert lasers == [638, 520, 450]
    levels = [frame.levels for frame in frames if frame is not None]
    assert not np.array_equal(levels[0], levels[1])


def test_what_three_lasers_cannot_be_is_refused(panel: hd.Panel) -> None:
    point = hd.Points([[0, 0, -0.1]])
    with pytest.raises(hd.ParameterError, match="wavelengths"):
        hd.hologram(point, panel, wavelengths="pannel")  # type: ignore[call-overload]
    with pytest.raises(hd.ParameterError, match="names 1 wavelengths, not three"):
        hd.hologram(point, panel, wavelengths="panel")
    with pytest.raises(hd.ParameterError, match="one laser"):
        hd.hologram(point, panel, wavelengths=LASERS, channel="red")  # type: ignore[call-overload]
    field = hd.hologram(point, panel)
    with pytest.raises(hd.ParameterError, match="wavelengths"):
        hd.encode(field, panel, wavelengths=LASERS)  # type: ignore[call-overload]
    with pytest.raises(hd.ParameterError, match="holds Fields"):
        hd.encode([field, 3, field], panel)  # type: ignore[list-item]


def test_a_scene_from_bytes_is_the_scene_from_its_file(panel: hd.Panel, room: hd.Scene) -> None:
    data = (ROOT / "scenes" / "cornell.gltf").read_bytes()
    scene = hd.Scene.from_bytes(data)
    assert (scene.triangles, scene.bounds) == (room.triangles, room.bounds) and "bytes" in repr(scene)
    one, other = (each.points(panel, rays=(30, 30)) for each in (scene, room))
    assert np.array_equal(one.positions, other.positions) and np.array_equal(one.amplitudes, other.amplitudes)


def packed(path: Path) -> bytes:
    """A .gltf and its one buffer as .glb."""
    told = json.loads(path.read_text())
    body = (path.parent / told["buffers"][0].pop("uri")).read_bytes()
    body += b"\0" * (-len(body) % 4)
    text = json.dumps(told).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def test_a_glb_is_read_from_bytes_and_files_beside_it_are_not() -> None:
    path = ROOT / "scenes" / "mirror-ball.gltf"
    scene = hd.Scene.from_bytes(bytearray(packed(path)), name="ball")
    assert scene.triangles == hd.Scene.load(path).triangles and "ball" in repr(scene)
    with pytest.raises(hd.InputError, match="ball: buffer 0: .*pack all into one .glb"):
        hd.Scene.from_bytes(path.read_bytes(), name="ball")
    with pytest.raises(hd.InputError):
        hd.Scene.from_bytes(packed(path)[:-100])
    with pytest.raises(hd.InputError):
        hd.Scene.from_bytes(b"")


def test_three_lasers_are_seen_and_judged_in_colour(wide: hd.Panel, room: hd.Scene, tmp_path: Path) -> None:
    points = room.points(wide, rays=(60, 60))
    light = hd.light_field(points, wide, wavelengths=LASERS, eye=(0, 0, 0.6), pupil="4mm")
    assert light.channels == 3
    frames = hd.encode(light, wide, wavelengths=LASERS, iterations=12)
    told = hd.judge(frames, light, looks=4)
    assert told["psnr"] > 20
    # The same frames against a world in which red and blue are exchanged: the colours are judged, not the brightness alone.
    codes = [light.peak * (light.codes(channel) / 65535.0) ** 2 for channel in (2, 1, 0)]
    other = hd.LightField(np.stack(codes, -1), eye=light.eye, spacing=light.spacing, window=light.window, depth=light.depth)
    assert hd.judge(frames, other, looks=4)["psnr"] < told["psnr"] - 3
    picture = hd.reconstruct(frames, points.focus["near"], eye=(0, 0, 0.6), size=(48, 27))
    assert picture.shape == picture.values.shape == (27, 48, 3) and picture.coded().shape == (27, 48, 3)
    assert "in colour" in repr(picture) and picture._repr_png_()[25] == 2, "a PNG in red, green and blue"
    # What stands left in this room is red, what stands right green.
    left, right = picture.values[8:19, 12:15].mean((0, 1)), picture.values[8:19, 33:36].mean((0, 1))
    assert left[0] > 1.5 * left[1] and right[1] > 1.5 * right[0]
    picture.save(tmp_path / "seen.png")
    picture.save(tmp_path / "seen.npy")
    assert np.array_equal(np.load(tmp_path / "seen.npy"), picture.values)
    with pytest.raises(hd.Error, match="colour is written as .png or .npy"):
        picture.save(tmp_path / "seen.tif")


def test_a_dark_laser_of_three_needs_their_names(panel: hd.Panel) -> None:
    fields = hd.hologram(hd.Points([(2e-5, 1e-5, -0.1)], rgb=[[1, 1, 1]]), panel, wavelengths=LASERS)
    white = hd.reconstruct(fields, "-100mm", size=(9, 9), window=("0.2mm", "0.2mm"))
    row, column, _ = np.unravel_index(np.argmax(white), white.shape)
    assert abs(white.x[column] - 2e-5) < 2e-5 and abs(white.y[row] - 1e-5) < 2e-5
    without_green = [fields[0], None, fields[2]]
    with pytest.raises(hd.ParameterError, match="name the three lasers"):
        hd.reconstruct(without_green, "-100mm")
    magenta = hd.reconstruct(without_green, "-100mm", size=(9, 9), window=("0.2mm", "0.2mm"), wavelengths=LASERS)
    assert magenta.values[row, column, 1] < 0.2 * white.values[row, column, 1]
    for wrong, words in [(fields[::-1], "in this order"), (fields[:2], "several wavelengths"), ([None], "no light"), ([fields[0], 3], "a list holds")]:
        with pytest.raises(hd.ParameterError, match=words):
            hd.reconstruct(wrong, "-100mm")  # type: ignore[arg-type]
    with pytest.raises(hd.ParameterError, match="give three lengths"):
        hd.reconstruct(without_green, "-100mm", wavelengths="panel")
    with pytest.raises(hd.ParameterError, match="of a list of three"):
        hd.reconstruct(fields[0], "-100mm", wavelengths=LASERS)  # type: ignore[arg-type]


def test_a_slow_eye_sees_the_mean_of_sub_frames(panel: hd.Panel) -> None:
    fields = [hd.hologram(hd.Points([(x, 0, -0.05)]), panel) for x in (-4e-5, 4e-5)]
    frames = [hd.encode(field, panel) for field in fields]
    for each in (fields, frames):
        both = np.asarray(hd.reconstruct(each, "-50mm"))
        alone = [np.asarray(hd.reconstruct(one, "-50mm")) for one in each]
        assert np.allclose(both, (alone[0] + alone[1]) / 2, rtol=1e-4, atol=1e-6 * both.max())
