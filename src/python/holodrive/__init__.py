"""Holograms for spatial light modulators, from NumPy arrays: scene, points, field, frame, light, picture.

Data goes one way, and each step takes what the one before gave, or arrays of your own::

    import holodrive as hd

    panel = hd.Panel("generic", wavelength="532nm")
    points = hd.Scene.load("cornell.gltf").points(panel)      # or hd.Points(positions, amplitudes=…)
    field = hd.hologram(points, panel)                        # complex64, np.asarray(field) is a view
    frame = hd.encode(field, panel)                           # levels for the panel
    seen = hd.reconstruct(frame, z="-120mm")                  # what a sensor sees there

    light = hd.light_field(points, panel)                     # what an eye should see
    frame = hd.encode(light, panel)                           # encoding="view": made for that eye
    hd.judge(frame, light)["psnr"]

Lengths are metres, or text with a unit ("8um", "632.8nm", "0.25m"); angles radians, or text ("1.1deg"). The frame of reference has
the panel at z = 0, +x right, +y up, +z towards the viewer; arrays have row 0 on top. The time factor is exp(-iωt): a diverging wave
is exp(+ikr)/r. Long calls release the interpreter's lock, hear Ctrl-C, and tell their progress.
"""

from ._errors import (
    CalibrationError,
    DisplayError,
    Error,
    FileError,
    InputError,
    MemoryBudgetError,
    MissingFileError,
    OutOfRangeError,
    ParameterError,
    UndersampledError,
    UnsupportedError,
)
from ._holodrive import (
    Field,
    Frame,
    LightField,
    Panel,
    Picture,
    Points,
    Scene,
    __version__,
    calibrate_camera,
    encode,
    encode_in_the_loop,
    hologram,
    judge,
    length,
    light_field,
    metrics,
    panels,
    print_plate,
    propagate,
    reconstruct,
)
from ._serve import Served, serve
from ._together import Bench, Together
from .slm import SLM, Shown

__all__ = [
    "SLM",
    "Bench",
    "CalibrationError",
    "DisplayError",
    "Error",
    "Field",
    "FileError",
    "Frame",
    "InputError",
    "LightField",
    "MemoryBudgetError",
    "MissingFileError",
    "OutOfRangeError",
    "Panel",
    "ParameterError",
    "Picture",
    "Points",
    "Scene",
    "Served",
    "Shown",
    "Together",
    "UndersampledError",
    "UnsupportedError",
    "__version__",
    "calibrate_camera",
    "encode",
    "encode_in_the_loop",
    "hologram",
    "judge",
    "length",
    "light_field",
    "metrics",
    "panels",
    "print_plate",
    "propagate",
    "reconstruct",
    "serve",
]
