"""Types of the part of holodrive that is compiled."""

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol, TypedDict, final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from typing_extensions import TypeAlias

__version__: str

#: Metres, or text with a unit: "8um", "632.8nm".
Length: TypeAlias = float | str
#: Radians, or text with a unit: "1.1deg".
Angle: TypeAlias = float | str
#: One for x and y, or (x, y).
Lengths: TypeAlias = Length | tuple[Length, Length] | list[Any] | NDArray[Any]
#: (x, y, z) in the hologram frame.
Place: TypeAlias = tuple[Length, Length, Length] | list[Any] | NDArray[Any]
#: Diameter, or all of the panel's light.
Pupil: TypeAlias = Length | Literal["all"]
#: Wavelengths of three lasers, or those that the panel's profile names.
Lasers: TypeAlias = tuple[Length, Length, Length] | list[Any] | NDArray[Any] | Literal["panel"]
PathLike: TypeAlias = str | os.PathLike[str]

class Bar(Protocol):
    """A bar of tqdm's."""

    n: Any
    total: Any
    def update(self, n: Any = ..., /) -> Any: ...
    def refresh(self) -> Any: ...

Progress: TypeAlias = Callable[[str, int, int], object] | Bar | bool | None

class EncodeReport(TypedDict):
    """What came of an encoding on the panel's own levels."""

    encoding: str
    efficiency: float
    field_error: float
    clipped: float
    dropped: float
    quantisation_error: float
    unreachable: float
    warnings: list[str]

class HologramReport(TypedDict):
    """What computing a field took."""

    engine: str
    reason: str
    seconds: float
    predicted_seconds: float
    error_bound: float
    measured_error: float
    memory: int
    points: int
    unreached: int
    light_outside: float
    pairs: float
    warnings: list[str]

@final
class Panel:
    """A panel in the light of one laser."""

    def __new__(
        cls,
        profile: PathLike | None = None,
        *,
        wavelength: Length | None = None,
        width: int | None = None,
        height: int | None = None,
        pitch: Lengths | None = None,
        bits: int = 8,
        modulation: Literal["phase", "amplitude"] = "phase",
        fill_factor: float = 1.0,
        curve: ArrayLike | None = None,
        correction: PathLike | None = None,
    ) -> Panel: ...
    def at(self, wavelength: Length) -> Panel: ...
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def pitch(self) -> tuple[float, float]: ...
    @property
    def wavelength(self) -> float: ...
    @property
    def bits(self) -> int: ...
    @property
    def levels(self) -> int: ...
    @property
    def modulation(self) -> str: ...
    @property
    def fill_factor(self) -> float: ...
    @property
    def dead_space(self) -> float: ...
    @property
    def crosstalk(self) -> float: ...
    @property
    def settle_time(self) -> float | None: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def curve(self) -> NDArray[np.float64]: ...
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def y(self) -> NDArray[np.float64]: ...

@final
class Scene:
    """A scene and the light on its surfaces."""

    @staticmethod
    def load(
        path: PathLike,
        *,
        camera: str | int | None = None,
        animation: str | int | None = None,
        time: float = 0.0,
        environment: PathLike | None = None,
        sky: tuple[Angle, Angle] | None = None,
        viewer_light: bool = False,
        bounces: int = 32,
        photons: int | None = None,
        seed: int = 1,
        progress: Progress = None,
    ) -> Scene: ...
    @staticmethod
    def from_bytes(
        data: bytes | bytearray,
        *,
        name: str = "bytes",
        camera: str | int | None = None,
        animation: str | int | None = None,
        time: float = 0.0,
        environment: PathLike | None = None,
        sky: tuple[Angle, Angle] | None = None,
        viewer_light: bool = False,
        bounces: int = 32,
        photons: int | None = None,
        seed: int = 1,
        progress: Progress = None,
    ) -> Scene: ...
    def points(
        self,
        panel: Panel,
        *,
        rays: tuple[int, int] = (500, 500),
        points: int | Literal["eye", "panel"] | None = None,
        placement: Literal["window", "model"] = "window",
        viewer: Length = 0.6,
        near: Length | None = None,
        far: Length | None = None,
        scale: float | None = None,
        phase: Literal["random", "zero", "path"] = "random",
        white: float | Literal["auto", "none"] | None = None,
        seed: int | None = None,
        progress: Progress = None,
    ) -> Points: ...
    @property
    def triangles(self) -> int: ...
    @property
    def bounds(self) -> tuple[list[float], list[float]] | None: ...

