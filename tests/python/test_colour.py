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
