//! The encodings and their names.

use super::{
    BandGradient, Binarisation, BinaryFringe, Cell, CellHologram, DoublePhase, ErrorDiffusion, OffAxis, PlaneEncoding,
    PlaneMethod, ViewEncoding,
};
use crate::names::{Name, Named};
use crate::panel::Modulation;

/// The ways from a complex field to what a panel can show.
#[derive(Clone, Debug, PartialEq)]
pub enum Encoding {
    /// Two phases for one complex value, interlaced: Hsueh & Sawchuk 1978.
    DoublePhase(DoublePhase),
    /// The field's phase alone, its amplitude dropped: Lesem, Hirsch & Jordan 1969.
    Kinoform,
    /// Interference term of object and oblique reference, Re(u·r*), raised to be positive.
    OffAxisBipolar(OffAxis),
    /// Interference of object and oblique reference as a plate records it, |u + r|².
    OffAxisIntensity(OffAxis),
    /// Real part of the object's upper half of the band, raised to be positive: Bryngdahl & Lohmann 1968.
    SingleSideBand(OffAxis),
    /// Phase alone, the error of each pixel handed on to its neighbours: Tsang & Poon 2013.
    ErrorDiffusion(ErrorDiffusion),
    /// Phases found by gradient descent, so that the field within a band comes out as a complex field.
    Gradient(BandGradient),
    /// Phases found so that the field's amplitudes stand on planes, whatever their phases there.
    Planes(PlaneEncoding),
    /// Phases found so that an eye's pupil sees the views of a light field ([`super::view`]).
    View(ViewEncoding),
    /// Amplitudes of neighbouring columns whose light has different phases along the carrier.
    Cells(CellHologram),
    /// Fringes of two amplitudes.
    Binary(BinaryFringe),
}

impl Named for Encoding {
    const KIND: &'static str = "encoding";
    const NAMES: &'static [Name<Self>] = &[
        ("double-phase", || Self::DoublePhase(DoublePhase::default()), "two phases for one complex value, interlaced"),
        ("kinoform", || Self::Kinoform, "the field's phase alone"),
        ("off-axis-bipolar", || Self::OffAxisBipolar(OffAxis::default()), "fringes with an oblique reference, raised"),
        ("off-axis-intensity", || Self::OffAxisIntensity(OffAxis::default()), "interference as a plate records it"),
        ("single-side-band", || Self::SingleSideBand(OffAxis::default()), "fringes of the upper half of the band"),
        ("error-diffusion", || Self::ErrorDiffusion(ErrorDiffusion::default()), "phase alone, its error handed on"),
        ("gradient", || Self::Gradient(BandGradient::default()), "the complex field by gradient descent"),
        ("plane-gradient", || planes(PlaneMethod::Gradient), "amplitudes at depths by gradient descent"),
        ("gerchberg-saxton", || planes(PlaneMethod::GerchbergSaxton), "amplitudes at depths by projections"),
        ("weighted", || planes(PlaneMethod::Weighted), "the same, what is too dark weighted up"),
        ("double-constraint", || planes(PlaneMethod::DoubleConstraint), "amplitude and phase at depths: no speckle"),
        ("view", || Self::View(ViewEncoding::default()), "what an eye's pupil sees of the scene"),
        ("burckhardt", || cells(Cell::Burckhardt), "three amplitudes for one complex value"),
        ("lee", || cells(Cell::Lee), "four amplitudes for one complex value"),
        ("binary-threshold", || binary(Binarisation::Threshold), "fringes of two amplitudes by threshold"),
        ("binary-diffusion", || binary(Binarisation::ErrorDiffusion), "the same by error diffusion"),
        ("binary-search", || binary(Binarisation::DirectSearch { sweeps: 5 }), "the same by direct search"),
    ];

    fn name(&self) -> &'static str {
        match self {
            Self::DoublePhase(_) => "double-phase",
            Self::Kinoform => "kinoform",
            Self::OffAxisBipolar(_) => "off-axis-bipolar",
            Self::OffAxisIntensity(_) => "off-axis-intensity",
            Self::SingleSideBand(_) => "single-side-band",
            Self::ErrorDiffusion(_) => "error-diffusion",
            Self::Gradient(_) => "gradient",
            Self::Planes(settings) => settings.method.name(),
            Self::View(_) => "view",
            Self::Cells(settings) => settings.cell.name(),
            Self::Binary(settings) => settings.method.name(),
        }
    }
}

fn planes(method: PlaneMethod) -> Encoding {
    Encoding::Planes(PlaneEncoding::new(method))
}

fn cells(cell: Cell) -> Encoding {
    Encoding::Cells(CellHologram { cell, percentile: 0.999 })
}

fn binary(method: Binarisation) -> Encoding {
    Encoding::Binary(BinaryFringe::new(method))
}

impl Encoding {
    /// The usual encoding for what a panel modulates.
    pub fn usual(modulation: Modulation) -> Self {
        match modulation {
            Modulation::Amplitude => Self::OffAxisBipolar(OffAxis::default()),
            Modulation::Phase => Self::DoublePhase(DoublePhase::default()),
        }
    }

    /// What its pattern modulates.
    pub fn modulation(&self) -> Modulation {
        match self {
            Self::DoublePhase(_)
            | Self::Kinoform
            | Self::ErrorDiffusion(_)
            | Self::Gradient(_)
            | Self::Planes(_)
            | Self::View(_) => Modulation::Phase,
            Self::OffAxisBipolar(_)
            | Self::OffAxisIntensity(_)
            | Self::SingleSideBand(_)
            | Self::Cells(_)
            | Self::Binary(_) => Modulation::Amplitude,
        }
    }
}