@final
class Points:
    """Point sources in the hologram frame."""

    def __new__(
        cls,
        positions: ArrayLike,
        *,
        amplitudes: ArrayLike | None = None,
        phases: ArrayLike | None = None,
        rgb: ArrayLike | None = None,
    ) -> Points: ...
    @staticmethod
    def read(path: PathLike) -> Points: ...
    def write(self, path: PathLike) -> None: ...
    def __len__(self) -> int: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def amplitudes(self) -> NDArray[np.float32]: ...
    @property
    def phases(self) -> NDArray[np.float64]: ...
    @property
    def rgb(self) -> NDArray[np.float32] | None: ...
    @property
    def depth(self) -> tuple[float, float] | None: ...
    @property
    def picture(self) -> NDArray[np.float32] | None: ...
    @property
    def focus(self) -> dict[str, float]: ...

@final
class Field:
    """A wave on a plane."""

    def __new__(
        cls,
        samples: ArrayLike,
        pitch: Lengths,
        wavelength: Length,
        *,
        z: Length = 0.0,
        depth: tuple[Length, Length] | None = None,
    ) -> Field: ...
    @staticmethod
    def load(path: PathLike, *, pitch: Lengths | None = None, wavelength: Length | None = None) -> Field: ...
    def save(self, path: PathLike) -> None: ...
    @property
    def samples(self) -> NDArray[np.complex64]: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def pitch(self) -> tuple[float, float]: ...
    @property
    def wavelength(self) -> float: ...
    @property
    def z(self) -> float: ...
    @property
    def depth(self) -> tuple[float, float] | None: ...
    @property
    def energy(self) -> float: ...
    @property
    def report(self) -> HologramReport | None: ...

@final
class Frame:
    """Drive levels for every pixel of a panel."""

    def __new__(cls, levels: ArrayLike, panel: Panel) -> Frame: ...
    @staticmethod
    def load(path: PathLike, panel: Panel | None = None) -> Frame: ...
    def save(self, path: PathLike) -> None: ...
    @property
    def levels(self) -> NDArray[np.uint8] | NDArray[np.uint16]: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def bits(self) -> int: ...
    @property
    def wavelength(self) -> float: ...
    @property
    def depth(self) -> tuple[float, float] | None: ...
    @property
    def metadata(self) -> dict[str, Any]: ...
    @property
    def report(self) -> EncodeReport | None: ...
    def _repr_png_(self) -> bytes: ...

@final
class LightField:
    """Pinhole views of a lit scene over an eye box."""

    def __new__(
        cls, views: ArrayLike, *, eye: Place, spacing: Length, window: Lengths, depth: tuple[Length, Length]
    ) -> LightField: ...
    @staticmethod
    def load(path: PathLike) -> LightField: ...
    def save(self, path: PathLike) -> None: ...
    @property
    def shape(self) -> tuple[int, int, int, int]: ...
    @property
    def channels(self) -> int: ...
    @property
    def eye(self) -> tuple[float, float, float]: ...
    @property
    def spacing(self) -> float: ...
    @property
    def window(self) -> tuple[float, float]: ...
    @property
    def depth(self) -> tuple[float, float]: ...
    @property
    def peak(self) -> float: ...
    def codes(self, channel: int = 0) -> NDArray[np.uint16]: ...
    def view(self, row: int | None = None, column: int | None = None, *, channel: int = 0) -> NDArray[np.float32]: ...

@final
class Picture:
    """What is seen of a field or a frame: linear intensity, or colours of linear light."""

    @property
    def values(self) -> NDArray[np.float32]: ...
    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @property
    def focus(self) -> float: ...
    @property
    def window(self) -> tuple[float, float]: ...
    @property
    def x(self) -> NDArray[np.float64]: ...
    @property
    def y(self) -> NDArray[np.float64]: ...
    def coded(self, white: float | None = None) -> NDArray[np.uint8]: ...
    def save(self, path: PathLike, white: float | None = None) -> None: ...
    def _repr_png_(self) -> bytes: ...

def _worked() -> float: ...
def panels() -> list[str]: ...
def length(value: Length) -> float: ...
def program(arguments: Sequence[PathLike]) -> int: ...
@overload
def hologram(
    points: Points,
    panel: Panel,
    *,
    error: float = 1e-3,
    engine: str | None = None,
    channel: str = "luminance",
    wavelengths: None = None,
    memory: int | str | None = None,
    progress: Progress = None,
) -> Field: ...
@overload
def hologram(
    points: Points,
    panel: Panel,
    *,
    wavelengths: Lasers,
    error: float = 1e-3,
    engine: str | None = None,
    memory: int | str | None = None,
    progress: Progress = None,
) -> list[Field | None]: ...
def propagate(
    field: Field,
    distance: Length,
    *,
    kernel: Literal["angular-spectrum", "fresnel"] = "angular-spectrum",
    progress: Progress = None,
) -> Field: ...
def light_field(
    source: Scene | Points | LightField,
    panel: Panel,
    *,
    eye: Place | None = None,
    pupil: Pupil | None = None,
    eye_box: Lengths | None = None,
    channel: str = "luminance",
    wavelengths: Lasers | None = None,
    progress: Progress = None,
) -> LightField: ...
@overload
def encode(
    source: Field | Scene | Points | LightField | ArrayLike,
    panel: Panel,
    *,
    encoding: str | None = None,
    iterations: int | None = None,
    depths: Sequence[Length] | None = None,
    start: str | None = None,
    reference_angle: tuple[Angle, Angle] | None = None,
    blaze: tuple[Angle, Angle] | None = None,
    lens: Length | None = None,
    stop: Angle | None = None,
    eye: Place | None = None,
    pupil: Pupil | None = None,
    eye_box: Lengths | None = None,
    subframes: None = None,
    wavelengths: None = None,
    seed: int = 1,
    progress: Progress = None,
) -> Frame: ...
@overload
def encode(
    source: list[Field | None],
    panel: Panel,
    *,
    encoding: str | None = None,
    iterations: int | None = None,
    depths: Sequence[Length] | None = None,
    start: str | None = None,
    reference_angle: tuple[Angle, Angle] | None = None,
    blaze: tuple[Angle, Angle] | None = None,
    lens: Length | None = None,
    stop: Angle | None = None,
    seed: int = 1,
    progress: Progress = None,
) -> list[Frame | None]: ...
@overload
def encode(
    source: Scene | Points | LightField,
    panel: Panel,
    *,
    wavelengths: Lasers,
    encoding: Literal["view"] | None = None,
    iterations: int | None = None,
    eye: Place | None = None,
    pupil: Pupil | None = None,
    eye_box: Lengths | None = None,
    seed: int = 1,
    progress: Progress = None,
) -> list[Frame | None]: ...
@overload
def encode(
    source: Scene | Points | LightField,
    panel: Panel,
    *,
    subframes: int,
    encoding: Literal["view"] | None = None,
    iterations: int | None = None,
    eye: Place | None = None,
    pupil: Pupil | None = None,
    eye_box: Lengths | None = None,
    seed: int = 1,
    progress: Progress = None,
) -> list[Frame]: ...
def calibrate_camera(
    show: Callable[[NDArray[Any]], object],
    photograph: Callable[[], ArrayLike],
    panel: Panel,
    *,
    lens: Length,
    camera_pitch: Length,
    output: PathLike | None = None,
    progress: Progress = None,
) -> dict[str, Any]: ...
def encode_in_the_loop(
    picture: ArrayLike,
    panel: Panel,
    camera: PathLike,
    show: Callable[[NDArray[Any]], object],
    photograph: Callable[[], ArrayLike],
    *,
    room: tuple[float, float, float, float] = (-0.9, 0.15, 0.9, 0.9),
    iterations: int = 150,
    photos: int = 30,
    step: float = 0.05,
    progress: Progress = None,
) -> Frame: ...
def reconstruct(
    light: Frame | Field | list[Frame | None] | list[Field | None] | list[Frame] | list[Field],
    z: Length,
    *,
    eye: Place | None = None,
    pupil: Length | None = None,
    size: tuple[int, int] | None = None,
    window: Lengths | None = None,
    wavelengths: Lasers | None = None,
    subpixels: int = 1,
    crosstalk: float = 0.0,
    wavefront_error: PathLike | None = None,
    zero_order_stop: Angle = 0.0,
    progress: Progress = None,
) -> Picture: ...
def judge(
    frames: Frame | Sequence[Frame | None],
    light: LightField,
    *,
    eye: Place | None = None,
    pupil: Pupil | None = None,
    eye_box: Lengths | None = None,
    wavelengths: Lasers | None = None,
    looks: int = 24,
    seed: int = 1,
    progress: Progress = None,
) -> dict[str, float]: ...
def metrics(
    seen: ArrayLike | Picture | Field, wanted: ArrayLike | Picture | Field, *, white: float | None = None
) -> dict[str, float]: ...
def print_plate(
    source: PathLike,
    plate: PathLike,
    folder: PathLike,
    *,
    dry_run: bool = False,
    shard: str | None = None,
    progress: Progress = None,
) -> dict[str, Any]: ...
